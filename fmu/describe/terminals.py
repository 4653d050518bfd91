"""terminalsAndIcons.xml: what a block broadcasts, and what it hears of others, as terminals that plug together.

The rule is general. A discrete output is something sent: the terminal of its name holds the value and, where one clock
ticks with every jump that changes the value and with no other, that clock. A whole number that changes together with
real values only counts them, and is no message. A discrete input is something heard, one terminal a sender: an element
of a vector, a row of a matrix. All have the members ``value`` (of vectors
``value[1]``, ``value[2]`` ...), and the matching rule ``bus``, by which members are joined by name and the clock may
stay unconnected.

See the FMI standard 3.0, section 2.4.9. By the same section the file may be in an FMU of FMI 2.0.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from fmu.describe.changed_by_jumps import output_jumps
from fmu.describe.description import Description
from fmu.describe.variables import Bank
from fmu.describe.xml_text import to_bytes, xml_text
from hybrid_model.declare.layout import Place
from hybrid_model.declare.variables import Kind, element_names

KIND = "_hybrid-fmu_broadcast"
"""Attribute terminalKind of senders and receivers: only what has it is meant to be joined."""
Jumps = frozenset[int] | None
_WIDTH = 200.0
"""Of the coordinate system, whose middle is zero."""


@dataclass(frozen=True)
class Terminal:
    """A terminal: its name, its members' names with the variables behind them, and which way it goes."""

    name: str
    members: tuple[tuple[str, str], ...]
    sends: bool
    description: str = ""


def terminals(description: Description) -> tuple[Terminal, ...]:
    """Return the terminals of an FMU: senders, then receivers, in declaration order.

    Parameters
    ----------
    description : Description
        The automaton and its variables.

    Returns
    -------
    tuple of Terminal
        Empty if nothing discrete goes in or out.
    """
    layout = description.traced.layout
    names = dict(zip((v.name for v in description.variables), description.names, strict=True))
    clocks = _clocks(description)
    found = [
        *(_sender(place, jumps, clocks) for place, jumps in _messages(description)),
        *(terminal for place in layout.places[Kind.INPUT] for terminal in _receivers(place)),
    ]
    return tuple(
        replace(terminal, members=tuple((member, names[variable]) for member, variable in terminal.members))
        for terminal in found
    )


def _messages(description: Description) -> list[tuple[Place, Jumps]]:
    """Return the discrete outputs that are sent, with the jumps that change them; None if not only jumps do."""
    found: list[tuple[Place, Jumps]] = []
    for kind in (Kind.OUTPUT, Kind.DISCRETE):
        changed_by = output_jumps(description.traced, kind)
        for place in description.traced.layout.places[kind]:
            variable = place.variable
            if variable.size and (variable.discrete if kind is Kind.OUTPUT else variable.output):
                elements = changed_by[place.at]
                known = [jumps for jumps in elements if jumps is not None]
                jumps = frozenset[int]().union(*known) if len(known) == len(elements) else None
                found.append((place, jumps))
    told = {jumps for place, jumps in found if not place.variable.integer}
    return [(place, jumps) for place, jumps in found if not place.variable.integer or jumps not in told]


def _sender(place: Place, jumps: Jumps, clocks: Mapping[int, str]) -> Terminal:
    variable = place.variable
    members = list(zip(_value_names(variable.shape), element_names(variable), strict=True))
    clock = clocks.get(next(iter(jumps))) if jumps is not None and len(jumps) == 1 else None
    if clock is not None:
        members.append(("clock", clock))
    return Terminal(variable.name, tuple(members), True, variable.description)


def _clocks(description: Description) -> dict[int, str]:
    """Return the clock that ticks with each jump, the first if there are several; there are none in FMI 2.0."""
    shown = {v.name for v in description.variables if v.bank is Bank.CLOCK}
    clocks = [clock for clock in description.automaton.clocks if clock.name in shown]
    return {clock.jump: clock.name for clock in reversed(clocks)}


def _receivers(place: Place) -> Iterator[Terminal]:
    variable = place.variable
    if not variable.discrete or variable.size == 0:
        return
    names, shape = element_names(variable), variable.shape
    count = shape[0] if shape else 1
    values = _value_names(shape[1:])
    for k in range(count):
        own = names[k * len(values) : (k + 1) * len(values)]
        name = f"{variable.name}[{k + 1}]" if shape else variable.name
        yield Terminal(name, tuple(zip(values, own, strict=True)), sends=False, description=variable.description)


def _value_names(shape: tuple[int, ...]) -> list[str]:
    size = 1
    for length in shape:
        size *= length
    return [f"value[{k + 1}]" for k in range(size)] if shape else ["value"]


def terminals_and_icons(description: Description) -> bytes:
    """Return terminalsAndIcons.xml: the place of the icon, and the terminals at its sides.

    Parameters
    ----------
    description : Description
        The automaton and its variables.

    Returns
    -------
    bytes
        XML in UTF-8, valid by fmi3TerminalsAndIcons.xsd. Receivers are at the left, senders at the right.
    """
    root = ET.Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    half = f"{_WIDTH / 2:g}"
    corners = {"x1": f"-{half}", "y1": f"-{half}", "x2": half, "y2": half}
    graphics = ET.SubElement(root, "GraphicalRepresentation")
    ET.SubElement(graphics, "CoordinateSystem", corners, suggestedScalingFactorTo_mm="0.1")
    ET.SubElement(graphics, "Icon", corners)
    found = terminals(description)
    if found:
        listed = ET.SubElement(root, "Terminals")
        for sends in (True, False):
            side = [terminal for terminal in found if terminal.sends is sends]
            for number, terminal in enumerate(side):
                _terminal(listed, terminal, (number + 0.5) / len(side))
    return to_bytes(root)


def _terminal(listed: ET.Element, terminal: Terminal, share: float) -> None:
    attributes = {"name": xml_text(terminal.name), "matchingRule": "bus", "terminalKind": KIND}
    if terminal.description:
        attributes["description"] = xml_text(terminal.description)
    element = ET.SubElement(listed, "Terminal", attributes)
    for member, variable in terminal.members:
        ET.SubElement(
            element, "TerminalMemberVariable", variableName=variable, memberName=member, variableKind="signal"
        )
    x, y = _WIDTH / 2 if terminal.sends else -_WIDTH / 2, _WIDTH * (0.5 - share)
    ET.SubElement(
        element,
        "TerminalGraphicalRepresentation",
        defaultConnectionColor="31 90 140",
        x1=f"{x - 10:g}",
        y1=f"{y - 10:g}",
        x2=f"{x + 10:g}",
        y2=f"{y + 10:g}",
        iconBaseName="sender" if terminal.sends else "receiver",
    )
