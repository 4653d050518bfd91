"""Exact runs of affine automata with linear guards: the semantics written out a second time, over closed-form flows.

A `System` is plain data: modes with affine flows, guards ``c.x + drift t + feed u >= level``, timers, and what each
event does to the state. `exact_run` alternates jumps and flows as docs/semantics.md says. The flows are the closed
forms of `oracles.affine_flows`, in rational numbers, in decimals of 28 digits, or in floats; nothing is integrated, no
event is searched for by sampling, and no code is shared with the package.

Floats cannot decide everything that exact numbers can. A run ends early where the answer would hang on rounding: two
instants less than `APART` apart that are not one, or a margin of zero that was computed and not reached by the flow.
"""

from dataclasses import dataclass, field
from typing import Any

from oracles.affine_flows import Undecidable

SAME = 1e-12
"""In s: instants of the closed forms that differ by less are one, exactly in rationals, up to rounding in floats."""
APART = 1e-6
"""In s: other instants are at least this far apart. The package treats crossings within 1e-9 s as one (rule 6)."""
ZONE = 1e-9
"""Margins nearer to zero than this are zero or undecidable."""


@dataclass(frozen=True)
class Guard:
    """Due where ``normal.x + drift t + feed u - level >= 0``, in `mode` only if one is given."""

    name: str
    normal: tuple[Any, ...]
    level: Any
    mode: int | None = None
    drift: Any = 0
    feed: Any = 0


@dataclass(frozen=True)
class Timer:
    """Due at ``first + k period``."""

    name: str
    first: Any
    period: Any


@dataclass(frozen=True)
class Effect:
    """What an event does: components of x assigned or shifted, the mode set, the guard's own level lifted."""

    assign: dict[int, Any] = field(default_factory=dict)
    shift: dict[int, Any] = field(default_factory=dict)
    mode: int | None = None
    lift: Any = 0


@dataclass(frozen=True)
class Mode:
    """The flow ``x' = matrix x + offset + gain u``."""

    matrix: tuple[tuple[Any, ...], ...]
    offset: tuple[Any, ...]
    gain: tuple[Any, ...]


@dataclass(frozen=True)
class System:
    """An automaton as data; `flow` is the closed form, `dyadic` says that its numbers are exact as floats."""

    flow: type
    x0: tuple[Any, ...]
    modes: tuple[Mode, ...]
    events: tuple[tuple[Guard | Timer, Effect], ...]
    t_end: Any
    u: tuple[tuple[Any, Any], ...] = ()
    dyadic: bool = False


@dataclass(frozen=True)
class Event:
    """An event of the exact run: name, time, state and mode after it, the slope of its margin when it was crossed."""

    name: str
    t: Any
    x_after: tuple[Any, ...]
    mode_after: int
    slope: float


@dataclass(frozen=True)
class ExactRun:
    """All events, and time, state and mode where the run ended; `cut` says that it ended with its last event."""

    events: tuple[Event, ...]
    t: Any
    x: tuple[Any, ...]
    mode: int
    cut: bool


def exact_run(system: System, max_events: int) -> ExactRun:
    """Run to the end time, or through `max_events` events, or through all events before an undecidable one."""
    run = _Run(system)
    try:
        while len(run.events) < max_events:
            index = run.due()
            if index is not None:
                run.jump(index)
            elif run.t_end - run.t <= SAME:
                return ExactRun(tuple(run.events), run.t, tuple(run.x), run.mode, cut=False)
            else:
                run.flow()
    except Undecidable:
        pass
    last = run.events[-1] if run.events else Event("start", run.number(0), tuple(map(run.number, system.x0)), 0, 1.0)
    return ExactRun(tuple(run.events), last.t, last.x_after, last.mode_after, cut=True)


class _Run:
    def __init__(self, system):
        self.system = system
        number = self.number = system.flow.number
        self.kinds = [kind for kind, _ in system.events]
        self.guards = [k for k, kind in enumerate(self.kinds) if isinstance(kind, Guard)]
        self.normals = {k: [number(c) for c in self.kinds[k].normal] for k in self.guards}
        self.levels = {k: number(self.kinds[k].level) for k in self.guards}
        self.ticks = {k: 0 for k, kind in enumerate(self.kinds) if isinstance(kind, Timer)}
        self.t, self.t_end = number(0), number(system.t_end)
        self.x = [number(value) for value in system.x0]
        self.mode = 0
        self.events = []
        self.slopes = {}
        """Guards crossed at the present instant, by no jump changed since, with the slope at the crossing."""
        self.exact = set(range(len(self.x))) if system.dyadic else set()
        """Components of x that a run in floats holds without rounding."""

    # Values at an instant.

    def u(self):
        """The input, continuous from the right."""
        reached = [value for t, value in self.system.u if self.number(t) <= self.t + self.number(SAME)]
        return self.number(reached[-1]) if reached else self.number(0)

    def margin(self, k):
        kind = self.kinds[k]
        terms = [c * x for c, x in zip(self.normals[k], self.x, strict=True)]
        return sum(terms, self.number(kind.drift) * self.t + self.number(kind.feed) * self.u() - self.levels[k])

    def enabled(self, k):
        return self.kinds[k].mode in (None, self.mode)

    def time(self, k):
        return self.number(self.kinds[k].first) + self.ticks[k] * self.number(self.kinds[k].period)

    # Jumps.

    def due(self):
        """The first event due, in the order of declaration: rules 3 and 6."""
        due = [k for k in range(len(self.kinds)) if self.is_due(k)]
        return due[0] if due else None

    def is_due(self, k):
        if k in self.ticks:
            return self.time(k) <= self.t + self.number(SAME)
        if not self.enabled(k):
            return False
        if k in self.slopes:
            return True
        margin = self.margin(k)
        if abs(margin) > ZONE:
            return margin > 0
        support = {i for i, c in enumerate(self.normals[k]) if c}
        certain = self.system.dyadic and support <= self.exact and not self.kinds[k].drift
        if margin == 0 and certain:
            return True
        raise Undecidable(f"{self.kinds[k].name} at {float(margin)}")

    def jump(self, k):
        effect = self.system.events[k][1]
        slope = self.slopes.get(k, 1.0)
        for i, value in effect.assign.items():
            self.x[i] = self.number(value)
            if self.system.dyadic:
                self.exact.add(i)
        for i, value in effect.shift.items():
            self.x[i] += self.number(value)
        if effect.mode is not None:
            self.mode = effect.mode
        if k in self.ticks:
            self.ticks[k] += 1
        else:
            self.levels[k] += self.number(effect.lift)
        changed = {i for i in (*effect.assign, *effect.shift)}
        lifted = {k} if effect.lift else set()
        self.slopes = {
            g: slope
            for g, slope in self.slopes.items()
            if self.enabled(g) and g not in lifted and not any(self.normals[g][i] for i in changed)
        }
        self.events.append(Event(self.kinds[k].name, self.t, tuple(self.x), self.mode, slope))

    # Flow.

    def flow(self):
        """Flow to the next instant at which anything happens: rules 3, 4 and 5."""
        mode, u = self.system.modes[self.mode], self.u()
        path = self.system.flow(self.x, mode, u)
        stops = [self.time(k) for k in self.ticks] + [self.number(t) for t, _ in self.system.u]
        known = [t for t in stops if t - self.t > SAME] + [self.t_end]
        rises = {}
        for k in filter(self.enabled, self.guards):
            rate = self.number(self.kinds[k].drift)
            rise = path.first_rise(self.normals[k], rate, self.margin(k), self.reach(known))
            if rise is not None:
                rises[k] = (self.t + rise[0], rise[1])
        candidates = known + [t for t, _ in rises.values()]
        first = min(candidates)
        if first - self.t < APART or any(SAME < t - first < APART for t in candidates):
            raise Undecidable(f"two instants near {float(first)}")
        # A known time is exact, a crossing at it is rounded.
        at = next((t for t in known if t - first <= SAME), first)
        self.x = list(path.at(at - self.t))
        self.t = at
        self.exact = set()
        self.slopes = {k: slope for k, (t, slope) in rises.items() if t - first <= SAME}
        if any(self.kinds[k].feed for k in self.slopes) and self.u() != u:
            raise Undecidable("a guard on the input is crossed where the input jumps")

    def reach(self, known):
        """How far crossings need to be looked for."""
        return min(known) - self.t + self.number(2 * APART)
