"""XML of strangers: refused before it can do harm, then parsed and held against the standard's schemas.

What is not UTF-8 is first written in UTF-8.  The bytes then pass expat, which builds nothing: it stops at a DOCTYPE, at
too much depth and at too many elements.  Only then lxml builds a tree, with neither entities nor network.  lxml
(libxml2) is chosen for the schemas since fmpy brings it along, it reads both versions' schemas, and a description of
60 MB takes it seconds, not minutes.
"""

from __future__ import annotations

import functools
import importlib.util
import re
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

from lxml import etree

from fmu.validate.findings import Finding, error

STANDARD = "FMI 2.0.4 section 2.2; FMI 3.0.2 section 2.4"


@dataclass(frozen=True)
class XmlLimits:
    """What an XML file may hold: bytes, elements within one another, elements in all."""

    size: int = 64 << 20
    depth: int = 100
    elements: int = 3_000_000


LIMITS = XmlLimits()
_DECLARATION = re.compile(rb"(\xef\xbb\xbf)?<\?xml[^>]{0,200}?encoding\s{0,9}=\s{0,9}[\"']([A-Za-z0-9._-]+)")
_ENCODING = re.compile(r"^(\ufeff?<\?xml[^>]{0,200}?encoding\s{0,9}=\s{0,9}[\"'])[A-Za-z0-9._-]+([\"'])")
_READABLE = re.compile(r"(us-)?ascii|iso-8859-\d{1,2}|latin-?1|windows-125\d|cp125\d|utf-16", re.IGNORECASE)


class XmlError(ValueError):
    """An XML file is refused.

    Attributes
    ----------
    finding : Finding
    """

    def __init__(self, finding: Finding) -> None:
        super().__init__(finding.message)
        self.finding = finding


def parse(content: bytes, name: str, limits: XmlLimits = LIMITS) -> etree._Element:
    """Parse an XML file of an FMU.

    Parameters
    ----------
    content : bytes
        The file.
    name : str
        Its name, for messages.
    limits : XmlLimits

    Returns
    -------
    lxml element
        The root.

    Raises
    ------
    XmlError
        If the file is too large, not UTF-8, not well-formed, too deep, or has a document type.
    """
    require_size(len(content), name, limits)
    _require_utf8(content, name)
    _scan(content, name, limits)
    parser = etree.XMLParser(
        encoding="utf-8",
        resolve_entities=False,
        no_network=True,
        huge_tree=False,
        load_dtd=False,
        remove_comments=True,
        remove_pis=True,
    )
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as problem:
        raise _refused(
            "syntax",
            f"{name} is not well-formed XML: {problem.msg if isinstance(problem, etree.XMLSyntaxError) else problem}.",
        ) from problem
    return root


def as_utf8(content: bytes, name: str) -> tuple[bytes, list[Finding]]:
    """Return an XML file in UTF-8, and the finding that it is not, so that the rest of it can be looked at.

    Only codings whose characters below 128 are those of ASCII, and UTF-16 with its mark, are read.

    Parameters
    ----------
    content : bytes
        The file.
    name : str
        Its name, for messages.

    Returns
    -------
    bytes
    list of Finding

    Raises
    ------
    XmlError
        If the file is in a coding that is not read, or not in the one it says.
    """
    declared = _DECLARATION.match(content)
    said = declared[2].decode() if declared else ""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        coding, why = "utf-16", "it begins with the mark of UTF-16"
    elif said and said.lower() not in ("utf-8", "utf8"):
        coding, why = said, f"it says its encoding is {said}"
    else:
        try:
            content.decode("utf-8")
        except UnicodeDecodeError as problem:
            coding, why = "windows-1252", f"byte {problem.start} does not belong to it"
        else:
            return content, []
    try:
        if not _READABLE.fullmatch(coding):
            raise LookupError(coding)
        text = content.decode(coding, "strict" if coding == said else "replace")
    except (LookupError, UnicodeDecodeError) as problem:
        raise _refused("encoding", f"{name} is not UTF-8: {why}. FMI asks for UTF-8: write it in UTF-8.") from problem
    unsaid = _ENCODING.sub(r"\1UTF-8\2", text, count=1)
    message = f"{name} is not UTF-8: {why}. FMI asks for UTF-8: write it in UTF-8 (it was read as {coding})."
    return unsaid.encode("utf-8", "replace"), [error("xml.encoding", message, STANDARD)]


def require_size(size: int, name: str, limits: XmlLimits = LIMITS) -> None:
    """Refuse an XML file by its size in bytes, best before it is read.

    Raises
    ------
    XmlError
        If it is too large.
    """
    if size > limits.size:
        raise _refused("size", f"{name} has {size} bytes; at most {limits.size} are accepted.")


def _refused(rule: str, message: str) -> XmlError:
    return XmlError(error(f"xml.{rule}", message, STANDARD))


def _require_utf8(content: bytes, name: str) -> None:
    if b"\0" in content:
        raise _refused(
            "nul", f"{name} has a NUL byte at {content.index(0)}: it is damaged or not UTF-8. Write it in UTF-8."
        )
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as problem:
        raise _refused(
            "encoding", f"{name} is not UTF-8 at byte {problem.start}; FMI asks for UTF-8: write it in UTF-8."
        ) from problem
    declared = _DECLARATION.match(content)
    if declared and declared[2].lower() not in (b"utf-8", b"utf8"):
        raise _refused(
            "encoding", f"{name} says its encoding is {declared[2].decode()}; FMI asks for UTF-8: write it in UTF-8."
        )


class _Stop(Exception):
    def __init__(self, rule: str, message: str) -> None:
        self.rule, self.message = rule, message


def _scan(content: bytes, name: str, limits: XmlLimits) -> None:
    depth = elements = 0

    def doctype(*_: object) -> None:
        raise _Stop(
            "doctype", f"{name} has a DOCTYPE, by which entities expand without bound; FMI has none: remove it."
        )

    def start(*_: object) -> None:
        nonlocal depth, elements
        depth, elements = depth + 1, elements + 1
        if depth > limits.depth:
            raise _Stop("depth", f"{name} has elements more than {limits.depth} deep; FMI's have fewer than 20.")
        if elements > limits.elements:
            raise _Stop("elements", f"{name} has more than {limits.elements} elements, which is the accepted number.")

    def end(*_: object) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate("utf-8")
    parser.StartDoctypeDeclHandler = doctype
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    try:
        parser.Parse(content, True)
    except _Stop as stop:
        raise _refused(stop.rule, stop.message) from None
    except expat.ExpatError as problem:
        raise _refused("syntax", f"{name} is not well-formed XML: {problem}.") from problem


@functools.cache
def _schema(file: str) -> etree.XMLSchema:
    spec = importlib.util.find_spec("fmpy")
    places = (spec.submodule_search_locations or []) if spec else []
    path = Path(next(iter(places))) / "schema" / file
    return etree.XMLSchema(etree.parse(str(path), etree.XMLParser(no_network=True)))


def schema_findings(root: etree._Element, name: str, schema: str) -> list[Finding]:
    """Hold a tree against a schema of the standard.

    Parameters
    ----------
    root : lxml element
    name : str
        The file's name, for messages.
    schema : str
        File below fmpy's folder ``schema``.

    Returns
    -------
    list of Finding
        One for each place that does not fit.
    """
    validator = _schema(schema)
    if validator.validate(root):
        return []
    messages = [f"{entry.message[:400]} ({name}, line {entry.line})" for entry in validator.error_log]
    reference = f"{Path(schema).name} of the standard"
    return [error("schema.valid", f"{message}", reference) for message in messages] or [
        error("schema.valid", f"{name} does not fit the schema.", reference)
    ]
