"""The clockwork of the weights as expressions: which segment holds a time, and when a segment ends.

Every function here is built from ``+ - * / **``, comparisons and ``np.sin``, ``np.floor``, ``np.where`` only and
never branches on a value. The same line therefore serves floats, arrays and symbols (a trace that becomes C code).

Two rules hold for all clocks and are what event location relies on:

* a segment is half open, ``[end of the previous one, end of this one)``;
* a time that equals a computed boundary bit for bit lies in the *next* segment: ``segment(boundary(k)) == k + 1``.
  A plain ``floor`` misses that by one unit now and then, because the division rounds; so the floor is only a first
  guess, corrected by comparison with the boundaries themselves.
"""

from typing import Any

import numpy as np

__all__ = [
    "dwell_boundary",
    "dwell_index",
    "gate_boundary",
    "gate_segment",
    "gated_sine",
    "half_wave",
    "half_wave_boundary",
    "not_negative",
]

Expression = Any
"""A float, an array, or a symbol that overloads arithmetic and the numpy functions named above."""


def gate_segment(t: Expression, rate: Expression, phase: Expression, duty_percent: Expression) -> Expression:
    """Index of the on- or off-segment of the gate ``square(rate*t - phase, duty_percent)`` that holds `t`.

    On-window ``m`` starts at ``(phase + 2*pi*m)/rate`` and lasts ``2*pi*duty_percent/100/rate``; ``m`` may be negative.

    Parameters
    ----------
    t : float, array or symbol
        Time [s].
    rate : float
        Angular rate of the gate [rad/s].
    phase : float
        Phase [rad].
    duty_percent : float
        Share of each period during which the gate is open, 0 to 100 [%].

    Returns
    -------
    float, array or symbol
        ``2*m`` inside on-window ``m``, ``2*m + 1`` after it. With a duty of 0 there are only odd segments, with a duty
        of 100 only even ones.

    Notes
    -----
    ``square(a*t, b)`` is the paper's section 7: +1 for the first ``b`` percent of each period ``2*pi/a``, then -1.
    """
    guess = np.floor((t * rate - phase) / (2 * np.pi))
    late = np.where(t >= gate_boundary(2 * guess + 1, rate, phase, duty_percent), 1.0, 0.0)
    early = np.where(t < gate_boundary(2 * guess - 1, rate, phase, duty_percent), 1.0, 0.0)
    window = guess + late - early
    is_over = np.where(t >= gate_boundary(2 * window, rate, phase, duty_percent), 1.0, 0.0)
    return 2 * window + is_over


def gate_boundary(k: Expression, rate: Expression, phase: Expression, duty_percent: Expression) -> Expression:
    """End time [s] of segment `k` of the gate; see `gate_segment` for the parameters.

    The end of an off-segment is computed as ``(phase + 2*pi*(m + 1))/rate``. With ``rate = 4`` and ``phase = 0`` the
    division is exact, so a dwell of ``pi`` or ``pi/2`` meets the gate at the same floating-point number.
    """
    window = np.floor(k / 2)
    is_off = k - 2 * window
    share = is_off + (1 - is_off) * (duty_percent / 100)
    return (phase + 2 * np.pi * (window + share)) / rate


def half_wave(t: Expression, rate: Expression) -> Expression:
    """Index ``floor(rate*t/pi)`` of the half wave of ``sin(rate*t)`` that holds `t` [s]; `rate` in rad/s."""
    guess = np.floor(t * rate / np.pi)
    late = np.where(t >= half_wave_boundary(guess, rate), 1.0, 0.0)
    early = np.where(t < half_wave_boundary(guess - 1, rate), 1.0, 0.0)
    return guess + late - early


def half_wave_boundary(h: Expression, rate: Expression) -> Expression:
    """End time ``(h + 1)*pi/rate`` [s] of half wave `h` of ``sin(rate*t)``."""
    return (h + 1) * np.pi / rate


def dwell_index(t: Expression, dwell: Expression) -> Expression:
    """Index ``floor(t/dwell)`` of the dwell interval that holds `t` [s]; `dwell` in seconds."""
    guess = np.floor(t / dwell)
    late = np.where(t >= dwell_boundary(guess, dwell), 1.0, 0.0)
    early = np.where(t < dwell_boundary(guess - 1, dwell), 1.0, 0.0)
    return guess + late - early


def dwell_boundary(j: Expression, dwell: Expression) -> Expression:
    """End time ``(j + 1)*dwell`` [s] of dwell interval `j`, from the index and never by adding up."""
    return (j + 1) * dwell


def gated_sine(t: Expression, k: Expression, sine_rate: Expression) -> Expression:
    """The paper's ``g = (square(...) + 1)*sin(sine_rate*t)`` in gate segment `k`: ``2*sin`` if `k` is even, else 0.

    Using the segment index instead of comparing times keeps the value of a segment right up to and including its end,
    where an integrator evaluates it. `t` in seconds, `sine_rate` in rad/s; source: paper, section 7.
    """
    is_off = k - 2 * np.floor(k / 2)
    return 2 * (1 - is_off) * np.sin(sine_rate * t)


def not_negative(weight: Expression) -> Expression:
    """The weight itself, or 0 where rounding has left it below.

    A choice and no maximum: where the weight is 0, its derivative stays that of the weight.
    """
    return np.where(weight < 0, 0.0, weight)
