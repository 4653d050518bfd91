"""Rules for what an archive holds beside description, binaries, sources and terminals: further archives, manifests."""

from __future__ import annotations

from collections.abc import Iterator

from fmu.archives.reading import Archive
from fmu.validate.findings import Finding, error, note, quoted, softened, warning
from fmu.validate.reading.description import Description
from fmu.validate.reading.xml_members import tree
from fmu.validate.rules.sources import source_findings
from fmu.validate.rules.terminals import terminal_findings

LAYERED = "FMI 3.0.2 section 2.6"
_MANIFEST = "http://fmi-standard.org/fmi-ls-manifest"
_PACKED = (".zip", ".fmu", ".ssp", ".gz", ".xz", ".7z", ".tar", ".bz2")


def file_findings(archive: Archive, description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the further files of an archive."""
    if archive.prefixed:
        yield warning("archive.prefix", "Bytes precede the archive: strict readers refuse it. Pack the FMU anew.")
    packed = [name for name in archive.names if name.lower().endswith(_PACKED)]
    if packed:
        yield note("archive.nested", f"The archive {quoted(packed[0])} within the FMU has not been opened.")
    yield from source_findings(archive, description)
    yield from terminal_findings(archive, description)
    for name in archive.names:
        if description.major == 3 and name.startswith("extra/") and name.endswith("/fmi-ls-manifest.xml"):
            yield from map(softened, _manifest(archive, name))


def _manifest(archive: Archive, name: str) -> Iterator[Finding]:
    # The standard asks for three attributes and leaves root element and content to the layered standard.
    root, findings = tree(archive, name)
    yield from findings
    if root is None:
        return
    for attribute in ("fmi-ls-name", "fmi-ls-version", "fmi-ls-description"):
        if root.get(f"{{{_MANIFEST}}}{attribute}") is None:
            yield error(
                "layered.manifest", f"{name} has no attribute {attribute} of the namespace {_MANIFEST}.", LAYERED
            )
