"""Masters: exact instants, bounded iteration, time by index, and what faulty slaves may not do to a run."""

import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.errors import CosimError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.result import Ended
from cosim.system import System
from hybrid_model.models import BouncingBall
from hybrid_model.schedule.blocks import Step


class Ramp(hm.HybridAutomaton):
    """Rises at a rate; at `level` it starts anew and sends how often it has done so."""

    x = hm.State(0.0, output=True)
    sent = hm.DiscreteState(0.0, output=True)
    rate = hm.Parameter(1.0)
    level = hm.Parameter(1.0)
    ticks = hm.Clock("jump")

    def flow_map(self, s):
        return {"x": s.rate}

    def jump_set(self, s):
        return s.x - s.level

    def jump_map(self, s):
        return {"x": 0.0, "sent": s.sent + 1}


class Relay(hm.HybridAutomaton):
    """Passes on, at the instant of its arrival, what it receives."""

    received = hm.Input(0.0, discrete=True)
    sent = hm.DiscreteState(0.0, output=True)
    ticks = hm.Clock("jump")

    def jump_set(self, s):
        return np.abs(s.received - s.sent) - 0.5

    def jump_map(self, s):
        return {"sent": s.received}


class Follower(hm.HybridAutomaton):
    """Jumps where a continuous input and its own state meet: it cannot know its next event beforehand."""

    felt = hm.Input(0.0)
    x = hm.State(0.0, output=True)
    met = hm.DiscreteState(0.0, output=True)
    ticks = hm.Clock("jump")

    def flow_map(self, s):
        return {"x": s.felt}

    def jump_set(self, s):
        return s.x - 1.0

    def jump_map(self, s):
        return {"x": 0.0, "met": s.met + 1}


def slaves(*named):
    return [AutomatonSlave(name, automaton) for name, automaton in named]


def test_a_signal_runs_through_a_chain_at_one_instant():
    chain = slaves(("a", Ramp()), ("b", Relay()), ("c", Relay()), ("d", Relay()))
    wires = {"b.received": "a.sent", "c.received": "b.sent", "d.received": "c.sent"}
    result = run_event_exact(System(chain, wires), 2.5)
    assert [tick.slave for tick in result.ticks] == ["a", "b", "c", "d"] * 2
    np.testing.assert_allclose([tick.t for tick in result.ticks], [1.0] * 4 + [2.0] * 4, rtol=0, atol=1e-12)


def test_the_record_of_events_has_all_slaves_on_both_sides_of_an_instant():
    def run(**options):
        chain = slaves(("a", Ramp(level=0.7)), ("b", Relay()), ("still", Ramp(rate=0.25)))
        return run_event_exact(System(chain, {"b.received": "a.sent"}), 2.0, output_interval=0.5, **options)

    result, without = run(record_events=True), run()
    assert result.times == pytest.approx([0.0, 0.5, 0.7, 0.7, 1.0, 1.4, 1.4, 1.5, 2.0], abs=1e-12)
    assert result.signals["a.x"] == pytest.approx([0.0, 0.5, 0.7, 0.0, 0.3, 0.7, 0.0, 0.1, 0.6], abs=1e-12)
    assert result.signals["b.sent"] == [0, 0, 0, 1, 1, 1, 2, 2, 2]
    assert result.signals["still.x"] == pytest.approx([t / 4 for t in result.times], abs=1e-12)
    assert without.times == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert result.ticks == without.ticks
    assert result.events == without.events


def test_the_start_values_run_through_a_chain_whatever_its_order():
    class Passing(hm.HybridAutomaton):
        into = hm.Input(0.0, discrete=True)
        out = hm.Output(discrete=True)

        def outputs(self, s):
            return {"out": s.into + 1.0}

    named = [(name, Passing()) for name in "abcd"]
    wires = {"a.into": "b.out", "b.into": "c.out", "c.into": "d.out"}
    result = run_event_exact(System(slaves(*named), wires), 1.0, output_interval=1.0)
    assert [result.signals[f"{name}.out"][0] for name in "dcba"] == [1.0, 2.0, 3.0, 4.0]


def test_only_the_slave_that_fires_and_its_receivers_are_stepped():
    """50 ramps that nobody listens to and that do not fire cost one step each, for the stop time."""
    results = []
    for count, engine in ((0, "auto"), (50, "auto"), (50, "python")):
        idle = [AutomatonSlave(f"idle{k}", Ramp(rate=0.01), engine=engine) for k in range(count)]
        pair = [AutomatonSlave("a", Ramp(), engine=engine), AutomatonSlave("b", Relay(), engine=engine)]
        results.append(run_event_exact(System([*pair, *idle], {"b.received": "a.sent"}), 9.5))
        assert len(results[-1].tick_times("a", "ticks")) == 9
    alone, together, plain = (result.steps for result in results)
    assert together - alone == 50
    # a and b: one step each per event, and one for the stop time; where looks ahead end on the way, one more each.
    assert plain <= 50 + 2 * (9 + 1)
    assert together <= 50 + 4 * (9 + 1)


def test_simultaneous_events_that_rounding_separates_are_handled_at_one_instant():
    """Ramps of rate 0.1 and 0.3 from different starts reach their levels at t = 1 by different sums."""
    system = System(slaves(("a", Ramp(rate=0.1, level=0.1)), ("b", Ramp(rate=0.3, level=0.3))), {})
    result = run_event_exact(system, 3.5)
    times = {name: result.tick_times(name, "ticks") for name in "ab"}
    np.testing.assert_array_equal(times["a"], times["b"])
    np.testing.assert_allclose(times["a"], [1.0, 2.0, 3.0], rtol=0, atol=1e-9)


def test_a_slave_that_cannot_predict_is_stopped_at_its_event_and_others_are_not_beyond_it():
    """Two followers are stepped to the same horizon; the first to jump sends the other back to that instant."""
    system = System(
        slaves(("slow", Follower(felt=0.4)), ("fast", Follower(felt=0.7)), ("r", Relay())), {"r.received": "fast.met"}
    )
    result = run_event_exact(system, 5.0)
    np.testing.assert_allclose(result.tick_times("slow", "ticks"), [2.5, 5.0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(result.tick_times("fast", "ticks"), [1 / 0.7, 2 / 0.7, 3 / 0.7], rtol=0, atol=1e-9)
    np.testing.assert_array_equal(result.tick_times("r", "ticks"), result.tick_times("fast", "ticks"))


class Purged(Follower):
    """A follower that starts anew at a known time, too."""

    purges = hm.DiscreteState(0, integer=True, output=True)

    transitions = (
        hm.TimeEvent(
            "purge", lambda self, s: 1.75 * (s.purges + 1), lambda self, s: {"x": 0.0, "purges": s.purges + 1}
        ),
    )


@pytest.mark.parametrize("kind", [AutomatonSlave, FmuSlave])
def test_a_slave_that_names_its_known_times_alone_may_stop_before_them(kind, exported):
    """A continuous input keeps states' events unforeseen, while nextEventTime has the known time behind them."""
    model = Purged("purged") if kind is AutomatonSlave else exported(Purged("purged"), "purged")
    slow, fast = kind("slow", model), kind("fast", model)
    slow.set("felt", 0.4)
    fast.set("felt", 0.8)
    result = run_event_exact(System([slow, fast], {}), 4.0)
    assert result.ended is Ended.HORIZON
    # Whoever was sent back from its own event has none where the other one has.
    for name, expected in (("slow", [1.75, 3.5]), ("fast", [1.25, 1.75, 3.0, 3.5])):
        np.testing.assert_allclose([e.t for e in result.events if e.block == name], expected, rtol=0, atol=1e-9)


def test_zeno_ends_the_run_with_the_time_of_the_accumulation():
    result = run_event_exact(System(slaves(("ball", BouncingBall())), {}), 5.0)
    assert result.ended is Ended.ZENO
    assert "accumulate at t = 2.5586" in result.message
    assert result.t == pytest.approx(np.sqrt(2 / 9.81) * 1.7 / 0.3, abs=1e-3)


def test_communication_points_are_computed_from_their_index():
    """0.001 s summed 256 040 times is wrong in the tenth digit; the index is exact."""
    points = []

    class Watching(AutomatonSlave):
        def step(self, t, t_next):
            points.append((t, t_next))
            return Step(t_next, False)

    run_fixed_step(System([Watching("a", Ramp())], {}), 2.5604, 0.001)
    assert [t_next for _, t_next in points[:-1]] == [(k + 1) * 0.001 for k in range(2560)]
    assert points[-1][1] == 2.5604
    assert all(a[1] == b[0] for a, b in pairwise(points))


@pytest.mark.parametrize("step", [0.0, -0.1, float("nan"), float("inf")])
def test_impossible_steps_are_refused(step):
    with pytest.raises(CosimError, match="communication step is"):
        run_fixed_step(System(slaves(("a", Ramp())), {}), 1.0, step)


def test_the_order_of_slaves_does_not_matter_to_the_fixed_step_master():
    def final(order):
        named = {"a": Ramp(rate=0.7), "b": Relay(), "c": Relay()}
        system = System(
            slaves(*((name, named[name]) for name in order)), {"b.received": "a.sent", "c.received": "b.sent"}
        )
        return run_fixed_step(system, 4.0, 0.1).final

    assert final("abc") == final("cba") == final("bca")


def test_an_input_is_set_again_only_when_its_value_is_news():
    class Told(AutomatonSlave):
        def set(self, name, value):
            given.append((name, value))
            super().set(name, value)

    given = []
    system = System([AutomatonSlave("a", Ramp()), Told("b", Relay())], {"b.received": "a.sent"})
    result = run_fixed_step(system, 4.0, 0.01, record=["a.sent"])
    along = [value for _, value in given[1:]]
    assert len(along) == len(set(along)) == len(set(result.signals["a.sent"])) > 1


class Beyond(AutomatonSlave):
    """A slave that is not where it was to go."""

    def step(self, t, t_next):
        return super().step(t, t_next)._replace(reached=t_next + 1.0)


def test_slaves_are_closed_when_a_run_fails():
    faulty = Beyond("faulty", Ramp())
    with pytest.raises(CosimError):
        run_event_exact(System([faulty], {}), 3.0)
    with pytest.raises(CosimError, match="has not been started"):
        faulty.get("x")


def test_a_restored_slave_counts_jumps_from_where_it_was_saved():
    """The memory of the Zeno guard is saved and restored with the state: a branch tried before does not count."""

    def run_on(slave):
        step = slave.step(slave_time, 5.0)
        return step.reached, step.terminated.message

    slave_time = 2.5
    slave = AutomatonSlave("ball", BouncingBall())
    slave.start(0.0, 5.0, events=False)
    slave.begin()
    slave.step(0.0, slave_time)
    saved = slave.save()
    first = run_on(slave)
    for _ in range(3):
        slave.restore(saved)
        assert run_on(slave) == first


class Stuck(hm.HybridAutomaton):
    """Begins outside its flow set, with no jump to take."""

    x = hm.State(-1.0, output=True)

    def flow_map(self, s):
        return {"x": 1.0}

    def flow_set(self, s):
        return s.x


@pytest.mark.parametrize("kind", [AutomatonSlave, FmuSlave])
def test_a_block_that_cannot_begin_ends_the_run_with_its_own_words(kind, exported):
    slave = kind("stuck", Stuck() if kind is AutomatonSlave else exported(Stuck(), "stuck"))
    result = run_event_exact(System([slave], {}), 1.0)
    assert result.ended is Ended.TERMINATED
    assert "x = -1" in result.message
    assert result.t == 0.0


class Bounded(hm.HybridAutomaton):
    """May flow up to a length, where it has no jump to take; it counts on the way."""

    x = hm.State(0.0, output=True)
    count = hm.DiscreteState(0, integer=True, output=True)
    length = hm.Parameter(2.3)

    def flow_map(self, s):
        return {"x": 1.0}

    def flow_set(self, s):
        return s.length - s.x

    transitions = (hm.TimeEvent("tick", lambda self, s: 0.5 * (s.count + 1), lambda self, s: {"count": s.count + 1}),)


# At 2.5 s a known time and the end of the flow are one instant.
@pytest.mark.parametrize("length", [2.3, 2.5])
@pytest.mark.parametrize("kind", [AutomatonSlave, FmuSlave])
def test_a_block_whose_flow_ends_on_the_way_ends_the_run_there_at_once(length, kind, exported):
    short, longer = Bounded(length=length), Bounded(length=100.0)
    blocks = {"short": short, "long": longer}
    if kind is FmuSlave:
        blocks = {name: exported(block, name) for name, block in blocks.items()}
    result = run_event_exact(System([kind(name, block) for name, block in blocks.items()], {}), 5.0, output_interval=1)
    assert result.ended is Ended.TERMINATED
    assert "short" in result.message
    # The border of the flow set is 1e-9 of the size of a state wide.
    assert result.t == pytest.approx(length, abs=1e-8)
    assert result.steps < 100
    # The last row is of one time for all.
    assert result.signals["long.x"][-1] == pytest.approx(result.t, abs=1e-12)
    assert result.final["long.x"] == result.signals["long.x"][-1]


class Pushed(Bounded):
    """The same with an input that follows time, so that it cannot tell its next event."""

    push = hm.Input(0.0)


@pytest.mark.parametrize("order", ["short long", "long short"])
def test_blocks_that_went_ahead_return_to_where_another_one_ends_the_run(order):
    lengths = {"short": 2.3, "long": 100.0}
    slaves = [AutomatonSlave(name, Pushed(length=lengths[name]), engine="python") for name in order.split()]
    result = run_event_exact(System(slaves, {}), 5.0, output_interval=1)
    assert result.ended is Ended.TERMINATED
    assert result.t == pytest.approx(2.3, abs=1e-8)
    assert result.final["long.x"] == pytest.approx(result.t, abs=1e-12)
    assert result.final["long.count"] == 4


@pytest.mark.parametrize(("t_stop", "points"), [(11.9, 41), (12.0, 41), (0.7, 8)])
def test_output_points_end_at_the_stop_time_whatever_rounding_says(t_stop, points):
    # 40 * (11.9/40) is an ulp below 11.9.
    interval = t_stop / (points - 1)
    system = System([AutomatonSlave("ball", BouncingBall(h=100.0, e=1.0))], {})
    result = run_event_exact(system, t_stop, output_interval=interval)
    assert len(result.times) == points
    assert result.times[-1] == t_stop


KNOTS = """
import gc, weakref
from cosim.masters import start

class Knot:
    def __init__(self):
        self.itself = self  # as an FMU and its callbacks have it, so that only a collection frees it

start.GROWTH, left = 1.02, []
gc.collect()
# Fewer at a time than bring about a collection of the youngest by themselves.
for _ in range(len(gc.get_objects()) // 3000):
    with start.apart_from_the_rest():
        pass
    left += [weakref.ref(Knot()) for _ in range(200)]
print(sum(knot() is not None for knot in left) / len(left))
"""


def test_what_earlier_runs_have_left_is_collected():
    # In a process of its own, which holds a tenth of what one with tests does.
    told = subprocess.run([sys.executable, "-c", KNOTS], capture_output=True, text=True, check=True)
    assert float(told.stdout) < 0.7
