"""XML of strangers: no document type, so no entities, nothing from outside, and no more than fits."""

from __future__ import annotations

from typing import Any

MOST_BYTES = 256 * 1024 * 1024
"""Largest file of XML that is read."""
_UTF16 = (b"\xff\xfe", b"\xfe\xff")


class PlainXmlError(ValueError):
    """A file of XML must not be read; the message says why."""


def require_plain(content: bytes, name: str) -> None:
    """Refuse XML with a document type, in another encoding than ASCII's relatives, or too large.

    Raises
    ------
    PlainXmlError
        With the file and the rule.
    """
    if len(content) > MOST_BYTES:
        raise PlainXmlError(f"{name} has {len(content)} bytes, and at most {MOST_BYTES} are read")
    if content.startswith(_UTF16) or b"\0" in content:
        raise PlainXmlError(f"{name} is not in UTF-8, as FMI and SSP want it")
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise PlainXmlError(f"{name} has a DOCTYPE, by which entities expand without bound: remove it")


def parse_plain(content: bytes, name: str) -> Any:
    """Return the root element of XML, by a parser that expands and fetches nothing.

    Raises
    ------
    PlainXmlError
        If it must not be read, or is not XML.
    """
    from lxml import etree

    require_plain(content, name)
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)
    try:
        return etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        raise PlainXmlError(f"{name} is no XML: {error}") from error
