"""Many points of the flows of a run at once: a run that was recorded in flat rows is read without an object a step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.variables import FloatArray
from hybrid_model.record.flow_record import FlowRecord
from hybrid_model.record.row_flows import RowFlows

Counts = npt.NDArray[np.int64]


def starts_of(flows: Sequence[FlowRecord]) -> FloatArray:
    """Return where each flow starts, in s."""
    return flows.rows.starts if isinstance(flows, RowFlows) else np.array([flow.t0 for flow in flows])


def ends_of(flows: Sequence[FlowRecord]) -> FloatArray:
    """Return where each flow ends, in s."""
    return flows.rows.ends if isinstance(flows, RowFlows) else np.array([flow.t1 for flow in flows])


def held_in(flows: Sequence[FlowRecord], numbers: Counts, part: slice = slice(None)) -> FloatArray:
    """Return the discrete states, or a part of them, in the flows of those numbers, one row each."""
    if isinstance(flows, RowFlows):
        return flows.rows.held[:, part][numbers]
    held = [flow.z[part] for flow in flows]
    return np.array([held[k] for k in numbers]).reshape(len(numbers), held[0].size)


def sampled(flows: Sequence[FlowRecord]) -> tuple[FloatArray, Counts]:
    """Return the samples of flows, the start and the end of every step: their times in s, and their flows' numbers."""
    if isinstance(flows, RowFlows):
        rows = flows.rows
        numbers = np.repeat(np.arange(len(flows)), np.diff(rows.firsts) + 1)
        begins = _begins(rows.firsts)
        times = np.empty(len(numbers))
        times[begins] = rows.starts
        times[~begins] = rows.steps[:, 2]
        return times, numbers
    times_of = [[t for t, _ in flow.points] for flow in flows]
    numbers = np.repeat(np.arange(len(flows)), [len(times) for times in times_of])
    return np.concatenate([np.array(times) for times in times_of]), numbers


def sampled_states(flows: Sequence[FlowRecord], part: slice = slice(None)) -> FloatArray:
    """Return what flows, or a part of it, at those samples, one row each."""
    if isinstance(flows, RowFlows):
        rows, begins = flows.rows, _begins(flows.rows.firsts)
        begun, reached = rows.begun[:, part], rows.reached[:, part]
        states = np.empty((len(begins), begun.shape[1]))
        states[begins], states[~begins] = begun, reached
        return states
    points = [x[part] for flow in flows for _, x in flow.points]
    return np.array(points).reshape(len(points), flows[0].x0[part].size)


def states_at(flows: Sequence[FlowRecord], numbers: Counts, times: FloatArray, part: slice = slice(None)) -> FloatArray:
    """Return what flows, or a part of it, at times (s) in the flows of those numbers, one row each."""
    if isinstance(flows, RowFlows):
        return flows.rows.at(numbers, times, part)
    points = [flows[int(k)].at(float(t))[part] for k, t in zip(numbers, times, strict=True)]
    return np.array(points).reshape(len(points), flows[0].x0[part].size)


def _begins(firsts: Counts) -> npt.NDArray[np.bool_]:
    """Return of each sample whether it is the start of a flow."""
    begins = np.zeros(int(firsts[-1]) + len(firsts) - 1, dtype=bool)
    begins[firsts[:-1] + np.arange(len(firsts) - 1)] = True
    return begins
