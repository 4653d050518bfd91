"""Runs of a model in the C harness, by Co-Simulation and by Model Exchange, and the Python run that they must equal."""

import itertools
import re
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from c_harness import NONE, Instance
from executions import values_of

import hybrid_model as hm
from fmu.describe.variables import Bank, FmiType
from hybrid_model.declare.transitions import Trigger
from hybrid_model.native.trace import trace

STATE_TOLERANCE = 1e-8  # the project's limit for states
TIME_TOLERANCE = 1e-7  # and for times of events
JUMP = re.compile(r"'([^']*)' jumps at t = (\S+)\.$")


@dataclass(frozen=True)
class Witness:
    """A model and the run that it is judged by: `n` equal steps to `t_end`; changes are (t, input, value)."""

    automaton: hm.Automaton
    t_end: float
    n: int = 20
    changes: tuple = field(default=())

    def points(self):
        inner = {self.t_end * k / self.n for k in range(self.n + 1)}
        return sorted(inner | {t for t, _, _ in self.changes})


class Seen(NamedTuple):
    """(name, time) of each visible jump in order, and the values at the points by name."""

    jumps: list
    samples: dict


def watched(harness):
    """Names of the scalars that the Python run has as well."""
    banks, types = (Bank.STATE, Bank.OUTPUT, Bank.DISCRETE), (FmiType.FLOAT64, FmiType.INT32)
    return [v.name for v in harness.variables if v.bank in banks and v.type in types and v.size == 1]


def python_run(witness):
    """The arc of `simulate`, another solver with another location of events."""
    inputs = {}
    for name in {name for _, name, _ in witness.changes}:
        steps = [(t, v) for t, other, v in witness.changes if other == name]
        [variable] = [v for v in witness.automaton.variables if v.name == name]
        start = float(variable.start)
        value = lambda t, steps=steps, start=start: [start, *(v for at, v in steps if at <= t)][-1]  # noqa: E731
        inputs[name] = hm.Signal(value, [t for t, _ in steps])
    return hm.simulate(witness.automaton, witness.t_end, **({"inputs": inputs} if inputs else {}))


def agree(witness, arc, seen, *, times=True):
    """Insist that a run is the Python run."""
    hidden = {jump.name for jump in witness.automaton.jumps if jump.internal}
    jumps = [(jump.name, jump.t) for jump in arc.jumps if jump.name not in hidden]
    assert [name for name, _ in seen.jumps] == [name for name, _ in jumps]
    if times:
        np.testing.assert_allclose(
            [t for _, t in seen.jumps], [t for _, t in jumps], rtol=0, atol=TIME_TOLERANCE, err_msg="times of jumps"
        )
    # At the instant of a jump both sides are right: rounding decides on which side of it the point lies.
    instants = np.array([jump.t for jump in arc.jumps])
    changed = {t for t, _, _ in witness.changes}
    kept = [t for t in seen.samples if t not in changed and not (np.abs(instants - t) < 1e-9).any()]
    assert 2 * len(kept) >= len(seen.samples)
    for name in seen.samples[0.0]:
        for t in kept:
            value = values_of(arc, name, t)
            assert abs(seen.samples[t][name] - value) <= STATE_TOLERANCE, (name, t, seen.samples[t][name], value)


def sample(instance, names):
    return {name: instance.get(name) for name in names}


def only(messages):
    """The single message that there is."""
    assert len(messages) == 1, messages
    return messages[0]


def jumps_of(instance):
    return [(found[1], float(found[2])) for found in map(JUMP.search, instance.log()) if found]


def co_simulation(harness, witness, *, slot=0, events=True, early=True, update=0, stop_at_events=False, stop=True):
    """By steps, in the events of FMI 3 or, with the option that stops at events, of FMI 2."""
    points, names = witness.points(), watched(harness)
    instance = Instance(harness, slot, events=events, early=early, update=update)
    instance.begin(0.0, witness.t_end if stop else NONE)
    if stop_at_events:
        instance.set("stop_at_events", 1.0)
    instance.do("plain", "end")
    seen = Seen([], {0.0: sample(instance, names)})
    if events:
        instance.iterate()
    set_all(instance, witness, 0.0)
    for t, point in itertools.pairwise(points):
        step_to(instance, t, point, events)
        seen.samples[point] = sample(instance, names)
        if set_all(instance, witness, point, events):
            seen.samples[point] = sample(instance, names)
    seen.jumps.extend(jumps_of(instance))
    instance.do("plain", "terminate")
    instance.free()
    return seen


def set_all(instance, witness, t, events=False):
    """Sets the inputs that change at t, in Event Mode where there is one; whether there were any."""
    here = [(name, value) for at, name, value in witness.changes if at == t]
    if here and events:
        instance.do("plain", "event")
    for name, value in here:
        instance.set(name, value)
    if here and events:
        instance.iterate()
    return bool(here)


def step_to(instance, t, point, events):
    """From a communication point to the next, through all events and early returns."""
    for _ in range(10000):
        event, terminate, early, time = instance.step(t, point - t)
        assert not terminate, instance.log()
        assert early == (time < t + (point - t)) or (not early and time == point)
        if event and events:
            instance.do("plain", "event")
            instance.iterate()
        if not early:
            return
        assert t <= time <= point
        t = time
    raise AssertionError(f"no progress beyond {t}")


class Exchange:
    """Integrates by the classical Runge-Kutta method and locates sign changes of the indicators by bisection.

    Exact for flows that are polynomials of time up to degree four, so for the witnesses that it is used with.
    """

    def __init__(self, harness, witness, slot=0):
        traced = trace(witness.automaton)
        self.instance = Instance(harness, slot, kind="me")
        self.witness = witness
        self.n = traced.flow.size1_out(0)
        guards = sum(jump.trigger is Trigger.STATE for jump in witness.automaton.jumps)
        self.n_indicators = guards + witness.automaton.has_flow_set
        self.t, self.next, self.x = 0.0, None, np.zeros(self.n)

    def put(self, t, x):
        self.instance.do("time", float(t))
        if self.n:
            self.instance.do("states", *map(float, x))

    def rate(self, t, x):
        self.put(t, x)
        return np.array(self.instance.vector("derivatives", self.n)) if self.n else np.zeros(0)

    def reach(self, h):
        t, x = self.t, self.x
        a = self.rate(t, x)
        b = self.rate(t + h / 2, x + h / 2 * a)
        c = self.rate(t + h / 2, x + h / 2 * b)
        d = self.rate(t + h, x + h * c)
        return x + h / 6 * (a + 2 * b + 2 * c + d)

    def signs(self, t, x):
        self.put(t, x)
        return [value >= 0.0 for value in self.instance.vector("indicators", self.n_indicators)]

    def settle(self):
        """Event Mode to its end; the state is read anew."""
        _, self.next = self.instance.iterate("continuous")
        self.read_states()

    def read_states(self):
        """What the integration goes on from."""
        self.x = np.array(self.instance.vector("states", self.n)) if self.n else self.x

    def advance(self, point):
        """To a point through all events on the way."""
        instance = self.instance
        while self.t < point:
            target = min(point, self.next) if self.next is not None else point
            due = self.next is not None and target == self.next
            before, h = self.signs(self.t, self.x), target - self.t
            crossed = self.signs(target, self.reach(h)) != before
            low, high = 0.0, h
            while crossed and high - low > 1e-13:
                middle = 0.5 * (low + high)
                if self.signs(self.t + middle, self.reach(middle)) != before:
                    high = middle
                else:
                    low = middle
            self.x = self.reach(high)
            self.t = target if high == h else self.t + high
            self.put(self.t, self.x)
            event, terminate = instance.do("completed")
            assert terminate == "0"
            if crossed or due or event == "1":
                instance.do("plain", "event")
                self.settle()


def agree_in_all_ways(witness, harness, fmi):
    """Each use of Co-Simulation that a version has gives the run of the automaton."""
    arc = python_run(witness)
    uses = [{"events": fmi == "3.0"}, {"events": False, "early": False, "stop": False}]
    if fmi == "2.0":
        uses += [{"events": False, "stop_at_events": True}]
    else:
        uses += [{"early": False}, {"update": 1}, {"events": False, "update": 2}]
    for use in uses:
        agree(witness, arc, co_simulation(harness, witness, **use))


def model_exchange(harness, witness, *, slot=0):
    """By an integrator of our own."""
    names, exchange = watched(harness), Exchange(harness, witness, slot)
    instance = exchange.instance
    instance.boot(0.0, witness.t_end)
    exchange.settle()
    seen = Seen([], {0.0: sample(instance, names)})
    for point in witness.points()[1:]:
        exchange.advance(point)
        seen.samples[point] = sample(instance, names)
    seen.jumps.extend(jumps_of(instance))
    instance.do("plain", "terminate")
    instance.free()
    return seen


MODES = ("instantiated", "configuration", "initialization", "event", "step", "continuous", "terminated")


def has_mode(mode, fmi, kind):
    """Whether an instance, with event mode where it can be had, comes into a mode."""
    missing = {"configuration": fmi == "2.0", "event": (fmi, kind) == ("2.0", "cs")}
    missing |= {"step": kind == "me", "continuous": kind == "cs"}
    return not missing.get(mode, False)


def go_to_mode(instance, mode, fmi):
    """From Instantiated to a mode that it has, by the shortest way."""
    running = "continuous" if instance.kind == "me" else "step"
    if mode == "configuration":
        instance.do("plain", "configure")
    if mode in ("initialization", "event", running, "terminated"):
        instance.begin()
    if mode in ("event", running, "terminated"):
        instance.do("plain", "end")
        in_event_mode = instance.kind == "me" or (fmi == "3.0" and instance.events)
        if mode == running and in_event_mode:
            instance.iterate(running)
    if mode == "terminated":
        instance.do("plain", "terminate")
