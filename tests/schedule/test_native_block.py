"""An automaton behind a slave on either engine: the same events, states and endings."""

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.errors import CosimError
from cosim.masters import run_event_exact, run_fixed_step
from cosim.system import System
from hybrid_model.models import BouncingBall
from hybrid_model.schedule.automaton_block import AutomatonBlock
from hybrid_model.schedule.native_block import NativeBlock

ENGINES = ("native", "python")
IMPACT = 0.45152364098573
"""sqrt(2 / 9.81) s."""


class Doubled(BouncingBall):
    """Starts at a height that is computed from a parameter."""

    h = hm.State(computed=True, output=True)
    drop = hm.Parameter(0.5)
    energy = hm.Output()

    def start_map(self, s):
        return {"h": 2.0 * s.drop}

    def outputs(self, s):
        return {"energy": s.g * s.h + 0.5 * s.v**2}


class Untraceable(BouncingBall):
    """Asks for a number, which symbols do not have."""

    def flow_map(self, s):
        return {"h": s.v, "v": -float(s.g)}


def started(automaton, engine, *, events=True, **starts):
    slave = AutomatonSlave("a", automaton, engine=engine)
    for name, value in starts.items():
        slave.set(name, value)
    slave.start(0.0, 2.0, events=events)
    slave.begin()
    return slave


def test_the_engine_in_c_runs_what_can_be_traced():
    kinds = {engine: type(started(BouncingBall(), engine)._block) for engine in ("auto", *ENGINES)}
    assert kinds == {"auto": NativeBlock, "native": NativeBlock, "python": AutomatonBlock}
    assert type(started(Untraceable(), "auto")._block) is AutomatonBlock


def test_what_cannot_be_traced_is_refused_where_the_engine_in_c_is_wanted():
    with pytest.raises(CosimError, match=r"a cannot run on the native engine: .*traced"):
        started(Untraceable(), "native")


@pytest.mark.parametrize("engine", ENGINES)
def test_start_values_that_are_computed_and_outputs_are_seen_before_the_run_begins(engine):
    slave = AutomatonSlave("a", Doubled(), engine=engine)
    slave.set("drop", 1.5)
    slave.start(0.0, 1.0, events=True)
    assert (slave.get("h"), slave.get("energy")) == pytest.approx((3.0, 3.0 * 9.81), rel=1e-15)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_block_names_its_event_stops_there_and_returns_to_where_it_was_saved(engine):
    slave = started(BouncingBall(), engine)
    announced = slave.update().next_event
    assert announced == pytest.approx(IMPACT, abs=1e-11)
    slave.step(0.0, 0.25)
    saved, height = slave.save(), slave.get("h")
    for _ in range(2):
        made = slave.step(0.25, 1.0)
        assert (made.event, made.terminated) == (True, None)
        assert made.reached == pytest.approx(announced, abs=1e-11)
        falling = slave.get("v")
        assert slave.update().next_event > announced
        assert slave.get("v") == pytest.approx(-0.7 * falling, rel=1e-12)
        slave.restore(saved)
        assert slave.get("h") == height


def test_both_engines_end_a_run_alike():
    runs = [
        run_event_exact(System([AutomatonSlave("a", BouncingBall(), engine=engine)], {}), 5.0) for engine in ENGINES
    ]
    assert runs[0].ended is runs[1].ended
    # The end of an accumulation is a difference of times that are accurate to 1e-10 s.
    assert runs[0].t == pytest.approx(runs[1].t, abs=1e-9)


def test_both_engines_take_events_inside_alike():
    runs = [
        run_fixed_step(System([AutomatonSlave("a", BouncingBall(), engine=engine)], {}), 2.0, 0.1, record=["a.h"])
        for engine in ENGINES
    ]
    assert runs[0].signals["a.h"] == pytest.approx(runs[1].signals["a.h"], abs=1e-10)


class Follower(hm.HybridAutomaton):
    """x follows cos(t) within a microsecond: stiff, which nobody has declared."""

    x = hm.State(1.0, output=True)

    def flow_map(self, s):
        return {"x": -1e6 * (s.x - np.cos(s.t))}


def test_a_flow_that_turns_out_to_be_stiff_goes_on_with_a_method_for_that():
    slave = started(Follower(), "native", events=False)
    saved, explicit = slave.save(), slave._block.run
    for t, t_next in ((0.0, 0.5), (0.5, 1.0)):
        slave.step(t, t_next)
    run = slave._block.run
    assert run is not explicit
    assert run.statistics.jacobians > 0
    # An explicit method is stable up to steps of 6e-6 s, 160 000 of them; after 20 000 the block hears what they show.
    assert explicit.statistics.steps + run.statistics.steps < 30_000
    # x = (cos t + e sin t) / (1 + e^2) with e = 1e-6, once what it began with is gone.
    assert slave.get("x") == pytest.approx((np.cos(1.0) + 1e-6 * np.sin(1.0)) / (1.0 + 1e-12), abs=1e-11)
    # What was saved before fits the run that goes on.
    slave.restore(saved)
    slave.step(0.0, 0.5)
    assert slave.get("x") == pytest.approx((np.cos(0.5) + 1e-6 * np.sin(0.5)) / (1.0 + 1e-12), abs=1e-11)
