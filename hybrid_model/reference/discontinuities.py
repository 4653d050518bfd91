"""Where along a chord the rates jump, and whether the flow leads back there from both sides.

The flow may not have a jump of its rates inside (rule 13 of docs/semantics.md). Steps cross one that they meet once
after some rejections; where the flow on both sides leads back to it, as with a relay, no step leads away from it, and
the solution that remains, in the sense of A. F. Filippov, "Differential equations with discontinuous righthand sides",
1988, section 4, is the solver's by chance only. `hybrid_model/engine/progress.c` looks in the same way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hybrid_model.declare.variables import FloatArray
from hybrid_model.scales import AWAY, HALVINGS_LEAST, HALVINGS_MOST, RETAINED

Rates = Callable[[float, FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Side:
    """A point on one side of a jump of the rates: t in s, states and their rates there, shape (n,) each."""

    t: float
    x: FloatArray
    rates: FloatArray


@dataclass(frozen=True, eq=False)
class JumpOfRates:
    """Two points next to each other between which the rate of state `row` jumps; `gap` is the time between them.

    `rates` are those of the state a little before and after.
    """

    row: int
    rates: tuple[float, float]
    before: Side
    after: Side
    gap: float


def jump_of_rates(rates: Rates, start: Side, end: Side, scale: FloatArray) -> JumpOfRates | None:
    """Find a jump of the rates between two points by halving what lies between them.

    A change of the rates of a smooth map shrinks with the distance, that of a root at least by its power; a jump stays.

    Parameters
    ----------
    rates : callable
        ``rates(t, x) -> dx/dt``.
    start, end : Side
        The points.
    scale : ndarray
        What counts as one in each state; the state whose rate changes most in it is looked at.

    Returns
    -------
    JumpOfRates or None
        None if there is none, or if floating-point numbers between the points are too few to tell.
    """
    changes = np.abs(end.rates - start.rates) / scale
    row = int(changes.argmax())
    least, halvings, a, b = RETAINED * abs(end.rates[row] - start.rates[row]), 0, start, end
    gap = end.t - start.t
    if not least > 0.0:
        return None
    while halvings < HALVINGS_MOST:
        t, x = a.t + 0.5 * (b.t - a.t), a.x + 0.5 * (b.x - a.x)
        moved = not ((x == a.x).all() or (x == b.x).all())
        if not (moved or a.t < t < b.t):
            break
        middle = Side(t, x, rates(t, x))
        first, second = abs(middle.rates[row] - a.rates[row]), abs(b.rates[row] - middle.rates[row])
        if not max(first, second) >= least:
            return None
        a, b = (a, middle) if first >= second else (middle, b)
        halvings += 1
        gap = 0.5 * gap if moved else gap
    if halvings < HALVINGS_LEAST:
        return None
    return JumpOfRates(row, (float(start.rates[row]), float(end.rates[row])), a, b, gap)


def leads_back(rates: Rates, jump: JumpOfRates, longest: float) -> bool:
    """Whether from both sides of a jump the flow leads to the other side, so that none leads away from it.

    Looked at a few gaps on, and not further than `longest` in s: further ahead there may be another jump.
    """
    return any(
        _leads_to(rates, jump.before, jump.after, jump.row, time)
        and _leads_to(rates, jump.after, jump.before, jump.row, time)
        for time in (gaps * jump.gap for gaps in AWAY)
        if time <= longest
    )


def _leads_to(rates: Rates, here: Side, there: Side, row: int, time: float) -> bool:
    found = rates(here.t + time, here.x + time * here.rates)[row]
    return bool(abs(found - there.rates[row]) < abs(found - here.rates[row]))
