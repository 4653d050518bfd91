"""Rules for terminals and icons."""

from __future__ import annotations

from collections.abc import Iterator

from lxml import etree

from fmu.archives.reading import Archive
from fmu.validate.findings import Finding, error, quoted, softened, warning
from fmu.validate.reading.description import Description
from fmu.validate.reading.xml_members import checked

TERMINALS = "FMI 3.0.2 section 2.4.9"
_TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
_CONNECTED = ("input", "output", "parameter", "calculatedParameter")


def terminal_findings(archive: Archive, description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the terminals; in FMI 2, whose standard has none, as warnings."""
    if _TERMINALS in archive.names:
        found = _terminals(archive, description)
        yield from found if description.major == 3 else map(softened, found)


def _terminals(archive: Archive, description: Description) -> Iterator[Finding]:
    root, findings = checked(archive, _TERMINALS, "fmi3/fmi3TerminalsAndIcons.xsd")
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
