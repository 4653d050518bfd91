"""What a run leaves: its flows and jumps, how to read variables off them, and why it ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hybrid_model.record.arc_values import ArcValues
from hybrid_model.record.flow_record import FlowRecord
from hybrid_model.record.jump_record import JumpRecord
from hybrid_model.stop import Stop


@dataclass(frozen=True)
class RunStatistics:
    """What a run on the native engine has cost.

    Attributes
    ----------
    steps, rejected : int
        Steps of the solver, and tries that were too long.
    evaluations : int
        Of the flow map.
    jumps : int
        Breakpoints of the flow included.
    probes : int
        States looked at between the ends of a step, to locate events.
    jacobians : int
        Derivatives of the flow, where a method for stiff flows stepped.
    """

    steps: int
    rejected: int
    evaluations: int
    jumps: int
    probes: int
    jacobians: int


@dataclass(frozen=True, eq=False)
class RunRecord:
    """A run, or a part of one.

    Attributes
    ----------
    read : ArcValues
        Reads variables off the flows.
    flows : sequence of FlowRecord
        In order; one more than jumps.
    jumps : sequence of JumpRecord
        Jump k leads from flow k to flow k + 1.
    stop, message, event_tolerance
        See `HybridArc`.
    first_j : int
        Jump count of the first flow.
    engine : str
        What ran, and why; see `HybridArc`.
    statistics : RunStatistics or None
        What the run has cost, where the engine counts it.
    """

    read: ArcValues
    flows: Sequence[FlowRecord]
    jumps: Sequence[JumpRecord]
    stop: Stop
    message: str
    event_tolerance: float
    first_j: int = 0
    engine: str = ""
    statistics: RunStatistics | None = None
