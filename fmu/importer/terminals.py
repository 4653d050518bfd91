"""The terminals of anybody's FMU: variables under the names by which they are plugged together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fmu.archives.reading import Archive
from fmu.importer.plain_xml import parse_plain

FILE = "terminalsAndIcons/terminalsAndIcons.xml"
SIGNAL = "signal"


@dataclass(frozen=True)
class Terminal:
    """A terminal of an FMU (FMI 3.0.2 section 2.4.9).

    Attributes
    ----------
    rule : str
        By which members meet those of another terminal: ``plug``, ``bus``, ``sequence`` or a tool's own.
    members : mapping
        Name of a member -> its variable and kind, ``signal``, ``inflow``, ``outflow`` or a tool's own; in order.
        Members of terminals within have the names of both, with a point between. A sequence's have their numbers.
    """

    rule: str
    members: Mapping[str, tuple[str, str]]


def read_terminals(path: str | Path) -> dict[str, Terminal]:
    """Return the terminals of an FMU by name; those within others have the names of both, with a point between.

    Raises
    ------
    ArchiveError
        If the archive must not be read.
    PlainXmlError
        If the file is no XML, or must not be read.
    """
    with Archive(path) as archive:
        if FILE not in archive.names:
            return {}
        root = parse_plain(archive.read(FILE), FILE)
    found: dict[str, Terminal] = {}
    for element in root.iterfind("Terminals/Terminal"):
        _read(element, str(element.get("name")), found)
    return found


def _read(element: Any, name: str, found: dict[str, Terminal]) -> dict[str, tuple[str, str]]:
    """Note a terminal and those in it; return the members of all."""
    rule, members = str(element.get("matchingRule")), {}
    for number, member in enumerate(element.iterfind("TerminalMemberVariable")):
        own = str(number) if rule == "sequence" else str(member.get("memberName"))
        members[own] = str(member.get("variableName")), str(member.get("variableKind"))
    for inner in element.iterfind("Terminal"):
        within = str(inner.get("name"))
        members |= {f"{within}.{own}": told for own, told in _read(inner, f"{name}.{within}", found).items()}
    found[name] = Terminal(rule, members)
    return members
