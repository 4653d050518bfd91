"""What must hold of runs in the C harness.  Each check takes `start(automaton, fmi)`, which gives a harness."""

import math

import numpy as np
from c_harness import VERSIONS, Instance, number
from c_runs import (
    STATE_TOLERANCE,
    TIME_TOLERANCE,
    Exchange,
    Witness,
    agree,
    agree_in_all_ways,
    jumps_of,
    model_exchange,
    only,
    python_run,
    sample,
    watched,
)
from c_witnesses import POLYNOMIAL, WITNESSES
from witnesses import Cascade, FlowFirst, Mix, Ramps, Timers

import hybrid_model as hm
from hybrid_model.models import BouncingBall


class Counts(hm.HybridAutomaton):
    """A saw and a timer that go on and on."""

    x = hm.State(0.0)
    teeth = hm.DiscreteState(0, integer=True)
    ticks = hm.DiscreteState(0, integer=True)

    def flow_map(self, s):
        return {"x": 1.0}

    transitions = (
        hm.Jump("tooth", lambda self, s: s.x - 0.0013, lambda self, s: {"x": 0.0, "teeth": s.teeth + 1}),
        hm.TimeEvent("tick", lambda self, s: 0.0011 * (s.ticks + 1), lambda self, s: {"ticks": s.ticks + 1}),
    )


class Bump(hm.HybridAutomaton):
    """A margin that is flat and negative but for a narrow place, where it rises above zero and falls again."""

    x = hm.State(0.0, output=True)
    count = hm.DiscreteState(0, integer=True, output=True)
    ticks = hm.Clock("jump")

    def flow_map(self, s):
        return {"x": 1.0}

    def jump_set(self, s):
        return hm.least(0.02**4 - (s.x - 1.13) ** 4, 0.5 - s.count)

    def jump_map(self, s):
        return {"count": s.count + 1}


class Humps(hm.HybridAutomaton):
    """A margin like an M, negative at its ends and in its middle, whose humps just reach above zero."""

    x = hm.State(0.0, output=True)
    count = hm.DiscreteState(0, integer=True, output=True)
    ticks = hm.Clock("jump")

    def flow_map(self, s):
        return {"x": 1.0}

    def jump_set(self, s):
        return hm.least(1e-8 - ((s.x - 1.0) ** 2 - 0.45) ** 2, 0.5 - s.count)

    def jump_map(self, s):
        return {"count": s.count + 1}


MORE = {
    # A guard that is zero at the start is enabled.
    "on guard": Witness(Ramps(a=1.0, limit_a=1.0, name="on_guard"), 1.5, 3),
    # 3 * 0.1 and 0.3 are one time: the tick comes first and sees the old mode.
    "rounded": Witness(Timers(period=0.1, hidden=0.3, name="rounded"), 1.05, 21),
    # More jumps than there may be at one instant, in guards and in timers.
    "many": Witness(Counts(), 1.5, 3),
    # Within the tolerance of each other: one instant, in the order of the table.
    "tie": Witness(Ramps(limit_a=0.5 + 4e-12, limit_b=0.5, first=0.5 + 6e-12, name="tie"), 0.9, 3),
    "guard tie": Witness(Ramps(limit_a=0.5 + 4e-12, limit_b=0.5, name="guard_tie"), 0.9, 3),
    "no tie": Witness(Ramps(limit_a=0.5 + 4e-11, limit_b=0.5, name="no_tie"), 0.9, 3),
    # No sample of a step sees it.
    "bump": Witness(Bump(), 2.0, 1),
    # The parabola through three samples lies below zero.
    "humps": Witness(Humps(), 2.0, 1),
}


def check_co_simulation(start):
    for witness in [*WITNESSES.values(), *MORE.values()]:
        for fmi in VERSIONS:
            agree_in_all_ways(witness, start(witness.automaton, fmi), fmi)


def state_of(instance):
    """The bytes of the present state."""
    instance.do("save", 0)
    instance.do("bytes", 0)
    return instance.harness.ask("showbytes")


def check_networks(start):
    """Parts run by themselves inside: events, announced times, views, saved states, and nothing changed by reading."""
    witness = WITNESSES["network"]
    for fmi in VERSIONS:
        agree_in_all_ways(witness, start(witness.automaton, fmi), fmi)
    harness = start(witness.automaton, "3.0")
    instance, names = Instance(harness), watched(harness)
    instance.boot(0.0, 1.1, **{"p1.push": 0.3})
    _, announced = instance.iterate()
    t, halved, saved = 0.0, [], None
    while t < 1.1:
        event, terminate, early, _ = instance.step(t, min(announced, 1.1) - t)
        assert (terminate, early) == (False, False)
        t = min(announced, 1.1)
        assert event == (t < 1.1), "announced for an event, and none is there"
        if not event:
            break
        instance.do("plain", "event")
        before, shown = state_of(instance), sample(instance, names)
        assert state_of(instance) == before
        again, _, changed, time = instance.update()
        if not again:
            # A look far ahead has made other steps of the solver.
            after = sample(instance, names)
            np.testing.assert_allclose([*after.values()], [*shown.values()], rtol=0, atol=1e-12)
        if changed:
            halved.append(t)
        while again:
            again, _, changed, time = instance.update()
            halved += [t] * changed
        instance.do("plain", "step")
        announced = time if time is not None else 1.1
        if saved is None and t > 0.5:
            saved = t, announced
            instance.do("save", 1)
            instance.do("bytes", 1)
            instance.do("parse", 1)
    # The only jumps that change a continuous state; four parts have them at once.
    np.testing.assert_allclose(halved, [0.37] * 4 + [0.74] * 4, rtol=0, atol=1e-12)
    final = instance.values()
    instance.do("load", 1)
    t, announced = saved
    while t < 1.1:
        event, *_ = instance.step(t, min(announced, 1.1) - t)
        t = min(announced, 1.1)
        if event:
            instance.do("plain", "event")
            _, announced = instance.iterate()
            announced = 1.1 if announced is None else announced
    assert instance.values() == final


def check_exchange(start):
    for name in POLYNOMIAL:
        witness = WITNESSES[name]
        alone = Witness(witness.automaton, witness.t_end, witness.n)
        for fmi in VERSIONS:
            harness = start(alone.automaton, fmi)
            agree(alone, python_run(alone), model_exchange(harness, alone))


def check_events_are_told(start):
    """A step says that there is an event if and only if there is one, and ends there where it may."""
    witness = WITNESSES["ramps"]
    times = sorted({jump.t for jump in python_run(witness).jumps})
    for fmi, early in (("3.0", True), ("3.0", False), ("2.0", True)):
        harness = start(witness.automaton, fmi)
        instance = Instance(harness, early=early)
        instance.begin()
        if fmi == "2.0":
            instance.set("stop_at_events", 1.0)
        instance.do("plain", "end")
        if fmi == "3.0":
            instance.iterate()
        t, seen = 0.0, []
        instance.log()
        while t < witness.t_end:
            target = min(t + 0.11, witness.t_end)
            event, terminate, returned, time = instance.step(t, target - t)
            inside = [at for at in times if t + 1e-9 < at <= target + 1e-12]
            assert not terminate
            assert event == bool(inside), (fmi, early, t, target, inside)
            assert returned == (early and event and time < target)
            if event and early:
                assert abs(time - inside[0]) < TIME_TOLERANCE
            if event and fmi == "3.0":
                instance.do("plain", "event")
                instance.iterate()
            if event:
                assert jumps_of(instance)
            t = time if returned else target
            seen += inside[:1] if early else inside
        assert len(seen) == len(times)
        instance.free()


def check_clocks_and_views(start):
    """In Event Mode the clocks of the next jump tick; after an update those of the one after it."""
    names = ("ticks_a", "ticks_b", "ticks_timer", "also_ticks_a")
    witness = WITNESSES["ramps"]
    harness = start(witness.automaton, "3.0")
    instance = Instance(harness)
    ticks = lambda: "".join("01"[instance.get(name) == 1.0] for name in names)  # noqa: E731
    instance.boot()
    assert ticks() == "0000"
    instance.iterate()
    _, _, early, _ = instance.step(0.0, 1.0)
    assert early
    assert ticks() == "0000"
    instance.do("plain", "event")
    found = []
    for _ in range(4):
        shown = instance.values(), ticks()
        again, _, changed, _ = instance.update()
        if shown[1] != "0000":
            # What was shown before the update is what it is afterwards, but for the jumps that follow.
            found.append((shown[1], changed, int(instance.get("order")) if not again else None))
        if not again:
            break
    assert [(ticked, changed) for ticked, changed, _ in found] == [("1001", True), ("0010", False), ("0100", True)]
    assert instance.get("order") == 132.0
    assert ticks() == "0000"
    instance.do("plain", "step")
    # Without early return jumps inside the step have been taken when it ends; their clocks tick then.
    inside = Instance(harness, 1, early=False)
    inside.boot()
    inside.iterate()
    event, *_ = inside.step(0.0, 0.35)
    assert event
    assert inside.get("order") == 132.0
    inside.do("plain", "event")
    assert "".join("01"[inside.get(name) == 1.0] for name in names) == "1111"
    again, *_ = inside.update()
    assert not again
    assert inside.get("ticks_a") == 0.0
    inside.do("plain", "step")
    event, *_ = inside.step(0.35, 0.1)
    assert not event
    inside.do("plain", "event")
    assert inside.get("ticks_a") == 0.0
    inside.do("plain", "step")
    # Who does not ask in time learns nothing: the clocks are those of the last step.
    event, *_ = inside.step(0.45, 0.2)
    assert event
    event, *_ = inside.step(0.65, 0.01)
    assert not event
    inside.do("plain", "event")
    assert inside.get("ticks_a") == 0.0


def check_outcome_is_shown_in_event_mode(start):
    harness = start(BouncingBall(), "3.0")
    instance = Instance(harness)
    instance.boot()
    instance.iterate()
    instance.step(0.0, 1.0)
    falling = instance.get("v")
    instance.do("plain", "event")
    shown = instance.get("v")
    assert shown == -0.7 * falling
    again, _, changed, _ = instance.update()
    assert (again, changed, instance.get("v")) == (False, True, shown)


def check_cascades_are_one_visit(start):
    """Five links and the start: six updates in one visit of Event Mode, in Co-Simulation and in Model Exchange."""
    for fmi in VERSIONS:
        harness = start(Cascade(links=5.0), fmi)
        exchange = Exchange(harness, Witness(Cascade(links=5.0), 2.0, 2))
        exchange.instance.boot()
        exchange.settle()
        exchange.x = exchange.reach(1.0)
        exchange.put(1.0, exchange.x)
        exchange.instance.do("plain", "event")
        assert exchange.instance.iterate("continuous")[0] == 6
    instance = Instance(harness, 1)
    instance.boot()
    instance.iterate()
    instance.step(0.0, 2.0)
    instance.do("plain", "event")
    assert instance.iterate()[0] == 6


def check_crossings_at_the_ends(start):
    """A guard crossed a rounding behind the stop time counts, one crossed later does not; one at the start does."""
    for fmi, events in (("2.0", False), ("3.0", False), ("3.0", True)):
        for shift, count in ((-1e-12, 1), (0.0, 1), (1e-12, 1), (3e-8, 0)):
            harness = start(Ramps(limit_a=1.0 + shift, name=f"end{count}{shift:g}"), fmi)
            instance = Instance(harness, events=events, early=False)
            instance.boot(0.0, 1.0)
            if events:
                instance.iterate()
            event, *_ = instance.step(0.0, 1.0)
            if events and event:
                instance.do("plain", "event")
                instance.iterate()
            assert instance.get("count_a") == count, (fmi, events, shift)
        harness = start(MORE["on guard"].automaton, fmi)
        instance = Instance(harness, events=events)
        instance.boot()
        if events:
            instance.iterate()
        assert instance.get("count_a") == 1.0


def check_levels_are_saved(start):
    """A guard that counts as reached though it is just below zero does so after coming back, too."""
    harness = start(Ramps(limit_a=1.0 + 1e-12, name="level"), "3.0")
    instance = Instance(harness, early=False)
    instance.boot(0.0, 1.0)
    instance.iterate()
    instance.step(0.0, 1.0)
    instance.do("plain", "event")
    instance.do("save", 0)
    for _ in range(2):
        instance.iterate()
        assert instance.get("count_a") == 1.0
        instance.do("load", 0)
    other = Instance(harness, 1, early=False)
    other.boot(0.0, 1.0)
    other.do("load", 0)
    other.iterate()
    assert other.get("count_a") == 1.0


def check_arrival(start):
    """An importer that integrates stops a little short of the crossing, or of the time event: it counts."""
    for fmi in VERSIONS:
        harness = start(Ramps(limit_a=0.5, first=0.3, name="arrival"), fmi)
        exchange = Exchange(harness, Witness(Ramps(limit_a=0.5, first=0.3, name="arrival"), 1.0, 1))
        instance = exchange.instance
        instance.boot()
        exchange.settle()
        assert exchange.next == 0.3
        for t, name, before in ((0.3 - 2e-17, "order", 0.0), (0.5 - 5e-10, "count_a", 0.0)):
            x = exchange.x + (t - exchange.t)
            exchange.put(math.nextafter(t, 0.0), x)
            assert instance.get(name) == before
            instance.do("plain", "event")
            exchange.settle()
            exchange.t = t
            assert instance.get(name) > before, (fmi, t)
        # Much too early nothing happens.
        exchange.put(exchange.t + 0.2, exchange.x + 0.2)
        instance.do("plain", "event")
        exchange.settle()
        assert instance.get("count_a") == 1.0


def check_times_announced(start):
    """The next event time is that of the event, in Co-Simulation; in Model Exchange that of a kink as well."""
    arc = python_run(WITNESSES["ball"])
    harness = start(BouncingBall(), "3.0")
    instance = Instance(harness)
    instance.boot()
    clock = harness.places["next_event"]
    for jump in arc.jumps[:3]:
        t = instance.get("time")
        while True:
            again, _, _, announced = instance.update()
            if not again:
                break
        assert abs(announced - jump.t) < TIME_TOLERANCE
        qualifier, interval = instance.do("interval", clock)
        assert qualifier == "2"
        assert abs(number(interval) - (announced - t)) < 1e-15
        assert instance.do("interval", clock)[0] == "1"
        instance.do("plain", "step")
        event, _, early, time = instance.step(t, 2.0)
        assert (event, early, time) == (True, True, announced)
        instance.do("plain", "event")
    gated = WITNESSES["gated"].automaton
    # The gate with the shorter share is open for 20 % of a period of pi/2.
    first = 0.1 * math.pi
    for fmi in VERSIONS:
        exchange = Exchange(start(gated, fmi), WITNESSES["gated"])
        exchange.instance.boot()
        exchange.settle()
        assert exchange.next is not None
        assert abs(exchange.next - first) < 1e-15


class Pendulum(hm.HybridAutomaton):
    """Steps of a solver are long, and nothing cuts them short."""

    x = hm.State(2.0)
    v = hm.State(0.0)

    def flow_map(self, s):
        return {"x": s.v, "v": -np.sin(s.x)}


def check_tolerance_stays_small(start):
    """A coarse tolerance of the importer does not make event times coarse, nor states."""
    alone = Pendulum()
    instance = Instance(start(alone, "3.0"), events=False, early=False)
    instance.begin(0.0, 20.0, 1e-2)
    instance.do("plain", "end")
    instance.step(0.0, 20.0)
    np.testing.assert_allclose(instance.get("x"), hm.simulate(alone, 20.0).at("x", 20.0), rtol=0, atol=STATE_TOLERANCE)
    witness = WITNESSES["mix"]
    arc = python_run(Witness(witness.automaton, 2.0))
    for tolerance in (1e-2, 1e-6, 1e-16):
        harness = start(witness.automaton, "3.0")
        instance = Instance(harness, events=False, early=False)
        instance.begin(0.0, 2.0, tolerance)
        instance.do("plain", "end")
        instance.step(0.0, 2.0)
        np.testing.assert_allclose(
            [t for _, t in jumps_of(instance)],
            [jump.t for jump in arc.jumps if jump.name != "switch"],
            rtol=0,
            atol=TIME_TOLERANCE,
        )
        found = instance.get("x") if "x" in harness.places else [instance.get("x[1]"), instance.get("x[2]")]
        np.testing.assert_allclose(found, arc.at("x", 2.0), rtol=0, atol=STATE_TOLERANCE)


class Broken(hm.HybridAutomaton):
    """Jumps to a number that is none."""

    x = hm.State(0.0)
    nothing = hm.Parameter(0.0)

    def flow_map(self, s):
        return {"x": 1.0}

    def jump_set(self, s):
        return s.x - 0.5

    def jump_map(self, s):
        return {"x": s.x / s.nothing}


class Stuck(hm.HybridAutomaton):
    """Leaves its flow set where nothing jumps."""

    x = hm.State(0.0)

    def flow_map(self, s):
        return {"x": 1.0}

    def flow_set(self, s):
        return 0.5 - s.x

    def jump_set(self, s):
        return s.x - 5.0

    def jump_map(self, s):
        return {"x": 0.0}


class Restless(Stuck):
    """A jump that does not leave its set."""

    def flow_set(self, s):
        return 2.0 - s.x

    def jump_set(self, s):
        return s.x - 0.5

    def jump_map(self, s):
        return {"x": s.x}


class Chatter(hm.HybridAutomaton):
    """Waits, and then jumps at gaps of some hundred floats."""

    x = hm.State(0.0)
    wait = hm.DiscreteState(0.5)

    def flow_map(self, s):
        return {"x": 1.0}

    def jump_set(self, s):
        return s.x - s.wait

    def jump_map(self, s):
        return {"x": 0.0, "wait": 5e-14}


def check_ends(start):
    """Runs that cannot go on say so once, with the reason, where it happens; then steps are refused."""
    cases = [
        # sqrt(2/9.81) 1.7/0.3 = 2.5586340, and the last 1e-6 s are not run through.
        (BouncingBall(), 3.0, "accumulate", 2.558632, 2.5586336),
        (Broken(), 1.0, "states must stay finite numbers", 0.5, 0.5),
        (Stuck(), 1.0, "Blocked", 0.5, 0.5 + 1e-8),
        (Stuck(x=0.7, name="outside"), 1.0, "Blocked", 0.0, 0.0),
        (Restless(), 1.0, "1001 jumps", 0.5, 0.5),
        (Chatter(), 1.0, "Zeno: 100 jumps of 'jump' in 5e-12 s", 0.5, 0.5),
    ]
    for automaton, t_end, word, low, high in cases:
        for fmi in VERSIONS:
            harness = start(automaton, fmi)
            instance = Instance(harness, events=False, early=False, logging=False)
            instance.boot()
            _, terminate, _, time = instance.step(0.0, t_end)
            assert terminate, (automaton.name, fmi, time)
            message = only(instance.log())
            assert word in message, (automaton.name, message)
            # A run that cannot begin ends where it begins.
            assert low * (1.0 - 1e-9) <= time <= high * (1.0 + 1e-9), (automaton.name, time)
            assert instance.call("step", time, 0.1)[0] == 3
            assert "over" in instance.log()[0]
            instance.do("plain", "reset")


def check_flow_priority(start):
    witness = Witness(FlowFirst(rate=1.3, name="quick"), 5.0, 7)
    for fmi in VERSIONS:
        agree_in_all_ways(witness, start(witness.automaton, fmi), fmi)


def check_derivatives(start):
    """Along each known, forward: those of the Python maps by differences; backward: the same numbers transposed."""
    automaton = Mix()
    harness2, harness3 = start(automaton, "2.0"), start(automaton, "3.0")
    instance = Instance(harness2, kind="me")
    instance.boot(0.2)
    instance.iterate("continuous")
    # dx/dt = strong (drive + push) - decay x + wave sin(speed t); total = x1 x2 + push + t.
    x, t = [0.0, 0.3], 0.2
    decay, wave, speed = (0.3, 0.2), (0.2, 0.3), (3.0, 7.0)
    expected = {}
    for i in range(2):
        rate = f"der(x[{i + 1}])"
        for j in range(2):
            here = float(i == j)
            expected[rate, f"x[{j + 1}]"] = -decay[i] * here
            expected[rate, f"drive[{j + 1}]"] = here
            expected[rate, f"decay[{j + 1}]"] = -x[i] * here
            expected[rate, f"wave[{j + 1}]"] = math.sin(speed[i] * t) * here
        expected[rate, "push"] = 1.0
        expected[rate, "time"] = wave[i] * speed[i] * math.cos(speed[i] * t)
    expected |= {("total", "x[1]"): x[1], ("total", "x[2]"): x[0], ("total", "push"): 1.0, ("total", "time"): 1.0}
    expected |= {("x[1]", "x[1]"): 1.0, ("x[1]", "x[2]"): 0.0, ("x[2]", "push"): 0.0}
    for (unknown, known), value in expected.items():
        [found] = instance.do("partial", 1, harness2.places[unknown], harness2.places[known])
        assert abs(number(found) - value) < 1e-12, (unknown, known)
    vector = Instance(harness3)
    for mode in ("initialization", "step"):
        if mode == "initialization":
            vector.begin(0.2)
        else:
            vector.do("plain", "end")
            vector.iterate()
        places = harness3.places
        for unknown in ("der(x[1])", "der(x[2])", "total", "x[1]", "x[2]"):
            for known in ("x[1]", "x[2]", "drive", "decay", "push", "time"):
                forward, backward = (
                    np.array([*map(number, vector.do("partial", way, places[unknown], places[known]))])
                    for way in (1, 0)
                )
                # The harness's seeds are 1, 2, ...: weights' (J seed) is (J' weights)' seed.
                n, m = len(forward), len(backward)
                assert abs(np.arange(1, n + 1) @ forward - np.arange(1, m + 1) @ backward) < 1e-12, (unknown, known)
        [forward] = vector.do("partial", 1, places["total"], places["push"])
        assert number(forward) == 1.0


def check_output_rates(start):
    """d(total)/dt along the flow against a difference of the outputs."""
    for fmi in VERSIONS:
        harness = start(Mix(), fmi)
        instance = Instance(harness, events=False, early=False)
        instance.boot()
        instance.step(0.0, 0.1)
        names = [v.name for v in harness.variables if v.bank.name == "OUTPUT"]
        rates = [*map(number, instance.do("rates"))]
        before, h = instance.get("total"), 1e-6
        instance.step(0.1, h)
        # The difference is of first order, with curvatures up to ten.
        assert abs(rates[names.index("total")] - (instance.get("total") - before) / h) < 1e-4


RUN_CHECKS = {name: function for name, function in list(globals().items()) if name.startswith("check_")}
