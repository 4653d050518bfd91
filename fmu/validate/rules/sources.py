"""Rules for the sources that an archive holds."""

from __future__ import annotations

from collections.abc import Iterator

from fmu.archives.reading import Archive
from fmu.standard.platforms import parts_of
from fmu.validate.findings import Finding, error, quoted, softened, warning
from fmu.validate.reading.description import Description
from fmu.validate.reading.xml_members import checked

SOURCES = "FMI 2.0.4 section 2.3; FMI 3.0.2 section 2.5.1.4"
_BUILD = "sources/buildDescription.xml"


def source_findings(archive: Archive, description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the sources: errors where there is nothing else to run, else warnings."""
    found = (*_source_files(archive, description), *_build_description(archive, description))
    alone = not any(name.startswith("binaries/") for name in archive.names)
    yield from found if alone else map(softened, found)


def _source_files(archive: Archive, description: Description) -> Iterator[Finding]:
    listed = dict.fromkeys(file for files in description.source_files.values() for file in files)
    present = set(archive.names)
    missing = [file for file in listed if f"sources/{file}" not in present]
    if missing:
        yield error("source.missing", f"The description lists {_some(missing)} in sources/.", SOURCES)


def _build_description(archive: Archive, description: Description) -> Iterator[Finding]:
    names = set(archive.names)
    if _BUILD not in names:
        if description.major == 3 and any(name.startswith("sources/") for name in names):
            yield error(
                "source.description", f"There are sources but no {_BUILD}: no importer can compile them.", SOURCES
            )
        return
    root, findings = checked(archive, _BUILD, "fmi3/fmi3BuildDescription.xsd")
    yield from findings
    if root is None:
        return
    identifiers = {attributes.get("modelIdentifier") for attributes in description.interfaces.values()}
    seen: set[tuple[str | None, str | None]] = set()
    for build in root.iterfind("BuildConfiguration"):
        identifier, platform = build.get("modelIdentifier"), build.get("platform")
        if identifier not in identifiers:
            yield error(
                "source.identifier",
                f"{_BUILD} builds {quoted(str(identifier))}, which is no modelIdentifier of the FMU.",
                SOURCES,
            )
        if (identifier, platform) in seen:
            yield error(
                "source.configuration",
                f"{_BUILD} has two configurations for {quoted(str(identifier))} on {platform}.",
                SOURCES,
            )
        seen.add((identifier, platform))
        if platform is not None and parts_of(platform) is None:
            yield warning(
                "source.platform", f"{_BUILD} names the platform {quoted(platform)}, which is not standard.", SOURCES
            )
    files = dict.fromkeys(str(f.get("name")) for f in root.iterfind("BuildConfiguration/SourceFileSet/SourceFile"))
    missing = [file for file in files if f"sources/{file}" not in names]
    if missing:
        yield error("source.missing", f"{_BUILD} lists {_some(missing)} in sources/.", SOURCES)
    folders = dict.fromkeys(
        str(f.get("name")) for f in root.iterfind("BuildConfiguration/SourceFileSet/IncludeDirectory")
    )
    missing = [folder for folder in folders if not any(name.startswith(_prefix(folder)) for name in names)]
    if missing:
        yield error("source.missing", f"{_BUILD} includes {_some(missing)} in sources/.", SOURCES)


def _prefix(folder: str) -> str:
    return f"sources/{folder}".rstrip("/.") + "/"


def _some(names: list[str]) -> str:
    """Return the first few of the names, how many there are, and that they are missing."""
    shown = ", ".join(map(quoted, names[:5]))
    if len(names) == 1:
        return f"{shown}, which is not"
    return f"{shown}{', ...' if len(names) > 5 else ''} ({len(names)} in all), which are not"
