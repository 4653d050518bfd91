"""What a run gives to its slaves from outside: values of inputs that nothing drives, and of tunable parameters."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import cast

import numpy as np

from cosim.errors import GivenValueError, MisfitError
from cosim.system import System
from hybrid_model import Signal


class Curve(Signal):
    """A signal that changes between its breakpoints too: masters that exchange continuous signals follow it."""


Given = float | str | bytes | Signal
"""A value for the whole run; a `Signal`, which is asked at the start and at its breakpoints, and held between; or a
`Curve`."""

ROUNDING = 1e-12
"""Part of a time by which a breakpoint may lie after a communication point and still be at it."""


class Changes:
    """Values from outside, in the order of time.

    Parameters
    ----------
    system : System
        Whose slaves.
    given : mapping
        ``"slave.variable"`` -> number or `Signal`.
    t_start : float
        Time in s; breakpoints up to it count as the start.

    Raises
    ------
    MisfitError
        For a variable that is neither an input nor a tunable parameter, or an input that a connection drives.
    """

    def __init__(self, system: System, given: Mapping[str, Given], t_start: float) -> None:
        self._system = system
        self._places = {name: system.settable(name) for name in given}
        self._given = dict(given)
        self._t_start = t_start
        self._curves = [name for name, value in given.items() if isinstance(value, Curve)]
        later: list[tuple[float, str]] = []
        for name, value in given.items():
            for time in value.breakpoints if isinstance(value, Signal) else ():
                if not math.isfinite(time):
                    raise MisfitError(f"{name} has the breakpoint {time}: give finite times in s.")
                later += [(float(time), name)] if time > t_start else []
        self._later = sorted(later, reverse=True)
        self._reached = t_start

    def set_start_values(self) -> None:
        """Give the slaves, which are in initialization mode, the values at the start."""
        for name in self._given:
            self._set(name, self._t_start)

    def next_time(self, limit: float) -> float | None:
        """Return the time in s of the next change, at most `limit`; None if there is none up to it."""
        if not self._later or self._later[-1][0] > limit + ROUNDING * abs(limit):
            return None
        return min(self._later[-1][0], limit)

    def take(self, t: float) -> dict[str, list[str]]:
        """Return what changes up to time `t` in s, which is done with it then: slave -> names for `set`."""
        due: dict[str, list[str]] = {}
        while self._later and self._later[-1][0] <= t + ROUNDING * abs(t):
            self._reached, name = self._later.pop()
            due.setdefault(self._places[name][0], []).append(name)
        return due

    def arrive(self, t: float) -> set[str]:
        """Set what has changed up to time `t` in s, and the curves; return whose it is that has changed."""
        changed = self.take(t)
        for names in changed.values():
            self.set(names, t)
        self.follow(t)
        return set(changed)

    def follow(self, t: float, *, before: bool = False, held: Collection[str] = ()) -> None:
        """Set the curves to their values at `t` in s, behind a jump that is there but for rounding, or before it.

        Those of slaves that are `held` stay.
        """
        curves = [name for name in self._curves if self._places[name][0] not in held]
        if before:
            jump = self._later[-1][0] if self._later else t
            self.set(curves, math.nextafter(min(t, jump), -math.inf))
        else:
            self.set(curves, max(t, self._reached) if self._reached <= t + ROUNDING * abs(t) else t)

    @property
    def receivers(self) -> set[str]:
        """Slaves that values come to."""
        return {slave for slave, _ in self._places.values()}

    @property
    def followed(self) -> list[str]:
        """Slaves with inputs that follow curves."""
        return [self._places[name][0] for name in self._curves]

    def set(self, names: list[str], t: float) -> None:
        """Set variables to their values at time `t` in s."""
        for name in names:
            self._set(name, t)

    def _set(self, name: str, t: float) -> None:
        slave, variable = self._places[name]
        given = self._given[name]
        asked = t if isinstance(given, Curve) else self._since(given, t) if isinstance(given, Signal) else t
        value = given.value(asked) if isinstance(given, Signal) else given
        if np.shape(value) != ():
            raise MisfitError(f"{name} is given {value!r} at t = {t:.9g} s: give one number, element by element.")
        try:
            self._system.slaves[slave].set(variable, cast(float, value))
        except MisfitError as error:
            raise GivenValueError(str(error)) from error

    def _since(self, signal: Signal, t: float) -> float:
        """Return the last breakpoint up to `t`, or the start."""
        past = [float(b) for b in signal.breakpoints if b <= t + ROUNDING * abs(t)]
        return max([self._t_start, *past])
