"""What a system is made of, as its file says, before anything is loaded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cosim.sources import Source

FMU, AUTOMATON = "fmu", "automaton"
EVENT_EXACT, ERROR_CONTROLLED, FIXED_STEP = MASTERS = "event-exact", "error-controlled", "fixed-step"


@dataclass(frozen=True)
class Component:
    """A block of a system.

    Attributes
    ----------
    name : str
    kind : {"fmu", "automaton"}
    source : str
        Path of an FMU, or ``file.py:Class`` or ``module:Class``.
    start : mapping
        Variable -> value; a sequence for an array.
    arguments : mapping
        What an automaton's class is called with.
    interface : str, optional
        Of an FMU: ``cs`` or ``me``; default: Co-Simulation where there is one.
    """

    name: str
    kind: str
    source: str
    start: Mapping[str, Any] = field(default_factory=dict)
    arguments: Mapping[str, Any] = field(default_factory=dict)
    interface: str | None = None


@dataclass(frozen=True)
class Experiment:
    """What a system's file says of a run; what is None is left to others.

    Attributes
    ----------
    start_time, stop_time, step_size, output_interval : float, optional
        In s.
    tolerance : float, optional
        Relative, of masters with error control.
    master : str, optional
    """

    start_time: float | None = None
    stop_time: float | None = None
    step_size: float | None = None
    output_interval: float | None = None
    tolerance: float | None = None
    master: str | None = None


@dataclass(frozen=True)
class SystemDefinition:
    """A system.

    Attributes
    ----------
    name : str
    components : sequence of Component
        Their order is that of simultaneous events.
    connections : mapping
        As for `cosim.system.System`.
    inputs : Path, optional
        A table of inputs that nothing drives.
    experiment : Experiment
    left_out : sequence of str
        Parameters that its file gives values, and that nothing in it has, which SSP allows.
    """

    name: str
    components: Sequence[Component]
    connections: Mapping[str, Source] = field(default_factory=dict)
    inputs: Path | None = None
    experiment: Experiment = field(default_factory=Experiment)
    left_out: Sequence[str] = ()
