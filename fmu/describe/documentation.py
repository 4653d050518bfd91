"""documentation/index.html of an FMU: what it is, its variables, its jumps and clocks, and how its events are used."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Sequence
from html import escape

from fmu.describe.description import Description, start_text, summary
from fmu.describe.variables import Bank, Fmi, FmiType, FmuVariable
from fmu.describe.xml_text import number, xml_text
from hybrid_model import Composition
from hybrid_model.declare.transitions import Priority, Trigger

_ROWS = 2000
"""Most rows of the table of variables: networks have more, and all are in modelDescription.xml."""
_TYPES = {
    FmiType.FLOAT64: "real",
    FmiType.INT32: "integer",
    FmiType.UINT64: "integer",
    FmiType.BOOLEAN: "Boolean",
    FmiType.CLOCK: "clock",
}
_STYLE = """
body { font-family: sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; color: #22313f; }
h1, h2 { color: #1f5a8c; }
table { border-collapse: collapse; }
th, td { border-bottom: 1px solid #c8d2dc; padding: 0.25em 0.8em 0.25em 0; text-align: left; vertical-align: top; }
code { font-family: monospace; }
pre { white-space: pre-wrap; }
"""
_EVENTS = {
    Fmi.V3_0: (
        "In Co-Simulation with event mode (eventModeUsed) the FMU ends fmi3DoStep at an event if early return is "
        "allowed, and else says so at the end of the step; fmi3UpdateDiscreteStates then takes the jumps and tells the "
        "time of the next event as far as it can be foretold. It need not be obeyed: an importer that steps further is "
        "stopped at the event.",
        "Without event mode the FMU takes its jumps inside the step, at their exact times; outputs show them at the "
        "next communication point.",
        "In Model Exchange the event indicators are the margins of the jump sets and of the flow set, zero or above "
        "inside the set; jumps at known times are time events.",
    ),
    Fmi.V2_0: (
        "In Co-Simulation the FMU takes its jumps inside fmi2DoStep, at their exact times; outputs show them at the "
        "next communication point. With the parameter stop_at_events set to true, fmi2DoStep returns fmi2Discard at "
        "an event instead, and fmi2GetRealStatus tells the time reached (fmi2LastSuccessfulTime), from which the next "
        "step is to start.",
        "In Model Exchange the event indicators are the margins of the jump sets and of the flow set, zero or above "
        "inside the set; jumps at known times are time events.",
    ),
}


def index_page(description: Description, related: Sequence[str] = ()) -> bytes:
    """Return documentation/index.html.

    Parameters
    ----------
    description : Description
        The automaton and its variables.
    related : sequence of str
        Other members of the archive that the page links to.

    Returns
    -------
    bytes
        HTML 5 in UTF-8 that is well-formed XML, with every text of the model escaped.
    """
    name = _text(description.automaton.name)
    body = [
        f"<h1>{name}</h1>",
        *_purpose(description),
        "<h2>Variables</h2>",
        *_variables(description),
        *_jumps(description),
        *_clocks(description),
        "<h2>Events</h2>",
        *(f"<p>{_text(paragraph)}</p>" for paragraph in (*_EVENTS[description.fmi], *_tuning(description))),
        *_related(related),
    ]
    head = f'<meta charset="utf-8"/>\n<title>{name}</title>\n<style>{_STYLE}</style>'
    page = f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n' + "\n".join(body)
    return f"{page}\n</body>\n</html>\n".encode()


def _text(text: str) -> str:
    return escape(xml_text(text))


def _purpose(description: Description) -> list[str]:
    kinds = " and ".join(
        name for kind, name in (("cs", "Co-Simulation"), ("me", "Model Exchange")) if kind in description.kinds
    )
    automaton = description.automaton
    if isinstance(automaton, Composition) and type(automaton) is Composition:
        told = [f"<p>{_text(summary(automaton))}</p>"]
    else:
        paragraphs = inspect.cleandoc(type(automaton).__doc__ or "").split("\n\n")
        told = [f"<pre>{_text(paragraph)}</pre>" for paragraph in paragraphs if paragraph.strip()]
    experiment = (
        "" if description.stop_time is None else f" The proposed experiment ends at {description.stop_time:g} s."
    )
    return [*told, f"<p>A hybrid automaton as an FMU for FMI {description.fmi.value}: {kinds}.{experiment}</p>"]


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    def line(cells: Sequence[str], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{_text(cell)}</{tag}>" for cell in cells) + "</tr>"

    return [
        "<table>",
        "<thead>",
        line(header, "th"),
        "</thead>",
        "<tbody>",
        *(line(row, "td") for row in rows),
        "</tbody>",
        "</table>",
    ]


def _variables(description: Description) -> list[str]:
    shown = list(zip(description.names, description.variables, strict=True))
    rows = [_row(name, variable) for name, variable in shown[:_ROWS]]
    more = len(shown) - len(rows)
    note = [f"<p>And {more} more, which modelDescription.xml lists.</p>"] if more else []
    return [*_table(("name", "kind", "type", "unit", "start", "description"), rows), *note]


def _row(name: str, variable: FmuVariable) -> tuple[str, ...]:
    shape = f" ({' by '.join(map(str, variable.shape))})" if variable.shape else ""
    kind = variable.causality if variable.causality != "structuralParameter" else "length of arrays"
    if variable.causality in ("input", "output", "local") or variable.tunable:
        kind = f"{variable.variability} {kind}"
    start = "" if variable.start is None else start_text(variable)
    if variable.start is not None and len(variable.start) > 8:
        start = " ".join([*(number(value) for value in variable.start[:8]), "..."])
    return name, kind, _TYPES[variable.type] + shape, variable.unit, start, variable.description


def _tuning(description: Description) -> list[str]:
    """Say when tunable parameters may be set, if there are any."""
    if not any(variable.tunable for variable in description.variables):
        return []
    kinds = {
        "cs": "between two steps in Co-Simulation" + (", or in its Event Mode" if description.fmi is Fmi.V3_0 else ""),
        "me": "in Event Mode in Model Exchange",
    }
    places = "; ".join(text for kind, text in kinds.items() if kind in description.kinds)
    return [
        f"Tunable parameters may be set while the FMU runs: {places}. A change is an event: the next event is foretold "
        "anew, and a jump that the change makes due is taken at that instant, in Co-Simulation without event mode at "
        "the beginning of the next step. Start values that were computed stay."
    ]


def _jumps(description: Description) -> list[str]:
    automaton = description.automaton
    visible = [info for info in automaton.jumps if not info.internal]
    parts = ["<h2>Flow and jumps</h2>"]
    if automaton.has_flow_set:
        parts.append("<p>Flow is allowed while the margin of the flow set is zero or above.</p>")
    else:
        parts.append("<p>Flow is allowed everywhere.</p>")
    if not visible:
        return [*parts, "<p>There are no jumps that the outside sees.</p>"]
    if automaton.has_flow_set and any(info.trigger is Trigger.STATE for info in visible):
        first = "jumps" if automaton.priority is Priority.JUMP else "flows on as long as it can"
        parts.append(f"<p>Where both are possible, the state {first}.</p>")
    rows = [
        (info.name, "its margin is zero or above" if info.trigger is Trigger.STATE else "its time has come")
        for info in visible[:_ROWS]
    ]
    return [*parts, *_table(("jump", "taken when"), rows)]


def _clocks(description: Description) -> list[str]:
    jumps = description.automaton.jumps
    shown = [(k, v) for k, v in enumerate(description.variables) if v.bank is Bank.CLOCK]
    rows = [(description.names[k], jumps[v.index].name, v.description) for k, v in shown]
    return ["<h2>Clocks</h2>", *_table(("clock", "ticks with jump", "description"), rows)] if rows else []


def _related(members: Sequence[str]) -> list[str]:
    if not members:
        return []
    links = (f'<li><a href="../{_text(name)}">{_text(name)}</a></li>' for name in members)
    return ["<h2>More in this archive</h2>", "<ul>", *links, "</ul>"]
