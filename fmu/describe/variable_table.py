"""Which variables an FMU has, in the order of their value references.

In FMI 3.0 parameters and local states with a shape are arrays. Inputs and outputs are scalars, one an element, in both
versions: so importers can wire them one by one. In FMI 2.0 everything is a scalar.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

from fmu.describe.variables import NEXT_EVENT, STOP_AT_EVENTS, Bank, Fmi, FmiType, FmuVariable
from fmu.errors import ExportError
from fmu.standard.units import unit_per_second
from hybrid_model import Automaton
from hybrid_model.declare.layout import Layout, Place
from hybrid_model.declare.transitions import Trigger
from hybrid_model.declare.variables import INTEGERS, Kind, element_names
from hybrid_model.native.networks.network import NetworkTrace
from hybrid_model.native.trace import Trace

_BANKS = {
    Kind.STATE: Bank.STATE,
    Kind.DISCRETE: Bank.DISCRETE,
    Kind.INPUT: Bank.INPUT,
    Kind.PARAMETER: Bank.PARAMETER,
    Kind.OUTPUT: Bank.OUTPUT,
}


def fmu_variables(traced: Trace | NetworkTrace, fmi: Fmi = Fmi.V3_0, *, clocks: bool = True) -> tuple[FmuVariable, ...]:
    """List the variables of an FMU: time, parameters, inputs, outputs, states, derivatives, margins, clocks.

    Parameters
    ----------
    traced : Trace or NetworkTrace
        The automaton; its discrete states declared internal are not listed.
    fmi : Fmi
        Version of the standard.
    clocks : bool
        Whether an FMU of FMI 3.0 shows its clocks.

    Returns
    -------
    tuple of FmuVariable
        In the order of the value references, from 0.

    Raises
    ------
    ExportError
        If a name is taken twice, or an integer does not fit into 32 bits.
    """
    automaton, layout = traced.automaton, traced.layout
    table = [FmuVariable("time", FmiType.FLOAT64, Bank.TIME, 0, "independent", "continuous", unit="s")]
    for kind in (Kind.PARAMETER, Kind.INPUT, Kind.OUTPUT, Kind.STATE, Kind.DISCRETE):
        for place in layout.places[kind]:
            if not place.variable.internal:
                table += _declared(kind, place, fmi)
    table += [_derivative(variable) for variable in table if variable.bank is Bank.STATE]
    if fmi is Fmi.V2_0:
        table.append(_stop_at_events())
    else:
        table += [*_margins(automaton), *(_clocks(automaton, layout) if clocks else [])]
        table[1:1] = _sizes(table)
    twice = next((name for name, count in Counter(v.name for v in table).items() if count > 1), None)
    if twice is not None:
        raise ExportError(
            f"{automaton.name} has two variables called {twice!r} (the FMU's own are time, der(...), margin.(...), "
            f"{NEXT_EVENT} and {STOP_AT_EVENTS}): rename one."
        )
    return tuple(table)


def predicts_events(automaton: Automaton, layout: Layout) -> bool:
    """Return whether the next event follows from the state: there are events, and inputs change at events only."""
    visible = any(not info.internal for info in automaton.jumps)
    return visible and all(place.variable.discrete for place in layout.places[Kind.INPUT])


def _declared(kind: Kind, place: Place, fmi: Fmi) -> list[FmuVariable]:
    variable = place.variable
    causality, variability, initial = _attributes(kind, place)
    starts = tuple(float(start) for start in variable.start.ravel())
    whole = FmuVariable(
        variable.name,
        FmiType.INT32 if variable.integer else FmiType.FLOAT64,
        _BANKS[kind],
        place.at.start,
        causality,
        variability,
        initial,
        None if initial == "calculated" else starts,
        variable.unit,
        variable.description,
        variable.shape,
        variable.dimensions,
        minimum=variable.minimum,
        maximum=variable.maximum,
        nominal=variable.nominal,
    )
    if whole.type is FmiType.INT32:
        _require_integers(whole)
    if fmi is Fmi.V3_0 and variable.shape and causality in ("parameter", "local"):
        return [whole] if variable.size else []
    return list(_elements(whole, element_names(variable)))


def _require_integers(variable: FmuVariable) -> None:
    given = [("starts at", start) for start in variable.start or ()]
    given += [
        (name, bound)
        for name, bound in (("has the minimum", variable.minimum), ("has the maximum", variable.maximum))
        if bound is not None
    ]
    least, greatest = INTEGERS
    for what, value in given:
        if not (least <= value <= greatest and value == int(value)):
            raise ExportError(
                f"The integer variable {variable.name!r} {what} {value:.17g}: an FMU's integers are whole numbers from "
                f"{least} to {greatest}, so give one of them, or declare the variable without integer."
            )


def _elements(whole: FmuVariable, names: Sequence[str]) -> Iterator[FmuVariable]:
    for k, name in enumerate(names):
        start = None if whole.start is None else (whole.start[k],)
        yield replace(whole, name=name, index=whole.index + k, start=start, shape=(), dimensions=())


def _attributes(kind: Kind, place: Place) -> tuple[str, str, str | None]:
    variable = place.variable
    if kind is Kind.PARAMETER:
        return "parameter", "tunable" if variable.tunable else "fixed", "exact"
    if kind is Kind.INPUT:
        return "input", "discrete" if variable.discrete else "continuous", None
    if kind is Kind.OUTPUT:
        return "output", "discrete" if variable.discrete else "continuous", "calculated"
    causality = "output" if variable.output else "local"
    return (
        causality,
        "discrete" if kind is Kind.DISCRETE else "continuous",
        "calculated" if variable.computed else "exact",
    )


def _derivative(state: FmuVariable) -> FmuVariable:
    return replace(
        state,
        name=f"der({state.name})",
        bank=Bank.DERIVATIVE,
        causality="local",
        initial="calculated",
        start=None,
        unit=unit_per_second(state.unit),
        description=f"time derivative of {state.name}",
        derivative_of=state.name,
        minimum=None,
        maximum=None,
        nominal=None,
    )


def _margins(automaton: Automaton) -> Iterator[FmuVariable]:
    names = [info.name for info in automaton.jumps if info.trigger is Trigger.STATE]
    about = [f"jump {name} is enabled from zero on" for name in names]
    if automaton.has_flow_set:
        names, about = [*names, "flow_set"], [*about, "flow is allowed from zero on"]
    for index, (name, text) in enumerate(zip(names, about, strict=True)):
        yield FmuVariable(
            f"margin.{name}",
            FmiType.FLOAT64,
            Bank.INDICATOR,
            index,
            "local",
            "continuous",
            "calculated",
            description=text,
        )


def _clocks(automaton: Automaton, layout: Layout) -> Iterator[FmuVariable]:
    for clock in automaton.clocks:
        yield FmuVariable(
            clock.name, FmiType.CLOCK, Bank.CLOCK, clock.jump, "output", "discrete", description=clock.description
        )
    if predicts_events(automaton, layout):
        text = "counts down to the next event, as far as it can be foretold"
        yield FmuVariable(NEXT_EVENT, FmiType.CLOCK, Bank.COUNTDOWN, 0, "input", "discrete", description=text)


def _sizes(table: Sequence[FmuVariable]) -> list[FmuVariable]:
    """List the structural parameters: the lengths, fixed by the compiled code, that arrays share."""
    lengths = {name: length for v in table for name, length in zip(v.dimensions, v.shape, strict=False)}
    return [
        FmuVariable(
            name,
            FmiType.UINT64,
            Bank.SIZE,
            length,
            "structuralParameter",
            "fixed",
            "exact",
            (float(length),),
            description="length, fixed in this FMU",
            minimum=length,
            maximum=length,
        )
        for name, length in lengths.items()
    ]


def _stop_at_events() -> FmuVariable:
    text = "whether fmi2DoStep ends at an event with fmi2Discard, the time in fmi2LastSuccessfulTime"
    return FmuVariable(
        STOP_AT_EVENTS,
        FmiType.BOOLEAN,
        Bank.OPTION,
        0,
        "parameter",
        "fixed",
        "exact",
        (0.0,),
        description=text,
    )
