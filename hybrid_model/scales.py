"""The numbers of the semantics, for all executions: none is in seconds or in the unit of a state (rule 12).

A run whose time or whose states are written in another unit is the same run, scaled. So what counts as one instant, as
a border or as an accumulation is a part of something that the run itself has: its time so far, the gap to its last
jump, the size of its states, the spacing of floating-point numbers. Exported FMUs carry these numbers in their
`model.c`, and the scheduler of networks uses the same function of time.
"""

from __future__ import annotations

import math

import numpy as np

from hybrid_model.declare.variables import FloatArray

ROUNDINGS = 8.0
"""Times that differ by fewer ulp are one: 3 * 0.1 and 0.3."""
INSTANT = 2e-11
"""Crossings closer than this part of the time since the start are one instant: their times are no more accurate."""
INSTANT_IN_GAP = 1e-4
"""But never further apart than this part of the time since the last jump: fast events late in a run stay apart."""
BORDER = 1e-9
"""A state is on the border of a set if it is across by less than moving the states by this part of their size does."""
NOISE = 1e-15
"""The same, where only rounding is meant: under flow priority a flow set is left beyond it."""
ABSOLUTE = 1e-15
"""Absolute tolerance of a step, as a part of the usual size of a state."""
ROUNDING_LEVEL = 3e-14
"""A state below this part of the largest one may be rounding: no digit of it is to be had."""
SEEN_PART = 1e-10
"""To see how the rates are rounded, what they depend on is moved by this part of itself, and time by it of a step."""
LEFT_BY_ROUNDING = 64.0
"""The error of a step may be so many roundings of the rates in its time."""
UNKNOWN = 1e-6
"""States below this part of where their flow may lead have shown no size yet."""
REACH_AT = (1e-3, 0.03, 0.3, 1.0)
REACH_STEP = 1e-3
"""Parts of a flow at which its rates are looked at, and of that time by which states are moved to see them turn."""
EULER_PART = 0.01
"""The Euler step that tells the length of a first step moves the states by this part of their size."""
BLIND_PART = 1e-3
"""Part of the flow that the Euler step is, where the states have no size yet."""
FIRST_GROWTH = 100.0
"""The first step is at most this many times the Euler step."""
FIRST_LEAST = 64.0
"""In ulp: the shortest first step."""
PROBE = 1e-6
"""Where a flow leads from a border is looked at after this part of a step of the solver."""
PROBE_PARTS = (1e-6, 1e-3, 1.0)
"""And after these parts of that, the shortest first, while no state has shown its size: the step may be too long."""
STEADY = 0.25
"""What changes twice as much in twice the time, but for this part, is no rounding: it shows where a flow leads."""
OVERSHOOT = 1000.0
"""In ulp: so far before a guard a solver may get stuck if the flow map cannot be evaluated behind it."""
JUMPS_AT_ONCE = 1000
"""So many jumps of one name may happen at one instant."""
JUMPS_IN_WINDOW = 100
"""So many jumps of one name are a burst, which may be an accumulation."""
ACCUMULATION = 1e-6
"""Jumps accumulate if what is left of the geometric series of their gaps is below this part of its longest gap."""
SPREAD = 0.05
"""Ratios of successive gaps that differ by less than this part count as one."""
CROWD = 1e-6
"""Jumps crowd if a burst of them comes within this part of the longest gap since the last pause."""
RESOLVED = 1e4
"""In ulp: gaps below have ratios that rounding blurs, so a geometric series is judged before."""
CHATTER = 1000.0
"""In ulp: jumps at gaps below are no events in time any more."""
PAUSE = 1e-4
"""A gap that is below this part of the one before does not continue it: what was before is a pause."""

SLIDING_AFTER = 500
"""After so many steps of a run it is looked whether it chatters: whether none leads away from a jump of its rates."""
SLIDING_LOOKS = 100
SLIDING_FOUND = 10
"""Then after each of so many steps; so many of these looks must find a jump to which the flow leads back."""
SLIDING_LEFT = 1e4
"""But a run that needs fewer steps than this at its present pace is let go on."""
SLIDING_AHEAD = 8.0
"""Jumps of the rates are looked for so many steps ahead, since the next steps are the shorter the nearer they are."""
RETAINED = 0.45
"""Of a change of a rate over a distance, at least this part stays with each halving if it is a jump; on the very
surface the rate may be half of it, as with a sign of zero."""
HALVINGS_LEAST = 6
HALVINGS_MOST = 40
"""So many halvings tell a jump; more than the most would find steep places of smooth maps that no step sees."""
AWAY = (8.0, 64.0, 512.0)
"""On both sides of a jump it is looked where the flow leads in the time of so many of the last halves."""
PACE_STEPS = 2000
"""The pace of a flow is looked at after so many steps each."""
MOST_STEPS = 1e7
"""A flow that would need more steps than this at its present pace is given up: no run lasts that long."""
MOST_COMPILED_STEPS = 1e9
"""The same where maps are compiled, whose steps take a hundredth of the time."""

_IN_MODELS = (
    *("roundings", "instant", "instant_in_gap", "border", "absolute", "rounding_level", "unknown", "probe"),
    *("probe_parts", "steady"),
    *("overshoot", "jumps_at_once", "jumps_in_window", "accumulation", "spread", "crowd", "resolved", "chatter"),
    *("pause", "euler_part", "blind_part", "first_growth", "first_least", "reach_step", "reach_at"),
    *("sliding_after", "sliding_looks", "sliding_found", "sliding_left", "sliding_ahead", "retained"),
    *("seen_part", "left_by_rounding"),
    *("halvings_least", "halvings_most", "away", "pace_steps", "most_compiled_steps"),
)


def of_models() -> dict[str, float | tuple[float, ...]]:
    """Return the numbers that every exported model carries, by their names in ``ModelScales`` (engine/model.h)."""
    return {name: globals()[name.upper()] for name in _IN_MODELS}


def ulp(t: float) -> float:
    """Return the distance from the size of `t` to the next larger float."""
    return math.ulp(t)


def one_instant(t: float, t_start: float, t_last: float) -> float:
    """Return how far apart two crossings may be at `t` and still be one instant (rule 6).

    Parameters
    ----------
    t : float
        Time of the first of them in s.
    t_start, t_last : float
        Start of the run and time of the last jump before, in s.

    Returns
    -------
    float
        In s.
    """
    return max(ROUNDINGS * ulp(t), min(INSTANT * (t - t_start), INSTANT_IN_GAP * (t - t_last)))


def usual_sizes(sizes: FloatArray, history: FloatArray) -> FloatArray:
    """Return the sizes of states of which borders are parts: their own, but what may be all rounding counts as large.

    Parameters
    ----------
    sizes : ndarray, shape (n,)
        The states' own sizes.
    history : ndarray, shape (n,)
        Largest value of each state so far.

    Returns
    -------
    ndarray, shape (n,)
    """
    largest = float(history.max(initial=0.0))
    return np.where(sizes < ROUNDING_LEVEL * largest, largest, sizes)


def tolerance_sizes(sizes: FloatArray) -> FloatArray:
    """Return the sizes of states of which absolute tolerances are parts.

    They lie between a state's usual size and the largest one, by the geometric mean: the digits of a small state count,
    but not those that rounding errors of the large states leave no more. None is above one, so that large states never
    cost small ones their digits.

    Parameters
    ----------
    sizes : ndarray, shape (n,)
        Largest value of each state so far, not all zero.

    Returns
    -------
    ndarray, shape (n,)
    """
    usual = usual_sizes(sizes, sizes)
    return np.minimum(np.sqrt(usual) * math.sqrt(usual.max()), 1.0)


def moves(sizes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two ways to move states by up to `BORDER` of their sizes; no simple sum of states hides from both.

    Parameters
    ----------
    sizes : ndarray, shape (n,)
        Usual sizes of the states.

    Returns
    -------
    (ndarray, ndarray)
        Changes of the states, shape (n,) each.
    """
    one_way, to_and_fro = part_moves(len(sizes))
    return BORDER * sizes * one_way, BORDER * sizes * to_and_fro


def part_moves(n: int) -> tuple[FloatArray, FloatArray]:
    """Return the parts, at most one, by which `n` numbers are moved, all one way and to and fro."""
    k = np.arange(n)
    weights = 1.0 - 0.5 * np.mod(k * 0.6180339887498949, 1.0)
    return weights, weights * np.where(k % 2 == 0, 1.0, -1.0)
