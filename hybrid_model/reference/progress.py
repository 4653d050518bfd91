"""Whether a flow gets on: its pace, and whether it chatters about a jump of its rates (rule 13 of docs/semantics.md).

The C engine (hybrid_model/engine/progress.c) decides in the same way.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.errors import SimulationError
from hybrid_model.reference.discontinuities import JumpOfRates, Side, jump_of_rates, leads_back
from hybrid_model.reference.point import Point
from hybrid_model.reference.rounding import rounding_of_rates
from hybrid_model.reference.tolerances import quiet_rates
from hybrid_model.scales import (
    LEFT_BY_ROUNDING,
    MOST_STEPS,
    OVERSHOOT,
    PACE_STEPS,
    SLIDING_AFTER,
    SLIDING_AHEAD,
    SLIDING_FOUND,
    SLIDING_LEFT,
    SLIDING_LOOKS,
    ulp,
)


class Progress:
    """Watches the steps of one flow to `end` in s; a solver that creeps does not fail by itself."""

    def __init__(self, point: Point, end: float) -> None:
        self._point, self._end = point, end
        self._t, self._steps = point.t, 0
        # What an input's breakpoint at the end changes is no part of this flow.
        self._last = float(np.nextafter(end, -np.inf)) if point.inputs.vary else end

    def check(self, step: float, absolute: FloatArray) -> None:
        """Look at the point after an accepted step.

        Parameters
        ----------
        step : float
            Its length in s.
        absolute : ndarray, shape (n,)
            The absolute tolerance of each state.

        Raises
        ------
        SimulationError
            If the flow creeps or chatters; it names the time, the state and the remedy.
        """
        if self._look_is_due():
            jump = self._jump_ahead(SLIDING_AHEAD * step, absolute)
            if jump is not None and leads_back(self._rates, jump, SLIDING_AHEAD * step):
                looks = self._point.looks
                looks.found += 1
                if looks.found >= SLIDING_FOUND and not self._soon_over(looks.steps - SLIDING_AFTER):
                    raise SimulationError(self._chatters(jump))
        self._steps += 1
        if self._steps % PACE_STEPS == 0:
            self._keep_pace(absolute)

    def what_jumps(self, absolute: FloatArray) -> str:
        """Say which rate jumps just ahead of the point, where a step cannot be made; an empty text if none does."""
        jump = self._jump_ahead(OVERSHOOT * ulp(self._point.t), absolute)
        return "" if jump is None else self._described(jump)

    def _look_is_due(self) -> bool:
        looks, t = self._point.looks, self._point.t
        looks.steps += 1
        if looks.steps == SLIDING_AFTER and self._soon_over(SLIDING_AFTER):
            looks.begin_at(t)
        elif looks.steps == SLIDING_AFTER:
            looks.begin = t
        elif looks.steps > SLIDING_AFTER + SLIDING_LOOKS:
            looks.begin_at(t)
        return looks.steps > SLIDING_AFTER

    def _soon_over(self, steps: int) -> bool:
        """Whether at the pace of the last `steps` steps the run comes to its end, if it is known, with few more."""
        point = self._point
        return point.t_stop - point.t <= SLIDING_LEFT / steps * (point.t - point.looks.begin)

    def _jump_ahead(self, time: float, absolute: FloatArray) -> JumpOfRates | None:
        """Find a jump of the rates on the straight way ahead, in the next `time` s but within the flow."""
        t, x = self._point.t, self._point.x
        t1 = min(t + time, self._last)
        rates = self._rates(t, x)
        x1 = x + (t1 - t) * rates
        if not (t1 > t and np.isfinite(x1).all()):
            return None
        scale = absolute + self._point.solver.rtol * np.abs(x)
        jump = jump_of_rates(self._rates, Side(t, x, rates), Side(t1, x1, self._rates(t1, x1)), scale)
        return None if jump is not None and self._is_rounding(jump, time) else jump

    def _is_rounding(self, jump: JumpOfRates, time: float) -> bool:
        """Whether rounding alone makes such a jump: sums of large terms that cancel are as rough."""
        near, (before, after) = jump.before, jump.rates
        rounding = rounding_of_rates(self._point, near.t, near.x, time)[jump.row]
        return bool(abs(after - before) <= LEFT_BY_ROUNDING * rounding)

    @property
    def _rates(self) -> Callable[[float, FloatArray], FloatArray]:
        return lambda t, x: quiet_rates(self._point, min(t, self._last), x)

    def _described(self, jump: JumpOfRates) -> str:
        name = self._point.layout.names(Kind.STATE)[jump.row]
        (before, after), value = jump.rates, jump.before.x[jump.row]
        return f"the rate of '{name}' jumps from {before:.6g} to {after:.6g} where its value is {value:.9g}"

    def _chatters(self, jump: JumpOfRates) -> str:
        point, steps = self._point, self._point.looks.steps - SLIDING_AFTER
        return (
            f"{point.automaton.name}: the flow chatters at t = {point.t:.9g} s: {self._described(jump)}, and from both "
            f"sides the flow leads back there: {steps} steps led {point.t - point.looks.begin:.2g} s on. "
            f"{REMEDY}"
        )

    def _keep_pace(self, absolute: FloatArray) -> None:
        point, t = self._point, self._point.t
        needed = (self._end - t) / (t - self._t) * PACE_STEPS
        if needed <= MOST_STEPS:
            self._t = t
            return
        state = point.layout.describe({Kind.STATE: point.x, Kind.DISCRETE: point.z})
        what = self.what_jumps(absolute)
        remedy = f"There {what}. {REMEDY}" if what else CREEPS
        raise SimulationError(
            f"{point.automaton.name}: the flow creeps: its last {PACE_STEPS} steps led from t = {self._t:.9g} to "
            f"{t:.9g} s ({state}), so that it would need {needed:.2g} more to reach {self._end:.9g} s. {remedy}"
        )


REMEDY = (
    "Write what jumps as modes with a switch (hm.ModalAutomaton, hm.Switch), with a mode of its own for what stays at "
    "that surface, as sticking does; or let a jump happen there."
)
CREEPS = (
    "Look for a flow map that is not smooth there (a root at zero, a sign): write it as modes with a switch, or smooth "
    "it; for a stiff flow choose Radau or BDF, and looser tolerances."
)
