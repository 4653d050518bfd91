"""Tunable parameters in Python: a change is an event from outside, for guards, known times, flows and outputs."""

import numpy as np
import pytest
from tuned import CHANGES, EVENTS, JUMPS, POINTS, T_END, TIMES, Tuned, TunedAndDriven, exact, held, signals

import hybrid_model as hm

# Straight ramps and parabolas are exact up to the roundings of a dozen steps; times of bounces come from roots.
TIME, STATE = 1e-11, 1e-10


@pytest.fixture(scope="module")
def arc():
    return hm.simulate(Tuned(), T_END, inputs=signals())


def check(arc, rename=str):
    for name, times in EVENTS.items():
        assert arc.event_times(rename(name)) == pytest.approx(times, abs=TIME)
    for t in POINTS:
        for name, value in exact(t).items():
            assert float(arc.at(rename(name), t)) == pytest.approx(value, abs=STATE), (name, t)


def test_the_run_is_the_one_in_closed_form(arc):
    check(arc)
    assert [jump.name for jump in arc.jumps] == [name for _, name in JUMPS]


def test_traced_maps_give_the_same_run(arc):
    check(hm.simulate(Tuned(), T_END, inputs=signals(), engine="native"))


def test_a_part_of_a_composition_is_tuned_by_its_scoped_name():
    pair = hm.Composition("pair", {"one": Tuned(), "two": TunedAndDriven()})
    inputs = {f"{part}.{name}": signal for part in ("one", "two") for name, signal in signals().items()}
    arc = hm.simulate(pair, T_END, inputs=inputs)
    check(arc, lambda name: f"one.{name}")
    check(arc, lambda name: f"two.{name}")


def test_a_network_run_part_by_part_gives_the_same_run():
    class Counter(hm.HybridAutomaton):
        heard = hm.Input(0.0, discrete=True)
        counted = hm.DiscreteState(0.0)
        when = hm.DiscreteState(-1.0)

        def jump_set(self, s):
            return s.heard - s.counted - 0.5

        def jump_map(self, s):
            return {"counted": s.heard, "when": s.t}

    network = hm.Composition("network", {"source": Tuned(), "sink": Counter()}, {"sink.heard": "source.rounds"})
    inputs = {f"source.{name}": signal for name, signal in signals().items()}
    run = hm.simulate_network(network, T_END, inputs=inputs)
    check(run.arcs["source"])
    assert run.event_times("sink", "jump") == pytest.approx(EVENTS["round"], abs=TIME)


def test_what_comes_from_outside_passes_a_part_of_a_network_at_once():
    """A part that only hands on: its output changes with its input or its parameter, without a jump of its own."""

    class Gain(hm.HybridAutomaton):
        u = hm.Input(0.0, discrete=True)
        k = hm.Parameter(1.0, tunable=True)
        y = hm.Output(discrete=True)
        x = hm.State(0.0)

        def flow_map(self, s):
            return {"x": 1.0}

        def outputs(self, s):
            return {"y": s.k * s.u}

    class Switch(hm.HybridAutomaton):
        w = hm.Input(0.0, discrete=True)
        on = hm.DiscreteState(0.0)

        def jump_set(self, s):
            return hm.least(s.w - 0.5, 0.5 - s.on)

        def jump_map(self, s):
            return {"on": 1.0}

    network = hm.Composition("chain", {"gain": Gain(), "switch": Switch()}, {"switch.w": "gain.y"})
    # The first breakpoint changes nothing: solver steps are long from there on, and none ends at the second by itself.
    step = hm.Signal(lambda t: 1.0 * (t >= 1.0), [0.5, 1.0])
    for inputs in ({"gain.u": step}, {"gain.u": 1.0, "gain.k": step}):
        for run in (hm.simulate(network, 2.0, inputs=inputs), hm.simulate_network(network, 2.0, inputs=inputs)):
            jumps = run.jumps if isinstance(run, hm.HybridArc) else [jump for _, jump in run.jumps]
            assert [jump.t for jump in jumps] == [1.0]


def test_the_arc_tells_the_parameters_in_time(arc, tmp_path):
    arc.save(tmp_path / "arc.npz")
    for told in (arc, hm.load_arc(tmp_path / "arc.npz"), arc.restrict(t=(0.65, 2.0))):
        within = [t for t in [*POINTS, *TIMES] if told.t[0] <= t <= told.t[-1]]
        for name in CHANGES:
            assert told.at(name, within).tolist() == [held(name, t) for t in within]
        assert told["g"].tolist() == [held("g", t) for t in told.t]
    samples = arc.samples()
    assert {*CHANGES, "gains"} <= set(samples.values)
    assert "mass" not in samples.values


def test_tables_hold_tunable_parameters_as_columns(arc):
    frame = arc.to_dataframe()
    assert frame["e"].tolist() == [held("e", t) for t in arc.t]
    assert frame.attrs["parameters"] == {"mass": 2.0}


def test_the_verifier_reads_them_off_the_run_or_is_told(arc):
    assert hm.verify(Tuned(), arc).ok
    assert hm.verify(Tuned(), arc.samples()).ok
    bare = arc.samples([name for name in arc.samples().values if name not in CHANGES])
    assert hm.verify(Tuned(), bare, inputs=signals()).ok
    found = hm.verify(Tuned(), bare)
    assert not found.ok
    # Without the change at 0.5 s the jump there comes from a state outside its jump set.
    assert "round" in str(found) or "jump" in str(found)


def test_a_constant_counts_from_the_start():
    class Started(Tuned):
        top = hm.DiscreteState(computed=True)

        def start_map(self, s):
            return {"top": 2.0 * s.limit}

    arc = hm.simulate(Started(), 0.45, inputs={"limit": 0.2})
    assert float(arc.at("top", 0.0)) == 0.4
    assert arc.event_times("round") == pytest.approx([0.2, 0.4], abs=TIME)
    later = hm.simulate(Started(), 0.45, inputs={"limit": hm.Signal(lambda t: 0.2 if t >= 0.3 else 0.7, [0.3])})
    # What start_map has computed stays: it is a start value.
    assert later["top"].tolist() == [1.4] * len(later.t)
    assert later.event_times("round").tolist() == [0.3]


def test_a_signal_is_asked_at_the_start_and_at_its_breakpoints_only():
    asked = []

    def value(t):
        asked.append(t)
        return 1.0 + t

    arc = hm.simulate(Tuned(), 1.0, t_start=0.25, inputs={"slope": hm.Signal(value, [0.75, 0.5, -1.0, 5.0])})
    assert asked == [0.25, 0.5, 0.75]
    assert float(arc.at("x", 0.45)) == pytest.approx(0.2 * 1.25, abs=STATE)
    assert float(arc.at("slope", 0.7)) == 1.5


def test_an_array_is_tuned_as_a_whole():
    both = hm.Signal(lambda t: [5.0, 2.0] if t >= 0.4 else [1.0, 3.0], [0.4])
    arc = hm.simulate(Tuned(), 0.6, inputs={"gains": both})
    assert arc.at("mix", [0.2, 0.5, 0.6]) == pytest.approx([0.2, 2.5, 5.0], abs=STATE)
    assert arc.at("gains", [0.2, 0.4]).tolist() == [[1.0, 3.0], [5.0, 2.0]]
    assert hm.verify(Tuned(), arc).ok
    one = hm.simulate(Tuned(), 0.3, inputs={"gains": 2.0})
    assert one["gains"][0].tolist() == [2.0, 2.0]


def test_a_change_at_the_very_end_counts_as_other_events_there_do():
    arc = hm.simulate(Tuned(), 0.45, inputs={"limit": hm.Signal(lambda t: 0.2 if t >= 0.45 else 1.0, [0.45])})
    assert arc.event_times("round").tolist() == [0.45]


def test_a_change_that_leaves_no_set_to_be_in_ends_the_run():
    class Corridor(hm.HybridAutomaton):
        x = hm.State(0.5)
        wall = hm.Parameter(1.0, tunable=True)

        def flow_map(self, s):
            return {"x": 0.0}

        def flow_set(self, s):
            return s.wall - s.x

    arc = hm.simulate(Corridor(), 2.0, inputs={"wall": hm.Signal(lambda t: 1.0 - 0.7 * (t >= 1.0), [1.0])})
    assert arc.stop is hm.Stop.BLOCKED
    assert arc.t[-1] == 1.0


def test_a_modal_automaton_and_a_dwell_time():
    class Heater(hm.ModalAutomaton):
        temperature = hm.State(20.0)
        low = hm.Parameter(19.0, tunable=True)
        high = hm.Parameter(21.0, tunable=True)
        modes = (
            hm.Mode("on", lambda self, s: {"temperature": 1.0}),
            hm.Mode("off", lambda self, s: {"temperature": -1.0}),
        )
        switches = (
            hm.Switch("stop", "on", "off", lambda self, s: s.temperature - s.high),
            hm.Switch("go", "off", "on", lambda self, s: s.low - s.temperature),
        )

    step = hm.Signal(lambda t: 20.2 if t >= 0.6 else 21.0, [0.6])
    arc = hm.simulate(Heater(), 3.0, inputs={"high": step})
    assert arc.event_times("stop") == pytest.approx([0.6], abs=TIME)
    assert arc.event_times("go") == pytest.approx([2.2], abs=TIME)
    raised = hm.Signal(lambda t: 20.5 if t >= 0.9 else 19.0, [0.9])
    held_back = hm.simulate(hm.MinimumDwell(Heater(), 0.5), 1.2, inputs={"high": step, "low": raised})
    # The switch of 0.9 s is due 0.2 s too early, and waits for 1.1 s.
    assert held_back.event_times("go") == pytest.approx([1.1], abs=TIME)
    assert float(held_back["held_jumps"][-1]) == 1.0


# What cannot be.


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"mass": 3.0}, "parameter mass is fixed for a run: give its value when the instance is made, or declare it"),
        ({"limit": np.sin}, "limit changes at events only, so it cannot be a plain function of time: give a number"),
        ({"limit": [1.0, 2.0]}, "parameter limit is set to .*shape"),
        ({"limit": 0.05}, "parameter limit is set to 0.05, outside its range from 0.1 to inf"),
        ({"limit": np.nan}, "parameter limit = nan is not finite"),
        ({"limit": "high"}, "parameter limit = 'high' is not a number"),
        ({"limits": 1.0}, "limits"),
    ],
)
def test_what_is_no_value_of_a_parameter_is_refused(inputs, message):
    with pytest.raises(hm.DeclarationError, match=message):
        hm.simulate(Tuned(), 1.0, inputs=inputs)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (0.05, "at t = 0.5 s parameter limit is set to 0.05, outside its range from 0.1 to inf: give a value within"),
        (np.inf, "at t = 0.5 s parameter limit = inf is not finite"),
        ([1.0], "of shape"),
        (None, "at t = 0.5 s parameter limit = (None|nan) is not"),
    ],
)
def test_a_signal_that_gives_none_is_refused_when_it_does(value, message):
    signal = hm.Signal(lambda t: value if t >= 0.5 else 1.0, [0.5])
    hm.simulate(Tuned(), 0.4, inputs={"limit": signal})
    with pytest.raises(hm.SimulationError, match=message):
        hm.simulate(Tuned(), 1.0, inputs={"limit": signal})


def test_whole_numbers_stay_whole():
    class Counted(hm.HybridAutomaton):
        n = hm.Parameter(2, integer=True, tunable=True)
        x = hm.State(0.0)

        def flow_map(self, s):
            return {"x": s.n}

    signal = hm.Signal(lambda t: 2.0 + t, [0.5, 1.0])
    with pytest.raises(hm.SimulationError, match="it holds whole numbers: round it"):
        hm.simulate(Counted(), 1.0, inputs={"n": signal})
