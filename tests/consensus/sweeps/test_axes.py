"""Which runs a sweep has: keys, axes, designs."""

import numpy as np
import pytest

from hybrid_model.consensus.scenario.files import read_scenario, scenario_entries
from hybrid_model.consensus.sweeps.axes import Choice, Range, Seeds, read_axis
from hybrid_model.consensus.sweeps.designs import Design, points_of
from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.keys import with_values


def test_values_are_put_under_their_keys_and_the_entries_stay_as_they_are():
    entries, folder = scenario_entries("paper-a")
    values = {
        "stop_time": 9.0,
        "trigger.decay": 0.01,
        "network.initial[3]": 7.0,
        "weights.duty_percent": [30.0] * 4,
        "weights.duty_percent[1]": 5.0,
        "network.edges[4][2]": 2,
        "channel.delay": 0.1,
    }
    before = repr(entries)
    scenario = read_scenario(with_values(entries, values), folder)
    assert repr(entries) == before
    assert (scenario.stop_time, scenario.trigger.decay, scenario.channel.delay) == (9.0, 0.01, 0.1)
    assert scenario.network.initial == (1.0, 2.0, 7.0, 0.4)
    assert [wave.duty_percent for wave in scenario.weights.waveforms] == [5.0, 30.0, 30.0, 30.0]
    assert scenario.network.edges[3] == (4, 2)


def test_the_entries_of_a_preset_with_another_trigger():
    entries, folder = scenario_entries("paper-a-static")
    scenario = read_scenario(entries, folder)
    assert (scenario.name, scenario.trigger.kind.value, scenario.trigger.decay) == ("paper-a-static", "static", 0.0)


@pytest.mark.parametrize(
    ("text", "axis"),
    [
        ("trigger.decay=0:0.1:11", Range("trigger.decay", 0.0, 0.1, 11)),
        ("trigger.threshold = 1e-3:1:4:log", Range("trigger.threshold", 1e-3, 1.0, 4, True)),
        ("network.gain=1:2", Range("network.gain", 1.0, 2.0)),
        ("trigger.kind=static,self-triggered", Choice("trigger.kind", ("static", "self-triggered"))),
        ("network.agents=4, 8", Choice("network.agents", (4, 8))),
        ("network.edges=[[[1, 2]], [[2, 1]]]", Choice("network.edges", ([[1, 2]], [[2, 1]]))),
        ("channel.seed=seeds", Seeds("channel.seed")),
    ],
)
def test_axes_as_text(text, axis):
    assert read_axis(text) == axis


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("trigger.decay", "is no axis"),
        ("trigger decay=1,2", "'trigger decay' is no key of a scenario"),
        ("trigger.decay=1:0:3", "give two finite numbers, the lower first"),
        ("trigger.decay=0:1:3:log", "begin above zero"),
        ("trigger.decay=0:1:1", "give 2 or more"),
        ("trigger.decay=0:1:2.5", "is no range for trigger.decay"),
        ("trigger.decay=0:x:2", "is no range"),
        ("trigger.decay=0:1:2:3", "is no range"),
        ("network.edges=[[1, 2]", "no list in TOML"),
        ("network.edges=[]", "has no value to take"),
    ],
)
def test_what_is_no_axis_is_refused(text, message):
    with pytest.raises(SweepError, match=message):
        read_axis(text)


def test_a_grid_has_all_combinations_the_last_axis_the_fastest():
    axes = [Range("network.gain", 1.0, 4.0, 3, logarithmic=True), Choice("trigger.kind", ("static", "dynamic"))]
    points = points_of(axes, Design.GRID, None, 1, 0)
    assert [point["network.gain"] for point in points] == pytest.approx([1, 1, 2, 2, 4, 4])
    assert [point["trigger.kind"] for point in points] == ["static", "dynamic"] * 3


def test_a_latin_hypercube_has_one_point_in_each_slice_of_each_axis():
    axes = [Range("a.b", 2.0, 12.0), Range("a.c", 1e-4, 1.0, logarithmic=True), Choice("a.d", (1, 2))]
    points = points_of(axes, Design.LATIN_HYPERCUBE, 10, 1, 3)
    assert sorted(int(point["a.b"] - 2.0) for point in points) == list(range(10))
    assert sorted(int((np.log10(point["a.c"]) + 4) / 0.4) for point in points) == list(range(10))
    assert sorted(point["a.d"] for point in points) == [1] * 5 + [2] * 5


def test_draws_and_seeds_are_those_of_the_seed():
    axes = [Range("a.b", 0.0, 1.0), Seeds("channel.seed"), Seeds("switching.seed")]
    first, again, other, longer = (
        points_of(axes, Design.RANDOM, runs, 2, seed) for runs, seed in ((20, 5), (20, 5), (20, 6), (30, 5))
    )
    assert first == again
    assert first != other
    # A longer sweep begins with the shorter one, and each run has seeds of its own.
    assert longer[:40] == first
    seeds = [point[key] for point in longer for key in ("channel.seed", "switching.seed")]
    assert len(set(seeds)) == len(seeds)
    assert all(0 <= seed < 2**31 - 1 for seed in seeds)
    # Both repeats of a point are that point.
    assert [point["a.b"] for point in first[::2]] == [point["a.b"] for point in first[1::2]]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([], Design.GRID, None, 1), "nothing varies"),
        (([Range("a.b", 0, 1)], Design.GRID, None, 1), "no number of values for a grid"),
        (([Range("a.b", 0, 1, 3)], Design.GRID, 5, 1), "leave it out"),
        (([Range("a.b", 0, 1, 3)], Design.RANDOM, None, 1), "needs the number of points to draw"),
        (([Range("a.b", 0, 1, 3)] * 2, Design.GRID, None, 1), "a.b has two axes"),
        (([Range("a.b", 0, 1, 3)], Design.GRID, None, 2), "all repeats would be the same run"),
        (([Range("a.b", 0, 1, 3)], Design.GRID, None, 0), "repeats is 0"),
        (([Range(f"a.{k}", 0, 1, 3000) for k in "bcd"], Design.GRID, None, 1), "at most 10000000"),
    ],
)
def test_designs_that_contradict_themselves_are_refused(arguments, message):
    with pytest.raises(SweepError, match=message):
        points_of(*arguments, 0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"network.initial[5]": 1.0}, "what this scenario has there has 4 elements"),
        ({"network.gain[1]": 1.0}, "is no list"),
        ({"name.x": 1.0}, "is no table"),
    ],
)
def test_elements_that_are_not_there_are_refused(values, message):
    with pytest.raises(SweepError, match=message):
        with_values(scenario_entries("paper-a")[0], values)
