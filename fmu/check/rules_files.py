"""Rules for what an archive holds beside description and binaries: sources, terminals, icons, manifests."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from fmu.check.archive import Archive, ArchiveError
from fmu.check.description import Description
from fmu.check.findings import Finding, error, note, quoted, warning
from fmu.check.platforms import parts_of
from fmu.check.xml_file import XmlError, parse, require_size, schema_findings

SOURCES = "FMI 2.0.4 section 2.3; FMI 3.0.2 section 2.5.1.4"
TERMINALS = "FMI 3.0.2 section 2.4.9"
LAYERED = "FMI 3.0.2 section 2.6"
_TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
_MANIFEST = "http://fmi-standard.org/fmi-ls-manifest"
_BUILD = "sources/buildDescription.xml"
_CONNECTED = ("input", "output", "parameter", "calculatedParameter")
_PACKED = (".zip", ".fmu", ".ssp", ".gz", ".xz", ".7z", ".tar", ".bz2")


def file_findings(archive: Archive, description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the further files of an archive."""
    if archive.prefixed:
        yield warning("archive.prefix", "Bytes precede the archive: strict readers refuse it. Pack the FMU anew.")
    packed = [name for name in archive.names if name.lower().endswith(_PACKED)]
    if packed:
        yield note("archive.nested", f"The archive {quoted(packed[0])} within the FMU has not been opened.")
    yield from _source_files(archive, description)
    yield from _build_description(archive, description)
    if _TERMINALS in archive.names:
        yield from _terminals(archive, description)
    for name in archive.names:
        if name.startswith("extra/") and name.endswith("/fmi-ls-manifest.xml"):
            yield from _manifest(archive, name)


def _tree(archive: Archive, name: str) -> tuple[etree._Element | None, list[Finding]]:
    """Return a file's tree if it is sound XML, and what is wrong with it."""
    try:
        require_size(archive.size(name), name)
        return parse(archive.read(name), name), []
    except XmlError as problem:
        return None, [problem.finding]
    except ArchiveError as problem:
        return None, [error(f"archive.{rule}", sentence) for rule, sentence in problem.problems]


def _checked(archive: Archive, name: str, schema: str) -> tuple[etree._Element | None, list[Finding]]:
    """Return a file's tree if it is sound and fits its schema, and what is wrong with it."""
    root, findings = _tree(archive, name)
    if root is not None:
        findings = schema_findings(root, name, schema)
    return (None if findings else root), findings


def _manifest(archive: Archive, name: str) -> Iterator[Finding]:
    # The standard asks for three attributes and leaves root element and content to the layered standard.
    root, findings = _tree(archive, name)
    yield from findings
    if root is None:
        return
    for attribute in ("fmi-ls-name", "fmi-ls-version", "fmi-ls-description"):
        if root.get(f"{{{_MANIFEST}}}{attribute}") is None:
            yield error(
                "layered.manifest", f"{name} has no attribute {attribute} of the namespace {_MANIFEST}.", LAYERED
            )


def _source_files(archive: Archive, description: Description) -> Iterator[Finding]:
    for kind, files in description.source_files.items():
        for file in files:
            if f"sources/{file}" not in archive.names:
                yield error(
                    "source.missing", f"{kind}: the source file {quoted(file)} is listed but not in sources/.", SOURCES
                )


def _build_description(archive: Archive, description: Description) -> Iterator[Finding]:
    names = set(archive.names)
    if _BUILD not in names:
        if description.major == 3 and any(name.startswith("sources/") for name in names):
            # Beside binaries, as an addition that nobody needs, they do less harm.
            judged = warning if any(name.startswith("binaries/") for name in names) else error
            yield judged(
                "source.description", f"There are sources but no {_BUILD}: no importer can compile them.", SOURCES
            )
        return
    root, findings = _checked(archive, _BUILD, "fmi3/fmi3BuildDescription.xsd")
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
        for file in build.iterfind("SourceFileSet/SourceFile"):
            if f"sources/{file.get('name')}" not in names:
                yield error(
                    "source.missing", f"{_BUILD} lists {quoted(str(file.get('name')))}, which is not there.", SOURCES
                )
        for folder in build.iterfind("SourceFileSet/IncludeDirectory"):
            prefix = f"sources/{folder.get('name')}".rstrip("/.") + "/"
            if not any(name.startswith(prefix) for name in names):
                yield error(
                    "source.missing",
                    f"{_BUILD} includes {quoted(str(folder.get('name')))}, which is not there.",
                    SOURCES,
                )


def _terminals(archive: Archive, description: Description) -> Iterator[Finding]:
    root, findings = _checked(archive, _TERMINALS, "fmi3/fmi3TerminalsAndIcons.xsd")
    yield from findings
    if root is None:
        return
    if description.major == 3 and root.get("fmiVersion") != description.version:
        yield error(
            "terminal.version",
            f"{_TERMINALS} says FMI {root.get('fmiVersion')}, the description {description.version}: they must "
            "be equal.",
            TERMINALS,
        )
    known = {name: v.causality for v in description.variables for name in (v.name, *v.aliases)}
    for siblings in (root.findall("Terminals/Terminal"), *(t.findall("Terminal") for t in root.iter("Terminal"))):
        names = [terminal.get("name") for terminal in siblings]
        for name in {name for name in names if names.count(name) > 1}:
            yield error(
                "terminal.name", f"Two terminals of one level are called {quoted(str(name))}: rename one.", TERMINALS
            )
    for terminal in root.iter("Terminal"):
        yield from _terminal(terminal, known, archive)
    if root.find("GraphicalRepresentation/Icon") is not None and "terminalsAndIcons/icon.png" not in archive.names:
        yield warning(
            "terminal.icon",
            "The icon is placed by coordinates, but terminalsAndIcons/icon.png is not there.",
            TERMINALS,
        )


def _terminal(terminal: etree._Element, known: dict[str, str], archive: Archive) -> Iterator[Finding]:
    shown = quoted(str(terminal.get("name")))
    members: set[str] = set()
    for member in terminal.iterfind("TerminalMemberVariable"):
        variable, name = str(member.get("variableName")), member.get("memberName")
        if variable not in known:
            yield error(
                "terminal.variable",
                f"The terminal {shown} has the variable {quoted(variable)}, which is not there.",
                TERMINALS,
            )
        elif member.get("variableKind") == "signal" and known[variable] not in _CONNECTED:
            yield error(
                "terminal.variable",
                f"The terminal {shown} has the signal {quoted(variable)}, which is a {known[variable]} "
                "variable: signals are "
                "inputs, outputs and parameters.",
                TERMINALS,
            )
        if name is None and terminal.get("matchingRule") in ("plug", "bus"):
            yield error(
                "terminal.member",
                f"The terminal {shown} is matched by {terminal.get('matchingRule')}: its variable "
                f"{quoted(variable)} needs a memberName.",
                TERMINALS,
            )
        if name is not None and name in members:
            yield error(
                "terminal.member", f"The terminal {shown} has two members {quoted(name)}: rename one.", TERMINALS
            )
        members.add(str(name))
    for stream in terminal.iterfind("TerminalStreamMemberVariable"):
        for end in ("inStreamVariableName", "outStreamVariableName"):
            if stream.get(end) not in known:
                yield error(
                    "terminal.variable",
                    f"The terminal {shown} has the stream {quoted(str(stream.get(end)))}, which is not there.",
                    TERMINALS,
                )
    for picture in terminal.iterfind("TerminalGraphicalRepresentation"):
        file = f"terminalsAndIcons/{picture.get('iconBaseName')}.png"
        if file not in archive.names:
            yield error(
                "terminal.icon", f"The terminal {shown} has the icon {quoted(file)}, which is not there.", TERMINALS
            )
