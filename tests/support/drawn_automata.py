"""Random affine automata: how they are drawn, how they become automata of the package, how two runs are compared."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
from hypothesis import strategies as st
from oracles.affine_flows import Exponential, Line, Modal, Parabola, Rotation
from oracles.affine_run import Effect, Guard, Mode, System, Timer, exact_run

import hybrid_model as hm

MAX_EVENTS = 12
"""Events compared in one case; further events are cut off by the same number in both runs."""


# As an automaton of the package.


class Drawn(hm.HybridAutomaton):
    """A `System` in the terms of the package; `automaton` makes the subclass with its transitions."""

    n, guards, timers = hm.Dimension(), hm.Dimension(), hm.Dimension()
    x = hm.State(shape="n")
    u = hm.Input(0.0)
    mode = hm.DiscreteState(0, integer=True)
    level = hm.DiscreteState(shape="guards")
    ticks = hm.DiscreteState(0, shape="timers", integer=True)

    def flow_map(self, s):
        matrix, offset, gain = self.flows[int(s.mode)]
        return {"x": matrix @ s.x + offset + gain * s.u}


def automaton(system):
    """Make the automaton of a system."""
    flows = [
        (np.array(mode.matrix, dtype=float), np.array(mode.offset, dtype=float), np.array(mode.gain, dtype=float))
        for mode in system.modes
    ]
    numbers = {Guard: 0, Timer: 0}
    transitions = []
    for kind, effect in system.events:
        transitions.append(_transition(kind, effect, numbers[type(kind)], len(system.x0)))
        numbers[type(kind)] += 1
    kind = type("Drawn", (Drawn,), {"flows": flows, "transitions": tuple(transitions)})
    levels = [float(kind.level) for kind, _ in system.events if isinstance(kind, Guard)]
    return kind(
        n=len(system.x0), guards=numbers[Guard], timers=numbers[Timer], x=[float(v) for v in system.x0], level=levels
    )


def _transition(kind, effect, k, n):
    kept = np.array([0.0 if i in effect.assign else 1.0 for i in range(n)])
    moved = np.array([float(effect.assign.get(i, 0)) + float(effect.shift.get(i, 0)) for i in range(n)])

    def jump_map(self, s):
        new = {"x": kept * s.x + moved}
        if effect.mode is not None:
            new["mode"] = effect.mode
        if isinstance(kind, Timer):
            new["ticks"] = s.ticks + (np.arange(s.ticks.size) == k)
        elif effect.lift:
            new["level"] = s.level + float(effect.lift) * (np.arange(s.level.size) == k)
        return new

    if isinstance(kind, Timer):
        first, period = float(kind.first), float(kind.period)
        return hm.TimeEvent(kind.name, lambda self, s: first + s.ticks[k] * period, jump_map)

    normal, drift, feed = np.array(kind.normal, dtype=float), float(kind.drift), float(kind.feed)

    def jump_set(self, s):
        margin = normal @ s.x + drift * s.t + feed * s.u - s.level[k]
        return margin if kind.mode is None else hm.least(margin, 0.5 - abs(s.mode - kind.mode))

    return hm.Jump(kind.name, jump_set, jump_map)


def run(system, max_events=MAX_EVENTS, solver=None):
    """Run a system with the package."""
    inputs = {}
    if system.u:
        times, values = np.array([float(t) for t, _ in system.u]), [0.0, *(float(v) for _, v in system.u)]
        inputs["u"] = hm.Signal(lambda t: values[int(np.searchsorted(times, t, side="right"))], list(times))
    guard = hm.ZenoGuard(max_jumps=max_events)
    return hm.simulate(automaton(system), float(system.t_end), inputs=inputs, zeno=guard, solver=solver)


def compare(system, *, time, state, max_events=MAX_EVENTS, solver=None):
    """Require the events of the exact run, in order, at its times, and its states; return the exact run.

    A time may differ by `time` and by the error of the state over the margin's slope, `state`/slope.
    """
    exact = exact_run(system, max_events)
    if exact.cut and not exact.events:
        return exact
    arc = run(system, len(exact.events) if exact.cut else max_events, solver)
    told = f"{system}\nexact {[(e.name, float(e.t)) for e in exact.events]}\nours {[(j.name, j.t) for j in arc.jumps]}"
    assert [jump.name for jump in arc.jumps] == [event.name for event in exact.events], told
    late = 0.0
    for jump, event in zip(arc.jumps, exact.events, strict=True):
        late = max(late, time + state / event.slope)
        assert abs(jump.t - float(event.t)) <= late, f"{jump.name} {jump.t - float(event.t)}\n{told}"
    assert abs(arc.t[-1] - float(exact.t)) <= late + time, told
    speed = max(np.abs(rates).max() for rates in (rate_bound(system, exact.x), [1.0]))
    assert np.allclose(arc.end.x, [float(v) for v in exact.x], rtol=0, atol=10 * state + speed * late), told
    assert int(arc.end.mode) == exact.mode, told
    return exact


def rate_bound(system, x):
    """Derivatives at x in every mode: what an error in time means for the state."""
    x = np.array([float(v) for v in x])
    return [np.array(m.matrix, dtype=float) @ x + np.array(m.offset, dtype=float) for m in system.modes]


# Draws.

DYADIC = [Fraction(k, 8) for k in range(-24, 25)]
ROUNDED = sorted({Fraction(k, d) for d in (3, 5, 7, 10) for k in range(-3 * d, 3 * d + 1)})
NO_DRIFT = st.just(0)
RATES = [Fraction(k, 4) for k in (-12, -8, -4, -3, -2, -1, 0, 1, 2, 3, 4, 8, 12)]


@st.composite
def effects(draw, numbers, n, modes, lifts):
    """What an event does: mostly one thing, seldom all."""
    assign = {i: draw(numbers) for i in draw(st.sets(st.integers(0, n - 1), max_size=1))}
    shift = {} if assign else {i: draw(numbers) for i in draw(st.sets(st.integers(0, n - 1), max_size=1))}
    mode = draw(st.none() | st.integers(0, modes - 1))
    return Effect(assign, shift, mode, draw(lifts))


@st.composite
def event_lists(draw, numbers, coefficients, n, modes, *, drifts=NO_DRIFT, max_guards=4):
    """Guards, some of them twins that are crossed at one instant, and timers, in a random order of declaration."""
    lifts = st.sampled_from([Fraction(k, 4) for k in (1, 2, 4, 8)])
    gates = st.none() | st.integers(0, modes - 1)
    guards = []
    for k in range(draw(st.integers(1, max_guards))):
        normal = [Fraction(0)] * n
        normal[draw(st.integers(0, n - 1))] = draw(coefficients)
        if n > 1 and draw(st.booleans()):
            normal[draw(st.integers(0, n - 1))] = draw(coefficients)
        feed = draw(st.sampled_from([0, 0, 0, Fraction(1, 2)]))
        guard = Guard(f"g{k}", tuple(normal), draw(numbers), draw(gates), draw(drifts), feed)
        if guards and draw(st.integers(0, 3)) == 0:
            # A twin of the first guard, scaled: crossed at the same instants, with another rounding.
            twin, by = guards[0][0], draw(st.sampled_from([1, 3, Fraction(1, 2)]))
            scaled = tuple(by * c for c in twin.normal)
            guard = replace(twin, name=f"g{k}", normal=scaled, level=by * twin.level, mode=guard.mode)
            guard = replace(guard, drift=by * twin.drift, feed=by * twin.feed)
        guards.append((guard, draw(effects(numbers, n, modes, lifts))))
    timers = [
        (
            Timer(f"t{k}", abs(draw(numbers)), Fraction(1, 4) + abs(draw(numbers))),
            draw(effects(numbers, n, modes, lifts)),
        )
        for k in range(draw(st.integers(0, 2)))
    ]
    return tuple(draw(st.permutations(guards + timers)))


@st.composite
def inputs(draw, numbers):
    """An input that is constant between up to three breakpoints."""
    times = sorted({abs(draw(numbers)) + Fraction(1, 8) for _ in range(draw(st.integers(0, 3)))})
    return tuple((t, draw(numbers)) for t in times)


def zeros(n):
    """A row of zeros."""
    return (Fraction(0),) * n


@st.composite
def piecewise_linear(draw):
    """x' constant in each mode: exact in rational numbers, and coincidences are frequent."""
    dyadic = draw(st.booleans())
    numbers = st.sampled_from(DYADIC if dyadic else ROUNDED)
    coefficients = st.sampled_from([Fraction(k, 2) for k in (-4, -2, -1, 1, 2, 4)])
    n, modes = draw(st.integers(1, 3)), draw(st.integers(1, 3))
    row = st.tuples(*[st.sampled_from(RATES)] * n)
    system = System(
        flow=Line,
        x0=draw(st.tuples(*[numbers] * n)),
        modes=tuple(Mode((zeros(n),) * n, draw(row), draw(row)) for _ in range(modes)),
        events=draw(event_lists(numbers, coefficients, n, modes, drifts=st.sampled_from([0, 0, 0, 1, -1]))),
        t_end=Fraction(5),
        u=draw(inputs(numbers)),
        dyadic=dyadic,
    )
    return draw(with_end_at_an_event(system))


@st.composite
def with_end_at_an_event(draw, system):
    """Let the run end at the very instant of an event, in half of the cases."""
    at_event, k = draw(st.booleans()), draw(st.integers(0, MAX_EVENTS - 1))
    return ending_at_event(system, k) if at_event else system


def ending_at_event(system, k):
    """End with the kth instant of events; 8 ulp behind a timer, so that its rounded time lies within the run."""
    found = [event for event in exact_run(system, MAX_EVENTS).events if event.t > 0]
    if not found:
        return system
    event = found[k % len(found)]
    timers = any(other.t == event.t and other.name.startswith("t") for other in found)
    return replace(system, t_end=Fraction(float(event.t) * (1 + 2e-15)) if timers else event.t)


@st.composite
def exponentials(draw):
    """x' = a x + b, scalar; a timer set to the instant of a crossing, now and then."""
    numbers = st.sampled_from(ROUNDED)
    slopes = st.sampled_from([Fraction(k, 4) for k in (-12, -8, -4, -2, -1, 0, 1, 2)])
    modes = draw(st.integers(1, 3))
    flows = tuple(Mode(((draw(slopes),),), (draw(numbers),), (draw(numbers),)) for _ in range(modes))
    events = draw(event_lists(numbers, st.sampled_from([Fraction(1), Fraction(-1), Fraction(2)]), 1, modes))
    system = System(Exponential, (draw(numbers),), flows, events, Fraction(4), draw(inputs(numbers)))
    return draw(with_coincidences(system))


@st.composite
def parabolas(draw):
    """p' = v, v' = b in each mode: guards on position, speed and both; two crossings in a step, and near misses."""
    numbers = st.sampled_from(ROUNDED)
    modes = draw(st.integers(1, 3))
    flows = tuple(
        Mode(((0, 1), (0, 0)), (0, draw(numbers)), (0, draw(st.sampled_from([0, 1, -1])))) for _ in range(modes)
    )
    coefficients = st.sampled_from([Fraction(1), Fraction(-1), Fraction(1, 2)])
    events = draw(event_lists(numbers, coefficients, 2, modes, drifts=st.sampled_from([0, 0, 1])))
    x0 = (draw(numbers), draw(numbers))
    system = System(Parabola, x0, flows, events, Fraction(4), draw(inputs(numbers)))
    return draw(with_coincidences(draw(with_near_miss(system))))


@st.composite
def with_near_miss(draw, system):
    """Put a first guard at the top of the first parabola, a little below it or above it."""
    (p, v), b = system.x0, system.modes[0].offset[1]
    if not b or v / b >= 0 or draw(st.booleans()):
        return system
    height = draw(st.sampled_from([-1, 1])) * Fraction(1, 10 ** draw(st.integers(2, 9)))
    side = 1 if b < 0 else -1
    top = side * (p - v * v / (2 * b))
    grazed = Guard("graze", (Fraction(side), Fraction(0)), top - height, mode=0)
    return replace(system, events=((grazed, Effect(lift=Fraction(1))), *system.events))


@st.composite
def rotations(draw):
    """Circles of up to 4 turns about centres that modes and inputs move."""
    numbers = st.sampled_from(ROUNDED)
    modes = draw(st.integers(1, 3))
    flows = []
    for _ in range(modes):
        omega = draw(st.sampled_from([-20, -7, -1, 1, 2, 5, 11, 20]))
        row = st.tuples(numbers, numbers)
        flows.append(Mode(((0, -omega), (omega, 0)), draw(row), draw(row)))
    coefficients = st.sampled_from([Fraction(1), Fraction(-1), Fraction(1, 2)])
    events = draw(event_lists(numbers, coefficients, 2, modes))
    system = System(
        Rotation, (draw(numbers), draw(numbers)), tuple(flows), events, Fraction(3, 2), draw(inputs(numbers))
    )
    return draw(with_coincidences(system))


@st.composite
def modal_systems(draw):
    """x' = A x + b, n from 2 to 4, with real or complex eigenvalues away from zero and from each other."""
    numbers = st.sampled_from(ROUNDED)
    n, modes = draw(st.integers(2, 4)), draw(st.integers(1, 3))
    flows = []
    for _ in range(modes):
        row = st.tuples(*[numbers] * n)
        flows.append(Mode(_diagonalisable(draw, n), draw(row), draw(row)))
    coefficients = st.sampled_from([Fraction(1), Fraction(-1), Fraction(1, 2)])
    events = draw(event_lists(numbers, coefficients, n, modes, drifts=st.sampled_from([0, 0, 1])))
    system = System(Modal, draw(st.tuples(*[numbers] * n)), tuple(flows), events, Fraction(3, 2), draw(inputs(numbers)))
    return draw(with_coincidences(system))


def _diagonalisable(draw, n):
    """Blocks of one or two eigenvalues on the diagonal, turned by two plane rotations, so cond(V) stays near 1."""
    matrix = np.zeros((n, n))
    real = draw(st.permutations([-4.0, -2.0, -1.0, -0.5, 0.25]))
    k = 0
    while k < n:
        if k + 1 < n and draw(st.booleans()):
            decay, omega = real[k], draw(st.sampled_from([1.0, 3.0, 8.0])) + 0.1 * k
            matrix[k : k + 2, k : k + 2] = [[decay, -omega], [omega, decay]]
            k += 1
        else:
            matrix[k, k] = real[k]
        k += 1
    for i in range(n - 1):
        angle = draw(st.sampled_from([0.0, 0.5, 1.0, 2.0]))
        turn = np.eye(n)
        turn[i : i + 2, i : i + 2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        matrix = turn @ matrix @ turn.T
    return tuple(tuple(row) for row in matrix.tolist())


@st.composite
def with_coincidences(draw, system):
    """Put a timer, or the end of the run, at the instant of an event: equal up to the rounding of a float."""
    what, k = draw(st.sampled_from(["none", "timer", "end", "input"])), draw(st.integers(0, MAX_EVENTS - 1))
    events = exact_run(system, MAX_EVENTS).events
    times = sorted({event.t for event in events if event.t > 0})
    if what == "none" or not times:
        return system
    if what == "end":
        return ending_at_event(system, k)
    at = float(times[k % len(times)])
    if what == "input" and all(abs(float(t) - at) > 1e-6 for t, _ in system.u):
        return replace(system, u=tuple(sorted({**dict(system.u), Fraction(at): draw(st.integers(-1, 1))}.items())))
    timer = Timer("coincident", Fraction(at), Fraction(100)), Effect(mode=draw(st.integers(0, len(system.modes) - 1)))
    place = draw(st.integers(0, len(system.events)))
    return replace(system, events=(*system.events[:place], timer, *system.events[place:]))
