"""Weights and switching of an agent's edges as automata: breakpoints are time events, never searched for.

Each holds the index of the present segment as a discrete state. The flow between two breakpoints is smooth, the
breakpoints are computed from the index, and the value at a breakpoint belongs to the segment that the index says.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.weights.clockwork import (
    dwell_boundary,
    dwell_index,
    gate_boundary,
    gate_segment,
    gated_sine,
    half_wave,
    half_wave_boundary,
)
from hybrid_model.consensus.weights.gated_sine import WeightMap, apply_map
from hybrid_model.declare.variables import Value


class ConstantWeights(hm.HybridAutomaton):
    """Weights that do not change."""

    degree = hm.Dimension("number of edges")
    value = hm.Parameter(1.0, shape="degree", unit="1/s", minimum=0.0, description="weight of each edge")
    weights = hm.Output(shape="degree", unit="1/s", description="weights of the edges")

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights."""
        return {"weights": s.value}


class GateClock(hm.HybridAutomaton):
    """Gates ``square(gate_rate t - phase, duty)``, one for each edge, each with the index of its present segment."""

    degree = hm.Dimension("number of edges")
    segment = hm.DiscreteState(
        0, shape="degree", integer=True, internal=True, computed=True, description="segment of the gate: even is on"
    )
    gate_rate = hm.Parameter(4.0, shape="degree", unit="rad/s", description="rate of the gate")
    duty_percent = hm.Parameter(
        20.0, shape="degree", minimum=0.0, maximum=100.0, description="share of each gate period that is on, in percent"
    )
    phase = hm.Parameter(0.0, shape="degree", unit="rad", description="phase of the gate")
    weights = hm.Output(shape="degree", unit="1/s", description="weights of the edges")

    @abstractmethod
    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights."""

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The segment that holds the start time."""
        return {"segment": gate_segment(s.t, s.gate_rate, s.phase, s.duty_percent)}

    def ends(self, s: hm.Values) -> Value:
        """End time of each edge's present segment."""
        return gate_boundary(s.segment, s.gate_rate, s.phase, s.duty_percent)

    def next_switch(self, s: hm.Values) -> Value:
        """Time at which the first gate switches."""
        return np.min(self.ends(s))

    def switch(self, s: hm.Values) -> dict[str, Value]:
        """Move on the gates that switch now, past segments of length zero."""
        now = np.maximum(s.segment + 1, gate_segment(s.t, s.gate_rate, s.phase, s.duty_percent))
        return {"segment": np.where(self.ends(s) <= s.t, now, s.segment)}

    transitions: ClassVar[tuple[hm.Jump | hm.TimeEvent, ...]] = (
        hm.TimeEvent("gate", next_switch, switch, internal=True),
    )


class GatedSineWeights(GateClock):
    """The paper's weights ``w = g**2`` with ``g = (square(gate_rate t - phase, duty) + 1) sin(sine_rate t)``.

    Source: paper, section 7; audit, section 9 for the reading ``g**2``.
    """

    sine_rate = hm.Parameter(5.0, shape="degree", unit="rad/s", description="rate of the sine")
    weight_map = WeightMap.SQUARE

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights."""
        return {"weights": apply_map(gated_sine(s.t, s.segment, s.sine_rate), self.weight_map)}


class GatedAbsoluteSineWeights(GatedSineWeights):
    """The alternative reading ``w = |g|`` (audit, section 9); its kinks at the sine's zeros are breakpoints too."""

    half_wave = hm.DiscreteState(
        0, shape="degree", integer=True, internal=True, computed=True, description="half wave of the sine"
    )
    weight_map = WeightMap.ABS

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The segment and the half wave that hold the start time."""
        return {**super().start_map(s), "half_wave": half_wave(s.t, s.sine_rate)}

    def next_zero(self, s: hm.Values) -> Value:
        """Time of the next zero of a sine."""
        return np.min(half_wave_boundary(s.half_wave, s.sine_rate))

    def cross_zero(self, s: hm.Values) -> dict[str, Value]:
        """Move on the half waves that end now."""
        over = half_wave_boundary(s.half_wave, s.sine_rate) <= s.t
        return {"half_wave": np.where(over, s.half_wave + 1, s.half_wave)}

    transitions: ClassVar[tuple[hm.Jump | hm.TimeEvent, ...]] = (
        *GatedSineWeights.transitions,
        hm.TimeEvent("zero", next_zero, cross_zero, internal=True),
    )


class SquareWeights(GateClock):
    """Weights that alternate between two levels."""

    high = hm.Parameter(1.0, shape="degree", unit="1/s", minimum=0.0, description="weight while the gate is on")
    low = hm.Parameter(0.0, shape="degree", unit="1/s", minimum=0.0, description="weight while the gate is off")

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights."""
        is_off = s.segment - 2 * np.floor(s.segment / 2)
        return {"weights": is_off * s.low + (1 - is_off) * s.high}


class SineWeights(hm.HybridAutomaton):
    """Weights ``mean (1 + depth sin(rate t - phase))``, smooth at all times."""

    degree = hm.Dimension("number of edges")
    mean = hm.Parameter(1.0, shape="degree", unit="1/s", minimum=0.0, description="mean weight")
    depth = hm.Parameter(
        0.5, shape="degree", minimum=0.0, maximum=1.0, description="share of the mean by which the weight swings"
    )
    rate = hm.Parameter(1.0, shape="degree", unit="rad/s", description="rate of the sine")
    phase = hm.Parameter(0.0, shape="degree", unit="rad", description="phase of the sine")
    weights = hm.Output(shape="degree", unit="1/s", description="weights of the edges")

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights."""
        return {"weights": s.mean * (1 + s.depth * np.sin(s.rate * s.t - s.phase))}


class PeriodicSwitching(hm.HybridAutomaton):
    """Edges that are active in turn: row after row of a table, each for a dwell time, for ever (paper, section 7)."""

    degree = hm.Dimension("number of edges")
    phases = hm.Dimension("number of graphs in the cycle")
    raw = hm.Input(0.0, shape="degree", unit="1/s", description="weights of the edges if they were always active")
    interval = hm.DiscreteState(
        0, integer=True, internal=True, computed=True, description="index of the dwell interval"
    )
    dwell = hm.Parameter(1.0, unit="s", description="time that each graph stays")
    active = hm.Parameter(1.0, shape=("phases", "degree"), description="1 where an edge is active in a graph, else 0")
    weights = hm.Output(shape="degree", unit="1/s", description="weights of the edges, zero for the inactive ones")

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The interval that holds the start time."""
        return {"interval": dwell_index(s.t, s.dwell)}

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The weights of the active edges."""
        count = s.active.shape[0]
        row = s.interval - count * np.floor(s.interval / count)
        chosen = np.where(np.arange(count) == row, 1.0, 0.0)
        return {"weights": (chosen @ s.active) * s.raw}

    def next_graph(self, s: hm.Values) -> Value:
        """Time at which the next graph takes over."""
        return dwell_boundary(s.interval, s.dwell)

    def switch(self, s: hm.Values) -> dict[str, Value]:
        """Go on to the next graph."""
        return {"interval": s.interval + 1}

    transitions = (hm.TimeEvent("graph", next_graph, switch, internal=True),)
