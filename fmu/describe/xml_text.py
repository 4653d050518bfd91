"""Text, numbers and documents as XML has them."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def in_xml(character: str) -> bool:
    """Whether XML 1.0 can hold a character."""
    return _NOT_XML.match(character) is None


def xml_text(text: str) -> str:
    """Return text for an XML attribute: what XML 1.0 cannot hold becomes U+FFFD, the replacement character."""
    return _NOT_XML.sub("\ufffd", text)


def number(value: float) -> str:
    """Return a double as XML Schema writes it, without loss."""
    if math.isfinite(value):
        whole = abs(value) < 1e15 and value == int(value)
        return f"{value:.0f}" if whole else repr(float(value))
    return "NaN" if math.isnan(value) else "INF" if value > 0 else "-INF"


def to_bytes(root: ET.Element) -> bytes:
    """Return an XML document in UTF-8, indented."""
    ET.indent(root)
    document: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    # The declaration with double quotes, as every example of the standard has it.
    return (
        document.replace(b"<?xml version='1.0' encoding='utf-8'?>", b'<?xml version="1.0" encoding="UTF-8"?>') + b"\n"
    )
