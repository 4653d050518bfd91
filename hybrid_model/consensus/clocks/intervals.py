"""The clockwork of weights and triggers: which interval of a clock holds a time, and when an interval ends.

Every function here is built from ``+ - * / **``, comparisons and ``np.floor``, ``np.where`` only and never branches on
a value. The same line therefore serves floats, arrays and symbols (a trace that becomes C code).

Two rules hold for all clocks, also the gate's and that of rows, and are what event location relies on:

* an interval is half open, ``[end of the previous one, end of this one)``;
* a time that equals a computed boundary bit for bit lies in the *next* interval: ``index(boundary(k)) == k + 1``.
"""

from collections.abc import Callable

import numpy as np

from hybrid_model.declare.variables import Value

__all__ = [
    "dwell_boundary",
    "dwell_index",
    "half_wave",
    "half_wave_boundary",
    "holding",
    "in_turn",
    "is_odd",
    "not_negative",
]


def holding(t: Value, guess: Value, boundary: Callable[[Value], Value]) -> Value:
    """Index of the interval that holds `t` [s], given a guess that rounding may have put one off.

    A plain ``floor`` misses the second rule by one unit now and then, because the division rounds; so it is only a
    first guess, corrected by comparison with the boundaries themselves. ``boundary(k)`` is the end of interval k.
    """
    late = np.where(t >= boundary(guess), 1.0, 0.0)
    early = np.where(t < boundary(guess - 1), 1.0, 0.0)
    return guess + late - early


def half_wave(t: Value, rate: Value) -> Value:
    """Index ``floor(rate*t/pi)`` of the half wave of ``sin(rate*t)`` that holds `t` [s]; `rate` in rad/s."""
    return holding(t, np.floor(t * rate / np.pi), lambda h: half_wave_boundary(h, rate))


def half_wave_boundary(h: Value, rate: Value) -> Value:
    """End time ``(h + 1)*pi/rate`` [s] of half wave `h` of ``sin(rate*t)``."""
    return (h + 1) * np.pi / rate


def dwell_index(t: Value, dwell: Value) -> Value:
    """Index ``floor(t/dwell)`` of the dwell interval that holds `t` [s]; `dwell` in seconds."""
    return holding(t, np.floor(t / dwell), lambda j: dwell_boundary(j, dwell))


def dwell_boundary(j: Value, dwell: Value) -> Value:
    """End time ``(j + 1)*dwell`` [s] of dwell interval `j`, from the index and never by adding up."""
    return (j + 1) * dwell


def is_odd(k: Value) -> Value:
    """1 for odd indices, 0 for even ones."""
    return k - 2 * np.floor(k / 2)


def in_turn(k: Value, count: Value) -> Value:
    """Of `count` things that take turns, 1 at the place of number `k`, else 0; shape (count,)."""
    return np.where(np.arange(count) == k - count * np.floor(k / count), 1.0, 0.0)


def not_negative(weight: Value) -> Value:
    """The weight itself, or 0 where rounding has left it below.

    A choice and no maximum: where the weight is 0, its derivative stays that of the weight.
    """
    return np.where(weight < 0, 0.0, weight)
