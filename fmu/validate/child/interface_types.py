"""Instances and runs, as the experiments begin them."""

from __future__ import annotations

from typing import Any

from fmu.validate.child.calls import Recorder
from fmu.validate.child.co_simulation import CoSimulation
from fmu.validate.child.model_exchange import ModelExchange
from fmu.validate.child.run import Run
from fmu.validate.child.scheduled_execution import ScheduledExecution

RUNS: dict[str, type[Run]] = {
    "CoSimulation": CoSimulation,
    "ModelExchange": ModelExchange,
    "ScheduledExecution": ScheduledExecution,
}


def instantiate(fmu: Any, recorder: Recorder) -> None:
    """Make an instance with the FMU's own token."""
    if not fmu.instantiate(fmu.plan["token"]):
        raise recorder.stop("run.instantiate", f"The FMU cannot be instantiated with its own token: {fmu.said()}.")


def run_of(fmu: Any, recorder: Recorder) -> Run:
    """Return a run of the interface type that is checked."""
    return RUNS[fmu.plan["kind"]](fmu, recorder)
