"""XML files of an archive beside its description."""

from __future__ import annotations

from lxml import etree

from fmu.archives.reading import Archive, ArchiveError
from fmu.validate.findings import Finding, error
from fmu.validate.reading.xml_file import XmlError, as_utf8, parse, require_size, schema_findings


def tree(archive: Archive, name: str) -> tuple[etree._Element | None, list[Finding]]:
    """Return a file's tree if it is sound XML, and what is wrong with it."""
    try:
        require_size(archive.size(name), name)
        content, findings = as_utf8(archive.read(name), name)
        return parse(content, name), findings
    except XmlError as problem:
        return None, [problem.finding]
    except ArchiveError as problem:
        return None, [error(f"archive.{rule}", sentence) for rule, sentence in problem.problems]


def checked(archive: Archive, name: str, schema: str) -> tuple[etree._Element | None, list[Finding]]:
    """Return a file's tree if it is sound and fits its schema, and what is wrong with it."""
    root, findings = tree(archive, name)
    unfit = [] if root is None else schema_findings(root, name, schema)
    return (None if unfit else root), [*findings, *unfit]
