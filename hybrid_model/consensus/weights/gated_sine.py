"""The paper's weights: a sine behind a gate, squared or in absolute value (paper, section 7; audit, section 9)."""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

import hybrid_model as hm
from hybrid_model.consensus.clocks.intervals import half_wave, half_wave_boundary
from hybrid_model.consensus.clocks.over_time import require
from hybrid_model.consensus.clocks.periods import common_period
from hybrid_model.consensus.entries import Entries
from hybrid_model.consensus.weights.gate import Gate, GateClock, is_open
from hybrid_model.consensus.weights.waveform import Waveform, each_edge
from hybrid_model.declare.variables import Value

__all__ = ["GatedAbsoluteSineWeights", "GatedSine", "GatedSineWeights", "SineCarrier", "WeightMap"]


class WeightMap(enum.Enum):
    """How a signed signal g becomes a weight w >= 0 (audit, section 9: w = g itself is not admissible)."""

    SQUARE = "square"
    ABS = "abs"


@dataclass(frozen=True)
class SineCarrier:
    """The open-gate shape ``4*sin(rate*t)**2`` or ``2*|sin(rate*t)|``; `rate` in rad/s."""

    rate: Value
    map: WeightMap

    @property
    def steepness(self) -> Value:
        """``4*rate`` or ``2*rate``."""
        return (4.0 if self.map is WeightMap.SQUARE else 2.0) * self.rate

    def value(self, t: Value) -> Value:
        """Value at time `t` [s], the gate being open."""
        wave = 2 * np.sin(self.rate * t)
        return wave**2 if self.map is WeightMap.SQUARE else np.abs(wave)

    def integral(self, t0: Value, t1: Value) -> Value:
        """Integral from `t0` to `t1` [s] in closed form, without cancellation between two large primitives."""
        if self.map is WeightMap.SQUARE:
            wave = np.cos(self.rate * (t0 + t1)) * np.sin(self.rate * (t1 - t0))
            return 2 * (t1 - t0) - 2 / self.rate * wave
        # Each half wave of 2|sin| has the area 4/rate; the difference of the cosines of the angles within their half
        # waves is written as a product.
        h0, h1 = half_wave(t0, self.rate), half_wave(t1, self.rate)
        middle = self.rate * (t0 + t1) / 2 - np.pi * (h0 + h1) / 2
        half = self.rate * (t1 - t0) / 2 - np.pi * (h1 - h0) / 2
        return 4 / self.rate * ((h1 - h0) + np.sin(middle) * np.sin(half))


class GatedSineWeights(GateClock):
    """The paper's weights ``w = g**2`` with ``g = (square(gate_rate t - phase, duty) + 1) sin(sine_rate t)``.

    Using the segment index instead of comparing times keeps the value of a segment right up to and including its end,
    where an integrator evaluates it. Source: paper, section 7; audit, section 9 for the reading ``g**2``.
    """

    sine_rate = hm.Parameter(5.0, shape="degree", unit="rad/s", description="rate of the sine")
    weight_map = WeightMap.SQUARE

    def amplitude(self, s: hm.Values, pieces: Mapping[str, Value]) -> Value:
        """1 while the gate is open, else 0."""
        return is_open(pieces["segment"])

    def carrier(self, s: hm.Values) -> SineCarrier:
        """The sine, squared or in absolute value."""
        return SineCarrier(s.sine_rate, self.weight_map)


class GatedAbsoluteSineWeights(GatedSineWeights):
    """The alternative reading ``w = |g|`` (audit, section 9); its kinks at the sine's zeros are breakpoints too."""

    half_wave = hm.DiscreteState(
        0, shape="degree", integer=True, internal=True, computed=True, description="half wave of the sine"
    )
    weight_map = WeightMap.ABS
    pieces = ("segment", "half_wave")

    def pieces_at(self, s: hm.Values) -> dict[str, Value]:
        """The segments and the half waves that hold the present time."""
        return {**super().pieces_at(s), "half_wave": half_wave(s.t, s.sine_rate)}

    def piece_end(self, s: hm.Values, pieces: Mapping[str, Value]) -> Value:
        """Time at which a gate switches or a sine is zero."""
        zero = np.min(half_wave_boundary(pieces["half_wave"], s.sine_rate))
        return np.minimum(super().piece_end(s, pieces), zero)


@dataclass(frozen=True)
class GatedSine(Waveform):
    """The weight ``w = g**2`` or ``|g|`` of ``g = (square(gate_rate*t - phase, duty_percent) + 1)*sin(sine_rate*t)``.

    Parameters
    ----------
    gate_rate, sine_rate : float
        Angular rates [rad/s], positive.
    duty_percent : float
        Open share of each gate period, 0 to 100 [%].
    phase : float
        Phase of the gate [rad].
    map : WeightMap
        SQUARE (the reading under which the paper's example is persistently exciting) or ABS.

    Raises
    ------
    ValueError
        If a number is outside its range or not finite.

    Notes
    -----
    Source: paper, section 7; audit, section 9 for the choice of the map and for the closed-form integrals.
    """

    gate_rate: float
    sine_rate: float
    duty_percent: float
    phase: float = 0.0
    map: WeightMap = WeightMap.SQUARE
    numbers: ClassVar[Mapping[str, float | None]] = {
        "gate_rate": None,
        "sine_rate": None,
        "duty_percent": None,
        "phase": 0.0,
    }
    further_keys: ClassVar[tuple[str, ...]] = ("map",)

    def __post_init__(self) -> None:
        """Check the values."""
        require("sine_rate", self.sine_rate, self.sine_rate > 0, "must be positive")
        self.gate.check()

    @cached_property
    def gate(self) -> Gate:
        """When the weight is on."""
        return Gate(self.gate_rate, self.duty_percent, self.phase)

    @property
    def carrier(self) -> SineCarrier:
        """The shape of the weight while the gate is open."""
        return SineCarrier(self.sine_rate, self.map)

    @property
    def automaton(self) -> type[GatedSineWeights]:
        """One for each map."""
        return GatedSineWeights if self.map is WeightMap.SQUARE else GatedAbsoluteSineWeights

    @property
    def period(self) -> float | None:
        """A period [s] of the weight, 0.0 if it is zero throughout, None if gate and sine are not commensurable.

        Both maps fold the sine, so the carrier has the period ``pi/sine_rate``.
        """
        if self.duty_percent == 0:
            return 0.0
        carrier_period = math.pi / self.sine_rate
        if self.duty_percent == 100:
            return carrier_period
        return common_period((2 * math.pi / self.gate_rate, carrier_period))

    def amplitude(self, t: ArrayLike) -> NDArray[np.float64]:
        """1 where the gate is open at `t` [s], else 0."""
        return np.asarray(is_open(self.gate.segment(np.asarray(t, dtype=float))))

    def breakpoints(self, t0: float, t1: float) -> NDArray[np.float64]:
        """Times strictly between `t0` and `t1` [s], ascending, at which the weight jumps or has a kink.

        These are the gate's boundaries and, for ABS, the zeros of the sine inside open windows.
        """
        times = self.gate.breakpoints(t0, t1)
        if self.map is WeightMap.SQUARE:
            return times
        zeros = half_wave_boundary(
            np.arange(half_wave(t0, self.sine_rate), half_wave(t1, self.sine_rate)), self.sine_rate
        )
        times = np.union1d(times, zeros[self.amplitude(zeros) > 0])
        return times[(times > t0) & (times < t1)]

    def integral(self, t0: ArrayLike, t1: ArrayLike) -> NDArray[np.float64]:
        """Exact integral of the weight from `t0` to `t1` [s]; the two broadcast against each other."""
        return self.gate.integral(self.carrier, t0, t1)

    @classmethod
    def read(cls, entries: Entries, edges: int, folder: Path) -> tuple[Self, ...]:
        """See `Waveform.read`."""
        weight_map = entries.choice("map", WeightMap, default=WeightMap.SQUARE)
        columns = [entries.per_edge(key, edges, default) for key, default in cls.numbers.items()]
        return each_edge(cls, zip(*columns, (weight_map,) * edges, strict=True))
