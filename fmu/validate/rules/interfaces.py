"""Rules for the interface types: capability flags, clocks, the default experiment, the token."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from fmu.standard.capabilities import Capability
from fmu.validate.findings import Finding, error, quoted, warning
from fmu.validate.reading.description import Description, Variable

FLAGS = "FMI 2.0.4 sections 3.3.1 and 4.3.1; FMI 3.0.2 sections 2.4.6 and 4.3"
CLOCKS = "FMI 3.0.2 sections 2.2.8 and 2.4.7.5"
EXPERIMENT = "FMI 2.0.4 section 2.2.5; FMI 3.0.2 section 2.4.5"
TOKEN = "FMI 2.0.4 section 2.2.1; FMI 3.0.2 section 2.4.1"
IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


def interface_findings(description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the interface types, the clocks, the experiment and the token."""
    if not description.token.strip():
        name = "guid" if description.major == 2 else "instantiationToken"
        yield error("interface.token", f"The {name} is empty: by it an importer ties description and binary.", TOKEN)
    if not description.interfaces:
        yield error("interface.none", "The description declares no interface type: declare at least one.", FLAGS)
    for kind, attributes in description.interfaces.items():
        yield from _flags(description, kind, attributes)
    yield from _experiment(description.experiment)
    if description.major == 3:
        yield from _clocks(description)


def _flags(description: Description, kind: str, flags: Mapping[str, str]) -> Iterator[Finding]:
    identifier = flags.get("modelIdentifier", "")
    if not IDENTIFIER.fullmatch(identifier):
        yield error(
            "interface.identifier",
            f"{kind}: the modelIdentifier {quoted(identifier)} is no C identifier: rename it.",
            FLAGS,
        )
    get, serialize = (c.attribute(description.major) for c in (Capability.STATE, Capability.SERIALIZATION))
    if description.can(kind, Capability.SERIALIZATION) and not description.can(kind, Capability.STATE):
        yield error(
            "interface.flags", f"{kind}: {serialize} is true and {get} is not: what is serialised is got first.", FLAGS
        )
    fixed = _number(flags.get("fixedInternalStepSize"))
    if fixed is not None and not fixed > 0.0:
        yield error("interface.flags", f"{kind}: fixedInternalStepSize is {fixed:g}; it must be positive.", FLAGS)
    if kind != "CoSimulation" or description.major == 2:
        return
    updates = description.can(kind, Capability.INTERMEDIATE_UPDATE)
    if description.can(kind, Capability.RETURN_AFTER_UPDATE) and not updates:
        yield error(
            "interface.flags",
            "CoSimulation: canReturnEarlyAfterIntermediateUpdate is true and providesIntermediateUpdate is not: "
            "the return is asked for in the intermediate update.",
            FLAGS,
        )
    if flags.get("recommendedIntermediateInputSmoothness", "0") != "0" and not updates:
        yield error(
            "interface.flags",
            "CoSimulation: recommendedIntermediateInputSmoothness is given and providesIntermediateUpdate is not true.",
            FLAGS,
        )
    clocks = [variable.name for variable in description.variables if variable.type == "Clock"]
    if clocks and not description.can(kind, Capability.EVENT_MODE):
        yield error(
            "clock.event_mode",
            f"CoSimulation: there is the clock {quoted(clocks[0])} but hasEventMode is not true: clocks tick "
            "in Event Mode.",
            CLOCKS,
        )


def _number(text: str | None) -> float | None:
    return None if text is None else float(text)


def _experiment(experiment: Mapping[str, str]) -> Iterator[Finding]:
    start, stop, tolerance, step = (
        _number(experiment.get(n)) for n in ("startTime", "stopTime", "tolerance", "stepSize")
    )
    for name, number in (("startTime", start), ("stopTime", stop), ("tolerance", tolerance), ("stepSize", step)):
        if number is not None and not math.isfinite(number):
            yield error("experiment.finite", f"DefaultExperiment: {name} is {number}; it must be finite.", EXPERIMENT)
    if stop is not None and stop <= (start or 0.0):
        yield error(
            "experiment.stop",
            f"DefaultExperiment: it stops at {stop:g}, not after its start {start or 0.0:g}.",
            EXPERIMENT,
        )
    elif stop is not None and step is not None and step > (stop - (start or 0.0)) * (1.0 + 1e-9):
        yield warning("experiment.step", f"DefaultExperiment: the step {step:g} is longer than the run.", EXPERIMENT)
    if tolerance is not None and tolerance <= 0.0:
        yield error(
            "experiment.tolerance", f"DefaultExperiment: the tolerance {tolerance:g} is not positive.", EXPERIMENT
        )
    if step is not None and step <= 0.0:
        yield error("experiment.step", f"DefaultExperiment: the step {step:g} is not positive.", EXPERIMENT)


def _clocks(description: Description) -> Iterator[Finding]:
    if "ScheduledExecution" in description.interfaces and not any(
        v.type == "Clock" and v.causality == "input" for v in description.variables
    ):
        yield warning("clock.scheduled", "ScheduledExecution has no input clock: nothing can be activated.", CLOCKS)
    referred: dict[int, str] = {}
    for variable in description.variables:
        yield from _clock(variable) if variable.type == "Clock" else ()
        yield from _clocked(description, variable)
        if variable.previous is not None:
            if variable.previous in referred:
                yield error(
                    "clock.previous",
                    f"The variables {quoted(referred[variable.previous])} and {quoted(variable.name)} have one "
                    "'previous'.",
                    CLOCKS,
                )
            referred.setdefault(variable.previous, variable.name)


def _clock(clock: Variable) -> Iterator[Finding]:
    shown = f"{quoted(clock.name)} (line {clock.line})"
    interval = clock.attributes.get("intervalVariability", "")
    if clock.causality not in ("input", "output", "local"):
        yield error(
            "clock.causality", f"The clock {shown} is a {clock.causality}; clocks are input, output or local.", CLOCKS
        )
    if clock.variability not in ("discrete", "tunable"):
        yield error("clock.variability", f"The clock {shown} is {clock.variability}; clocks are discrete.", CLOCKS)
    if clock.causality == "output" and interval != "triggered":
        yield error(
            "clock.output", f"The output clock {shown} is {interval}; only a triggered clock can be an output.", CLOCKS
        )
    if interval in ("constant", "fixed"):
        fraction = "resolution" in clock.attributes and "intervalCounter" in clock.attributes
        if "intervalDecimal" not in clock.attributes and not fraction:
            yield error(
                "clock.interval", f"The {interval} clock {shown} has no interval: give intervalDecimal.", CLOCKS
            )
    for name in ("intervalDecimal", "intervalCounter", "resolution"):
        number = _number(clock.attributes.get(name))
        if number is not None and not number > 0.0:
            yield error("clock.interval", f"The clock {shown} has {name} {number:g}; it must be positive.", CLOCKS)


def _clocked(description: Description, variable: Variable) -> Iterator[Finding]:
    shown = f"{quoted(variable.name)} (line {variable.line})"
    for reference in variable.clocks:
        clock = description.by_reference.get(reference)
        if clock is None or clock.type != "Clock":
            yield error(
                "clock.reference", f"The clocked variable {shown} refers to {reference}, which is no clock.", CLOCKS
            )
    if variable.clocks and variable.variability not in ("discrete", "tunable"):
        yield error(
            "clock.variability", f"The clocked variable {shown} is {variable.variability}; it must be discrete.", CLOCKS
        )
    if variable.previous is None:
        return
    before = description.by_reference.get(variable.previous)
    if before is None or before is variable:
        yield error(
            "clock.previous", f"The 'previous' of {shown} is {variable.previous}, which is no other variable.", CLOCKS
        )
    elif before.type != variable.type or before.causality == "input" or variable.type == "Clock":
        yield error(
            "clock.previous",
            f"The 'previous' of {shown} is {quoted(before.name)}: it must be of its type and no input.",
            CLOCKS,
        )
    if not variable.clocks:
        yield error("clock.previous", f"The variable {shown} has 'previous' but no clock.", CLOCKS)
