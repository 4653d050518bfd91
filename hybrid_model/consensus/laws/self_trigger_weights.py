"""Self-triggered event generators for the weights whose pieces between breakpoints are waves."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.laws.forecast import Wave
from hybrid_model.consensus.laws.self_triggers import SelfTrigger
from hybrid_model.consensus.weights.clockwork import gate_boundary, gate_segment, half_wave, half_wave_boundary
from hybrid_model.declare.variables import Value


class ConstantSelfTrigger(SelfTrigger):
    """Self-triggered broadcasting over edges of constant weight, switched on and off by the table of active graphs."""

    level = hm.Parameter(1.0, shape="degree", unit="1/s", minimum=0.0, description="weight of each edge")

    def wave(self, s: hm.Values, pieces: Mapping[str, Value]) -> Wave:
        """A constant."""
        return Wave(s.level, 0.0 * s.level, 0.0 * s.level, 1.0 + 0.0 * s.level)


class SineSelfTrigger(SelfTrigger):
    """Self-triggered broadcasting over edges with the weights ``mean (1 + depth sin(rate t - phase))``."""

    mean = hm.Parameter(1.0, shape="degree", unit="1/s", minimum=0.0, description="mean weight of each edge")
    depth = hm.Parameter(
        0.5, shape="degree", minimum=0.0, maximum=1.0, description="share of the mean by which the weight swings"
    )
    rate = hm.Parameter(1.0, shape="degree", unit="rad/s", description="rate of the sine")
    phase = hm.Parameter(0.0, shape="degree", unit="rad", description="phase of the sine")

    def wave(self, s: hm.Values, pieces: Mapping[str, Value]) -> Wave:
        """The sine, by the addition theorem."""
        swing = s.mean * s.depth
        return Wave(s.mean, -swing * np.sin(s.phase), swing * np.cos(s.phase), s.rate)


class GatedSineSelfTrigger(SelfTrigger):
    """Self-triggered broadcasting over edges with the paper's gated sine weights, in both readings."""

    segment = hm.DiscreteState(
        0, shape="degree", integer=True, internal=True, computed=True, description="segment of the gate: even is on"
    )
    half_wave = hm.DiscreteState(
        0, shape="degree", integer=True, internal=True, computed=True, description="half wave of the sine"
    )
    gate_rate = hm.Parameter(4.0, shape="degree", unit="rad/s", description="rate of the gate")
    sine_rate = hm.Parameter(5.0, shape="degree", unit="rad/s", description="rate of the sine")
    duty_percent = hm.Parameter(20.0, shape="degree", description="share of each gate period that is on, in percent")
    phase = hm.Parameter(0.0, shape="degree", unit="rad", description="phase of the gate")
    squared = hm.Parameter(1.0, description="1 for the weight g^2, 0 for |g|")

    def wave(self, s: hm.Values, pieces: Mapping[str, Value]) -> Wave:
        """``4 sin(r t)**2 = 2 - 2 cos(2 r t)``, or ``2 |sin(r t)|`` on one half wave, while the gate is open."""
        is_on = 1.0 - _odd(pieces["segment"])
        sign = 1.0 - 2.0 * _odd(pieces["half_wave"])
        mean = 2.0 * s.squared * is_on
        return Wave(mean, -mean, 2.0 * (1.0 - s.squared) * is_on * sign, s.sine_rate * (1.0 + s.squared))

    def present(self, s: hm.Values) -> dict[str, Value]:
        """See `SelfTrigger.present`."""
        return {**super().present(s), "segment": s.segment, "half_wave": s.half_wave}

    def at_time(self, s: hm.Values) -> dict[str, Value]:
        """See `SelfTrigger.at_time`."""
        segment = gate_segment(s.t, s.gate_rate, s.phase, s.duty_percent)
        return {**super().at_time(s), "segment": segment, "half_wave": half_wave(s.t, s.sine_rate)}

    def piece_end(self, s: hm.Values, pieces: Mapping[str, Value]) -> Value:
        """See `SelfTrigger.piece_end`."""
        gate = np.min(gate_boundary(pieces["segment"], s.gate_rate, s.phase, s.duty_percent))
        kink = np.min(half_wave_boundary(pieces["half_wave"], s.sine_rate))
        return hm.least(super().piece_end(s, pieces), gate, kink)


def _odd(index: Value) -> Value:
    return index - 2 * np.floor(index / 2)
