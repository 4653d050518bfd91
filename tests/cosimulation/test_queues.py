"""The event-exact master with its queue in C and in Python: the same events, ticks, rows and ends; which one ran."""

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.errors import CosimError
from cosim.masters import queues, run_event_exact
from cosim.result import Ended
from cosim.sources import Linear
from cosim.system import System
from hybrid_model.models import BouncingBall


class Tank(hm.HybridAutomaton):
    """Fills, and empties when it is full; it tells how often, and a shout from another one empties it as well."""

    inflow = hm.Input(1.0, discrete=True)
    heard = hm.Input(0.0, discrete=True)
    size = hm.Parameter(1.0, tunable=True)
    level = hm.State(0.0, output=True)
    known = hm.DiscreteState(0.0)
    emptied = hm.DiscreteState(0.0, output=True)
    spills = hm.Clock("empty")

    def flow_map(self, s):
        return {"level": s.inflow}

    def empties(self, s):
        return {"level": 0.0, "emptied": s.emptied + 1.0}

    transitions = (
        hm.Jump("empty", lambda self, s: s.level - s.size, empties),
        hm.Jump(
            "shout",
            lambda self, s: abs(s.heard - s.known) - 0.5,
            lambda self, s: {"known": s.heard, "level": 0.5 * s.level},
        ),
    )


WIRES = {"b.heard": "a.emptied", "c.heard": "b.emptied", "a.heard": "c.emptied"}
PUMPS = {
    "a.inflow": hm.Signal(lambda t: 1.0 if t < 2.07 else 2.5, [2.07]),
    "c.size": hm.Signal(lambda t: 1.0 if t < 3.1 else 0.2, [3.1, 4.0]),
    "b.inflow": 0.75,
}


def tanks(engine, wires=WIRES, **sizes):
    slaves = [AutomatonSlave(name, Tank(size=sizes.get(name, 1.0)), engine=engine) for name in "abc"]
    return System(slaves, wires)


def ended(result):
    return result.ended, result.message, [event.block for event in result.events]


@pytest.mark.parametrize("interval", [None, 0.23])
@pytest.mark.parametrize("record_events", [False, True])
def test_both_queues_give_the_same(interval, record_events):
    """Three that empty together at 1 s and then apart, pumps that change, and a size that makes one spill at once."""
    options = {"output_interval": interval, "record_events": record_events, "inputs": PUMPS}
    native, plain = (run_event_exact(tanks(engine), 6.0, **options) for engine in ("auto", "python"))
    assert native.engine == queues.NATIVE
    assert plain.engine == 'python: a runs in Python, since it was asked for (engine="python").'
    assert len(native.events) > 20
    assert ended(native) == ended(plain)
    assert [(tick.slave, tick.clock) for tick in native.ticks] == [(tick.slave, tick.clock) for tick in plain.ticks]
    for ours, theirs in ((native.events, plain.events), (native.ticks, plain.ticks)):
        assert [one.t for one in ours] == pytest.approx([one.t for one in theirs], rel=0.0, abs=1e-12)
    assert native.times == pytest.approx(plain.times, rel=0.0, abs=1e-12)
    for name, values in plain.signals.items():
        assert native.signals[name] == pytest.approx(values, rel=0.0, abs=1e-11), name
    assert native.final == pytest.approx(plain.final, rel=0.0, abs=1e-11)


def test_all_events_of_one_instant_have_one_time():
    result = run_event_exact(tanks("auto", wires={}, b=0.1, c=0.3), 0.95)
    assert [event.t for event in result.events if event.block == "c"] == pytest.approx([0.3, 0.6, 0.9])
    for event in result.events:
        if event.block == "c":
            assert event.t in result.event_times("b")


def test_an_accumulation_ends_both():
    parts = {"calm": Tank(), "ball": BouncingBall()}
    both = [
        run_event_exact(
            System([AutomatonSlave(name, each, engine=engine) for name, each in parts.items()], {}),
            3.0,
            output_interval=0.5,
        )
        for engine in ("auto", "python")
    ]
    assert both[0].engine == queues.NATIVE
    assert both[0].ended is both[1].ended is Ended.ZENO
    assert both[0].message == both[1].message
    assert both[0].t == pytest.approx(both[1].t, abs=1e-12)


class Echo(hm.HybridAutomaton):
    """Answers whatever it hears with one more."""

    heard = hm.Input(0.0, discrete=True)
    known = hm.DiscreteState(0.0)
    said = hm.DiscreteState(1.0, output=True)
    transitions = (
        hm.Jump(
            "answer", lambda self, s: s.heard - s.known - 0.5, lambda self, s: {"known": s.heard, "said": s.heard + 1.0}
        ),
    )


@pytest.mark.parametrize("engine", ["auto", "python"])
def test_answers_without_end_end_the_run_and_name_a_slave(engine):
    slaves = [AutomatonSlave(name, Echo(), engine=engine) for name in "ab"]
    system = System(slaves, {"a.heard": "b.said", "b.heard": "a.said"})
    result = run_event_exact(system, 1.0)
    assert result.ended is Ended.ZENO
    assert result.message.startswith(("a: Echo", "b: Echo"))


class Stiff(hm.HybridAutomaton):
    """Follows a slow wave on a fast time scale."""

    x = hm.State(1.0, output=True)
    y = hm.State(0.0)
    crossed = hm.DiscreteState(0.0, output=True)

    def flow_map(self, s):
        return {"x": -1e6 * (s.x - np.cos(s.t)), "y": s.x}

    transitions = (
        hm.Jump("cross", lambda self, s: s.y - 0.3 * (1.0 + s.crossed), lambda self, s: {"crossed": s.crossed + 1.0}),
    )


def test_a_stiff_slave_is_run_again_and_each_row_is_told_once():
    told = []
    system = System([AutomatonSlave("calm", Tank()), AutomatonSlave("stiff", Stiff())], {})
    result = run_event_exact(system, 1.4, output_interval=0.1, watch=lambda now: told.append(now.times[-1]))
    assert result.engine.startswith("python: a flow is stiff")
    assert told == result.times
    # y = sin t up to some 1e-6 of the fast transient.
    assert result.event_times("stiff") == pytest.approx(np.arcsin([0.3, 0.6, 0.9]), abs=1e-5)


def test_what_is_converted_on_its_way_is_carried_in_python():
    wires = {**WIRES, "b.heard": Linear("a.emptied", 2.0)}
    result = run_event_exact(tanks("auto", wires=wires), 1.5)
    assert result.engine == "python: a.emptied -> b.heard converts what it carries."


def test_a_slave_of_a_class_of_its_own_is_stepped_as_it_wants_to_be():
    class Counted(AutomatonSlave):
        steps = 0

        def step(self, t, t_next):
            self.steps += 1
            return super().step(t, t_next)

    slave = Counted("a", Tank())
    result = run_event_exact(System([slave], {}), 1.5)
    assert result.engine == "python: a is no automaton in this process."
    assert slave.steps == result.steps


def test_a_system_can_run_again():
    system = tanks("auto")
    one, two = (run_event_exact(system, 3.0, inputs=PUMPS) for _ in range(2))
    assert one.events == two.events
    assert one.final == two.final


def test_a_failing_map_is_told_with_the_automaton():
    class Breaks(hm.HybridAutomaton):
        x = hm.State(1.0, output=True)

        def flow_map(self, s):
            return {"x": -1.0}

        transitions = (hm.Jump("break", lambda self, s: -s.x, lambda self, s: {"x": np.inf}),)

    for engine in ("auto", "python"):
        system = System([AutomatonSlave("calm", Tank()), AutomatonSlave("b", Breaks(), engine=engine)], {})
        with pytest.raises((hm.SimulationError, CosimError), match="Breaks"):
            run_event_exact(system, 2.0)
