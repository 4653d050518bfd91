"""What capability flags claim is asked for: a function behind a flag may discard, but not refuse."""

from __future__ import annotations

from typing import Any

from fmu.validate.child.calls import DISCARD, OK, WARNING, Recorder, Variable
from fmu.validate.child.interface_types import instantiate, run_of

FLAGS = "FMI 2.0.4 sections 3.3.1 and 4.3.1; FMI 3.0.2 sections 2.4.6 and 4.3"
_LARGEST = 1_000_000
"""Dependencies of one unknown that are asked for."""


def output_orders(fmu: Any, recorder: Recorder) -> None:
    """Each order of output derivatives that is claimed can be had; the first one is another experiment's."""
    _begin(fmu, recorder)
    claimed, output = fmu.plan["output_order"], Variable(*fmu.plan["claim_output"])
    for order in range(2, fmu.plan["output_orders"] + 1):
        status = fmu.output_derivative(output, order)
        if status in (OK, WARNING, DISCARD) or fmu.lenient:
            continue
        raise recorder.stop(
            "run.claim",
            f"maxOutputDerivativeOrder is {claimed}, but the derivative of order {order} of {output.name!r} is refused "
            f"with {fmu.status(status)} ({fmu.said()}): every order up to the maximum must be given, so declare "
            f"{order - 1} or implement it.",
            FLAGS,
        )
    fmu.free()


def input_derivatives(fmu: Any, recorder: Recorder) -> None:
    """An FMU that interpolates inputs takes their derivatives."""
    _begin(fmu, recorder, 0)
    given = Variable(*fmu.plan["claim_input"])
    status = fmu.input_derivative(given)
    _require(fmu, recorder, "canInterpolateInputs", f"fmi2SetRealInputDerivatives({given.name})", status)
    fmu.free()


def evaluation(fmu: Any, recorder: Recorder) -> None:
    """Discrete states can be evaluated in Event Mode, before they are updated."""
    instantiate(fmu, recorder)
    run = run_of(fmu, recorder)
    run.initialize()
    _require(fmu, recorder, "providesEvaluateDiscreteStates", "fmi3EvaluateDiscreteStates()", fmu.evaluate())
    run.iterate()
    fmu.free()


def element_dependencies(fmu: Any, recorder: Recorder) -> None:
    """Unknowns tell how many dependencies they have, and which."""
    _begin(fmu, recorder, 0)
    for entry in fmu.plan["claim_unknowns"]:
        unknown = Variable(*entry)
        status, size = fmu.number_of_dependencies(unknown)
        call = f"fmi3GetNumberOfVariableDependencies({unknown.name})"
        _require(fmu, recorder, "providesPerElementDependencies", call, status)
        if status in (OK, WARNING) and size <= _LARGEST:
            status = fmu.dependencies(unknown, size)
            call = f"fmi3GetVariableDependencies({unknown.name})"
            _require(fmu, recorder, "providesPerElementDependencies", call, status)
    fmu.free()


def _begin(fmu: Any, recorder: Recorder, points: int = 1) -> None:
    instantiate(fmu, recorder)
    run = run_of(fmu, recorder)
    run.begin()
    run.advance(points)
    # A run that has ended would refuse all that follows.
    fmu.lenient = run.ended


def _require(fmu: Any, recorder: Recorder, flag: str, call: str, status: int) -> None:
    if status not in (OK, WARNING, DISCARD) and not fmu.lenient:
        raise recorder.stop(
            "run.claim",
            f"{flag} is true, but {call} returns {fmu.status(status)} ({fmu.said()}): what a capability flag claims "
            "must work, so implement the function or remove the flag.",
            FLAGS,
        )
