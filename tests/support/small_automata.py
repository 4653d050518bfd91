"""Automata of a line or two for the tests of the semantics: each shows one thing and has its answer in closed form."""

import hybrid_model as hm


class Timer(hm.HybridAutomaton):
    """Counts ticks at ``first + k period``, each computed from its index."""

    k = hm.DiscreteState(0, integer=True, output=True)
    first = hm.Parameter(0.0, unit="s")
    period = hm.Parameter(1.0, unit="s")

    def next_time(self, s):
        return s.first + s.k * s.period

    def tick(self, s):
        return {"k": s.k + 1}

    transitions = (hm.TimeEvent("tick", next_time, tick),)


class Ramp(hm.HybridAutomaton):
    """Rises at `rate`; each time it has moved by `threshold` from the value held, it holds the new value."""

    x = hm.State(0.0, output=True)
    held = hm.DiscreteState(computed=True, output=True)
    count = hm.DiscreteState(0, integer=True, output=True)
    rate = hm.Parameter(1.0)
    threshold = hm.Parameter(0.5)

    def start_map(self, s):
        return {"held": s.x}

    def flow_map(self, s):
        return {"x": s.rate}

    def moved(self, s):
        return abs(s.x - s.held) - s.threshold

    def hold(self, s):
        return {"held": s.x, "count": s.count + 1}

    transitions = (hm.Jump("moved", moved, hold),)


class Alarm(hm.HybridAutomaton):
    """Rings each time that its margin, a function of time alone, becomes zero or above; then waits for it to be below.

    ``Alarm.of(margin)`` makes one; the listening half is a mode of its own, so that each rise rings once.
    """

    rings = hm.DiscreteState(0, integer=True, output=True)
    armed = hm.DiscreteState(1, integer=True)
    x = hm.State(0.0)

    def margin(self, t):
        raise NotImplementedError

    def flow_map(self, s):
        return {"x": 1.0}

    def risen(self, s):
        return hm.least(self.margin(s.t), s.armed - 0.5)

    def fallen(self, s):
        return hm.least(-1e-12 - self.margin(s.t), 0.5 - s.armed)

    def ring(self, s):
        return {"rings": s.rings + 1, "armed": 0}

    def arm(self, s):
        return {"armed": 1}

    transitions = (hm.Jump("ring", risen, ring), hm.Jump("arm", fallen, arm))

    @classmethod
    def of(cls, margin):
        return type("Alarm", (cls,), {"margin": staticmethod(margin)})()


class Corridor(hm.HybridAutomaton):
    """Moves at speed 1 in a flow set up to `wall`, with a jump set from `door`; the jump goes back to `back`."""

    x = hm.State(0.0, output=True)
    wall = hm.Parameter(2.0)
    door = hm.Parameter(1.0)
    back = hm.Parameter(0.0)

    def flow_map(self, s):
        return {"x": 1.0}

    def flow_set(self, s):
        return s.wall - s.x

    def jump_set(self, s):
        return s.x - s.door

    def jump_map(self, s):
        return {"x": s.back}


class PatientCorridor(Corridor):
    """The same under flow priority."""

    priority = hm.Priority.FLOW


class Store(hm.HybridAutomaton):
    """Integrates an input."""

    x = hm.State(0.0, output=True)
    u = hm.Input(0.0)

    def flow_map(self, s):
        return {"x": s.u}


class Blinking(hm.HybridAutomaton):
    """Sends 1 and -1 in turn, each 0.25 s long."""

    sent = hm.DiscreteState(1.0, output=True)
    k = hm.DiscreteState(1, integer=True)

    def next_time(self, s):
        return 0.25 * s.k

    def turn(self, s):
        return {"sent": -s.sent, "k": s.k + 1}

    transitions = (hm.TimeEvent("turn", next_time, turn),)


class Listening(hm.HybridAutomaton):
    """Holds what it hears, which comes at communication points only, and follows it with a delay."""

    heard = hm.Input(0.0, discrete=True)
    gain = hm.Parameter(1.0)
    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": s.gain * (s.heard - s.x)}
