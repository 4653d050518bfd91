"""Small automata whose runs are known in closed form, for the tests of exported FMUs."""

import numpy as np

import hybrid_model as hm

NEVER = 1e9


class Ramps(hm.HybridAutomaton):
    """Two ramps with limits and a timer; `order` spells which came first: a is 1, b is 2, the timer 3.

    A ramp that reaches its limit starts anew at zero.
    """

    a = hm.State(0.0, output=True)
    b = hm.State(0.0, output=True)
    rate_a = hm.Parameter(1.0)
    rate_b = hm.Parameter(1.0)
    limit_a = hm.Parameter(NEVER)
    limit_b = hm.Parameter(NEVER)
    first = hm.Parameter(NEVER)
    period = hm.Parameter(NEVER)
    rounds = hm.DiscreteState(0, integer=True, output=True)
    order = hm.DiscreteState(0.0, output=True)
    count_a = hm.DiscreteState(0, integer=True, output=True)
    count_b = hm.DiscreteState(0, integer=True, output=True)
    ticks_a = hm.Clock("a")
    ticks_b = hm.Clock("b")
    ticks_timer = hm.Clock("timer")
    also_ticks_a = hm.Clock("a")

    def flow_map(self, s):
        return {"a": s.rate_a, "b": s.rate_b}

    transitions = (
        hm.Jump(
            "a",
            lambda self, s: s.a - s.limit_a,
            lambda self, s: {"a": 0.0, "count_a": s.count_a + 1, "order": 10 * s.order + 1},
        ),
        hm.TimeEvent(
            "timer",
            lambda self, s: s.first + s.rounds * s.period,
            lambda self, s: {"rounds": s.rounds + 1, "order": 10 * s.order + 3},
        ),
        hm.Jump(
            "b",
            lambda self, s: s.b - s.limit_b,
            lambda self, s: {"b": 0.0, "count_b": s.count_b + 1, "order": 10 * s.order + 2},
        ),
    )


class Hill(hm.HybridAutomaton):
    """A margin of time that rises above zero between `begin` and `end`, and falls again; counted when it rises."""

    x = hm.State(0.0, output=True)
    begin = hm.Parameter(0.4)
    end = hm.Parameter(0.6)
    count = hm.DiscreteState(0, integer=True, output=True)
    seen = hm.DiscreteState(-1.0, output=True)
    ticks = hm.Clock("jump")

    def flow_map(self, s):
        return {"x": 1.0}

    def jump_set(self, s):
        # Once seen it is over, so that the jump leaves its set.
        return hm.least(-(s.x - s.begin) * (s.x - s.end), 0.5 - s.count)

    def jump_map(self, s):
        return {"count": s.count + 1, "seen": s.x}


class Swing(hm.HybridAutomaton):
    """A way whose speed swings with time and is another one from a hidden time on, and the way's own integral.

    At the limit the way starts anew.
    """

    way = hm.State(0.0, output=True)
    area = hm.State(0.2, output=True)
    limit = hm.Parameter(1.0)
    hidden = hm.Parameter(0.9)
    speed = hm.DiscreteState(4.0)
    count = hm.DiscreteState(0, integer=True, output=True)

    def flow_map(self, s):
        return {"area": s.way, "way": s.speed * np.sin(5.0 * s.t) ** 2}

    transitions = (
        hm.TimeEvent(
            "change",
            lambda self, s: np.where(s.speed > 3.0, s.hidden, np.inf),
            lambda self, s: {"speed": 2.5},
            internal=True,
        ),
        hm.Jump("limit", lambda self, s: s.way - s.limit, lambda self, s: {"way": 0.0, "count": s.count + 1}),
    )


class Cascade(hm.HybridAutomaton):
    """At every whole second `links` jumps in a row at one instant, by three jumps in turn."""

    x = hm.State(0.0, output=True)
    links = hm.Parameter(4.0)
    left = hm.DiscreteState(0.0, output=True)
    total = hm.DiscreteState(0, integer=True, output=True)
    order = hm.DiscreteState(0.0, output=True)
    ticks_start = hm.Clock("start")
    ticks_even = hm.Clock("even")
    ticks_odd = hm.Clock("odd")

    def flow_map(self, s):
        return {"x": 1.0}

    transitions = (
        hm.Jump(
            "even",
            lambda self, s: hm.least(s.left - 0.5, 0.5 - np.mod(s.left, 2.0)),
            lambda self, s: {"left": s.left - 1, "total": s.total + 1, "order": 10 * s.order + 2},
        ),
        hm.Jump(
            "odd",
            lambda self, s: hm.least(s.left - 0.5, np.mod(s.left, 2.0) - 0.5),
            lambda self, s: {"left": s.left - 1, "total": s.total + 1, "order": 10 * s.order + 3},
        ),
        hm.Jump(
            "start",
            lambda self, s: s.x - 1.0,
            lambda self, s: {"x": 0.0, "left": s.links, "order": 1.0},
        ),
    )


class Timers(hm.HybridAutomaton):
    """No continuous state: a visible timer, a hidden breakpoint with the same first time, and a guard on time."""

    period = hm.Parameter(0.25)
    hidden = hm.Parameter(0.25)
    alarm = hm.Parameter(1.1)
    command = hm.Input(0.0, discrete=True)
    k = hm.DiscreteState(0, integer=True, output=True)
    mode = hm.DiscreteState(0, integer=True, output=True)
    rung = hm.DiscreteState(0, integer=True, output=True)
    obeyed = hm.DiscreteState(0.0, output=True)
    saw = hm.DiscreteState(-1.0, output=True)
    now = hm.Output()
    ticks = hm.Clock("tick")
    rings = hm.Clock("alarm")
    obeys = hm.Clock("obey")

    def outputs(self, s):
        return {"now": s.t + s.command}

    transitions = (
        hm.TimeEvent(
            "tick",
            lambda self, s: s.period * (s.k + 1),
            lambda self, s: {"k": s.k + 1, "saw": s.mode},
        ),
        hm.TimeEvent(
            "switch",
            lambda self, s: s.hidden * (s.mode + 1),
            lambda self, s: {"mode": s.mode + 1},
            internal=True,
        ),
        hm.Jump("alarm", lambda self, s: hm.least(s.t - s.alarm, 0.5 - s.rung), lambda self, s: {"rung": 1}),
        hm.Jump("obey", lambda self, s: np.abs(s.command - s.obeyed) - 0.5, lambda self, s: {"obeyed": s.command}),
    )


class FlowFirst(hm.HybridAutomaton):
    """Flows while 0 <= x <= 1 although a jump is enabled everywhere above one half: turns at 1, not before."""

    x = hm.State(0.0, output=True)
    direction = hm.DiscreteState(1.0, output=True)
    turns = hm.DiscreteState(0, integer=True, output=True)
    rate = hm.Parameter(1.0)
    priority = hm.Priority.FLOW
    ticks = hm.Clock("jump")

    def flow_map(self, s):
        return {"x": s.rate * s.direction}

    def flow_set(self, s):
        return hm.least(s.x, 1.0 - s.x)

    def jump_set(self, s):
        return np.abs(s.x - 0.5)

    def jump_map(self, s):
        return {"x": np.clip(s.x, 0.0, 1.0), "direction": -s.direction, "turns": s.turns + 1}


class PatientBall(hm.HybridAutomaton):
    """A ball with flow priority: flow set and jump set share the floor as their border."""

    h = hm.State(1.0, output=True)
    v = hm.State(0.0, output=True)
    priority = hm.Priority.FLOW

    def flow_map(self, s):
        return {"h": s.v, "v": -9.81}

    def flow_set(self, s):
        return s.h

    def jump_set(self, s):
        return hm.least(-s.h, -s.v)

    def jump_map(self, s):
        return {"h": 0.0, "v": -0.8 * s.v}


class Mix(hm.HybridAutomaton):
    """Everything at once, for random parameters: two driven states, two guards, a timer, a breakpoint, an input.

    The guards rise where they are crossed as long as `drive` exceeds what the decay and the waves take away.
    """

    x = hm.State([0.0, 0.3], output=True)
    drive = hm.Parameter([2.0, 1.5])
    decay = hm.Parameter([0.3, 0.2])
    wave = hm.Parameter([0.2, 0.3])
    speed = hm.Parameter([3.0, 7.0])
    limit = hm.Parameter([1.0, 0.8])
    keep = hm.Parameter([0.1, -0.3])
    period = hm.Parameter(0.45)
    dwell = hm.Parameter(0.3)
    push = hm.Input(0.0, discrete=True)
    count = hm.DiscreteState([0, 0], integer=True, output=True)
    rounds = hm.DiscreteState(0, integer=True, output=True)
    segment = hm.DiscreteState(0, integer=True, internal=True)
    total = hm.Output()
    first_ticks = hm.Clock("first")
    second_ticks = hm.Clock("second")
    timer_ticks = hm.Clock("timer")

    def flow_map(self, s):
        strong = 1.0 + 0.5 * np.mod(s.segment, 2)
        return {"x": strong * (s.drive + s.push) - s.decay * s.x + s.wave * np.sin(s.speed * s.t)}

    def outputs(self, s):
        return {"total": s.x[0] * s.x[1] + s.push + s.t}

    transitions = (
        hm.Jump(
            "first",
            lambda self, s: s.x[0] - s.limit[0],
            lambda self, s: {
                "x": np.stack([s.keep[0] * s.x[0], 0.5 * s.x[1]]),
                "count": np.stack([s.count[0] + 1, s.count[1]]),
            },
        ),
        hm.TimeEvent(
            "timer",
            lambda self, s: s.period * (s.rounds + 1),
            lambda self, s: {"rounds": s.rounds + 1, "x": np.stack([s.x[0], s.x[1] - 0.1])},
        ),
        hm.TimeEvent(
            "switch",
            lambda self, s: s.dwell * (s.segment + 1),
            lambda self, s: {"segment": s.segment + 1},
            internal=True,
        ),
        hm.Jump(
            "second",
            lambda self, s: s.x[1] - s.limit[1],
            lambda self, s: {
                "x": np.stack([s.x[0], s.keep[1] * s.x[1]]),
                "count": np.stack([s.count[0], s.count[1] + 1]),
            },
        ),
    )


def random_automaton(seed):
    """An automaton of random structure: up to three coupled states with guards, up to two timers, some hidden.

    Each state rises through its limit at a rate of at least 0.2, so every crossing is a clear one.
    """
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(0, 4)), int(rng.integers(1, 3))
    limit, decay, keep = rng.uniform(0.6, 1.4, n), rng.uniform(0.0, 0.5, n), rng.uniform(-0.4, 0.3, n)
    coupling, wave, speed = rng.uniform(-0.2, 0.2, (n, n)), rng.uniform(0.0, 0.3, n), rng.uniform(1.0, 9.0, n)
    drive = 0.2 + decay * limit + np.abs(coupling).sum(axis=1) + wave + rng.uniform(0.2, 2.0, n)
    period, hidden = rng.uniform(0.15, 0.6, m), rng.random(m) < 0.4
    hidden[0] &= n > 0  # something must be seen
    declared = {}
    for i in range(n):
        declared[f"x{i}"] = hm.State(float(rng.uniform(-0.3, 0.4)), output=True)
        declared[f"count{i}"] = hm.DiscreteState(0, integer=True, output=True)
        declared[f"ticks{i}"] = hm.Clock(f"guard{i}")
    for k in range(m):
        declared[f"rounds{k}"] = hm.DiscreteState(0, integer=True, output=True)
        if not hidden[k]:
            declared[f"strikes{k}"] = hm.Clock(f"timer{k}")

    def flow_map(self, s):
        strong = 1.0 + 0.5 * np.mod(s.rounds0, 2)
        return {
            f"x{i}": strong * drive[i]
            - decay[i] * s[f"x{i}"]
            + sum(coupling[i, j] * np.sin(s[f"x{j}"]) for j in range(n))
            + wave[i] * np.sin(speed[i] * s.t)
            for i in range(n)
        }

    def guard(i):
        def jump_map(self, s):
            new = {f"x{i}": keep[i] * s[f"x{i}"], f"count{i}": s[f"count{i}"] + 1}
            return new if n < 2 else new | {f"x{(i + 1) % n}": 0.7 * s[f"x{(i + 1) % n}"]}

        return hm.Jump(f"guard{i}", lambda self, s: s[f"x{i}"] - limit[i], jump_map)

    def timer(k):
        def jump_map(self, s):
            new = {f"rounds{k}": s[f"rounds{k}"] + 1}
            return new if hidden[k] or n == 0 else new | {"x0": s.x0 - 0.1}

        return hm.TimeEvent(f"timer{k}", lambda self, s: period[k] * (s[f"rounds{k}"] + 1), jump_map, bool(hidden[k]))

    transitions = [*map(guard, range(n)), *map(timer, range(m))]
    rng.shuffle(transitions)
    members = {**declared, "flow_map": flow_map, "transitions": tuple(transitions)}
    return type(f"Random{seed}", (hm.HybridAutomaton,), members)()
