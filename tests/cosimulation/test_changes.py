"""What masters set from outside in a run: tunable parameters, and inputs that nothing drives."""

import pytest
from tuned import BOUNCES, ROUNDS, T_END, TICKS, Tuned, exact, signals

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.errors import CosimError, MisfitError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.system import System

CLOCKS = {"round_clock": ROUNDS, "tick_clock": TICKS, "bounce_clock": BOUNCES}
GIVEN = {f"block.{name}": signal for name, signal in signals().items()}


@pytest.fixture(params=["automaton", "FMU 3.0", "FMU 2.0"])
def block(request, exported):
    if request.param == "automaton":
        return AutomatonSlave("block", Tuned())
    return FmuSlave("block", exported(Tuned(), "tuned-tuned", request.param[-3:]))


class Counter(hm.HybridAutomaton):
    """Counts what it hears."""

    heard = hm.Input(0.0, discrete=True)
    counted = hm.DiscreteState(0.0, output=True)
    ticks = hm.Clock("jump")

    def jump_set(self, s):
        return abs(s.heard - s.counted) - 0.5

    def jump_map(self, s):
        return {"counted": s.heard}


def test_each_change_is_an_event_of_the_event_exact_master(block):
    if not block.has_event_mode:
        pytest.skip("FMI 2.0 has no event mode in Co-Simulation")
    system = System([block, AutomatonSlave("counter", Counter())], {"counter.heard": "block.rounds"})
    result = run_event_exact(system, T_END, inputs=GIVEN)
    for clock, times in CLOCKS.items():
        assert [tick.t for tick in result.ticks if tick.clock == clock] == pytest.approx(times, abs=1e-9)
    assert [tick.t for tick in result.ticks if tick.slave == "counter"] == pytest.approx(ROUNDS, abs=1e-9)
    for name, value in exact(T_END).items():
        assert result.final[f"block.{name}"] == pytest.approx(value, abs=1e-9)
    # Values of one run are not the start values of the next.
    assert run_event_exact(system, 0.4).final["block.weight"] == 16.0


def test_changes_arrive_at_communication_points_of_the_fixed_step_master(block):
    t_end = 0.8
    system = System([block], {})
    result = run_fixed_step(system, t_end, 0.05, record=["block.rounds", "block.ticks"], inputs=GIVEN)
    for name, value in exact(t_end).items():
        assert result.final[f"block.{name}"] == pytest.approx(value, abs=1e-9)
    # What a change makes due happens in the next step, at its beginning.
    assert result.signals["block.rounds"] == [sum(at < t - 1e-9 for at in ROUNDS) for t in result.times]
    # A change between two points ends a step: a round at 0.35 s and one at 0.65 s.
    fall = hm.Signal(lambda t: 1.0 if t < 0.35 else 0.3, [0.35])
    split = run_fixed_step(system, t_end, 0.4, inputs={"block.limit": fall})
    assert split.final["block.rounds"] == 2
    assert split.final["block.x"] == pytest.approx(0.15, abs=1e-9)
    assert split.steps == 3


def test_an_input_that_nothing_drives_is_given_as_well():
    counter = AutomatonSlave("counter", Counter())
    steps = hm.Signal(lambda t: 1.0 * (t >= 0.3) + 1.0 * (t >= 0.7), [0.3, 0.7])
    result = run_event_exact(System([counter], {}), 1.0, inputs={"counter.heard": steps})
    assert [tick.t for tick in result.ticks] == [0.3, 0.7]
    assert run_event_exact(System([counter], {}), 1.0, inputs={"counter.heard": 3.0}).final["counter.counted"] == 3.0


def test_a_slave_is_tuned_between_steps_and_in_event_mode(block):
    events = block.has_event_mode
    block.start(0.0, 1.0, events=events)
    block.begin()
    if events:
        while block.update().again:
            pass
        block.enter_step_mode()
    block.step(0.0, 0.4)
    block.set("limit", 0.25)
    made = block.step(0.4, 0.5)
    # The ramp stands at 0.4: it starts anew at that instant, not at the end of the step.
    assert (made.reached, made.event) == ((0.4, True) if events else (0.5, made.event))
    if events:
        block.enter_event_mode()
        assert block.update().next_event == pytest.approx(0.45, abs=1e-9)
        block.set("slope", 10.0)
        assert block.update().next_event == pytest.approx(0.425, abs=1e-9)
    assert block.get("rounds") == 1
    assert block.get("x") == pytest.approx(0.0 if events else 0.1, abs=1e-9)
    block.close()


def test_a_tuned_value_is_part_of_the_state(block):
    events = block.has_event_mode
    block.start(0.0, 1.0, events=events)
    block.begin()
    if events:
        block.update()
        block.enter_step_mode()
    block.step(0.0, 0.2)
    state = block.save()
    block.set("limit", 0.3)
    block.step(0.2, 0.3)
    block.restore(state)
    assert (block.get("limit"), block.get("x")) == (1.0, pytest.approx(0.2, abs=1e-12))
    block.step(0.2, 0.4)
    assert block.get("rounds") == 0
    block.release(state)
    block.close()


def test_a_value_outside_its_range_is_refused_before_and_in_the_run(block):
    with pytest.raises(MisfitError, match=r"block\.limit is set to 0\.05, below its minimum 0\.1: give a value in"):
        block.set("limit", 0.05)
    block.start(0.0, 1.0, events=block.has_event_mode)
    block.begin()
    with pytest.raises(MisfitError, match=r"block\.limit is set to 0\.05, below its minimum 0\.1: give a value in"):
        block.set("limit", 0.05)
    assert block.get("limit") == 1.0
    block.close()


@pytest.mark.parametrize("name", ["mass", "rounds"])
def test_what_is_fixed_is_not_set_in_a_run(block, name):
    block.set(name, 1.0)
    block.start(0.0, 1.0, events=block.has_event_mode)
    block.begin()
    with pytest.raises((CosimError, MisfitError), match=r"fixed once|not tunable|cannot be set"):
        block.set(name, 2.0)
    block.close()


def test_names_and_values_that_cannot_be(block):
    system = System([block, AutomatonSlave("counter", Counter())], {"counter.heard": "block.rounds"})
    for name, message in (
        ("block.mass", "neither an input nor a tunable parameter, .*of block are slope, limit, period, g, e, gains"),
        ("counter.heard", "cannot be given a value, for block.rounds -> counter.heard drives it"),
        ("nobody.limit", "names no slave"),
    ):
        with pytest.raises(MisfitError, match=message):
            run_fixed_step(system, 1.0, 0.1, inputs={name: 1.0})
    for value in ([1.0, 2.0], float("nan"), "high"):
        with pytest.raises(MisfitError, match=r"block\.limit"):
            run_fixed_step(system, 1.0, 0.1, inputs={"block.limit": value})


class Sampler(hm.HybridAutomaton):
    """Samples its input every second."""

    u = hm.Input(0.0, discrete=True)
    count = hm.DiscreteState(0, integer=True)
    held = hm.DiscreteState(0.0, output=True)

    transitions = (
        hm.TimeEvent("sample", lambda self, s: s.count + 1.0, lambda self, s: {"count": s.count + 1, "held": s.u}),
    )


@pytest.mark.parametrize("grid", [{}, {"output_interval": 0.25, "record_events": True}])
@pytest.mark.parametrize("kind", ["native", "python", "fmu"])
def test_an_input_that_steps_when_it_is_sampled_is_sampled_with_its_new_value(kind, grid, exported):
    # As in a run of the automaton: a change comes before the jumps of its instant (rule 5).
    step = hm.Signal(lambda t: 0.0 if t < 2.0 else 5.0, [2.0])
    alone = hm.simulate(Sampler(), 2.5, inputs={"u": step})
    assert alone.at("held", 2.25) == 5.0
    if kind == "fmu":
        slave = FmuSlave("sampler", exported(Sampler(), "sampler"))
    else:
        slave = AutomatonSlave("sampler", Sampler(), engine=kind)
    result = run_event_exact(System([slave], {}), 2.5, inputs={"sampler.u": step}, **grid)
    assert result.final["sampler.held"] == 5.0
    assert [event.t for event in result.events] == [1.0, 2.0]
