"""Scenario files with every kind of weight and switching: what they mean, and every refusal with its message."""

import copy
import math

import numpy as np
import pytest

from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario, Weights
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario
from hybrid_model.consensus.switching.base import NoSwitching
from hybrid_model.consensus.switching.cycle import SwitchingCycle
from hybrid_model.consensus.switching.sequence import SwitchingSequence
from hybrid_model.consensus.weights.function import FunctionWeight
from hybrid_model.consensus.weights.gated_sine import GatedSine, WeightMap
from hybrid_model.consensus.weights.kinds import WeightKind
from hybrid_model.consensus.weights.piecewise import PiecewiseWeight
from hybrid_model.consensus.weights.sampled import SampledWeight
from hybrid_model.consensus.weights.sine import SineWeight
from hybrid_model.consensus.weights.square import SquareWeight

BASE = {
    "name": "three",
    "stop_time": 10,
    "network": {"agents": 3, "edges": [[1, 2], [2, 3]], "initial": [1, 0.5, -2.0]},
    "weights": {"kind": "constant", "value": 1.0},
    "trigger": {"kind": "static", "threshold": 0.5},
}


def scenario(**tables):
    return read_scenario(copy.deepcopy(BASE) | tables)


class TestWeights:
    def test_sine(self):
        made = scenario(weights={"kind": "sine", "mean": [1, 2], "depth": 0.5, "rate": 3.0})
        assert made.weights.waveforms == (SineWeight(1.0, 0.5, 3.0), SineWeight(2.0, 0.5, 3.0))
        assert made.weights.kind is WeightKind.SINE

    def test_square(self):
        made = scenario(weights={"kind": "square", "high": 2, "gate_rate": 4.0, "duty_percent": [20, 30], "phase": 1})
        assert made.weights.waveforms == (
            SquareWeight(2.0, 0.0, 4.0, 20.0, 1.0),
            SquareWeight(2.0, 0.0, 4.0, 30.0, 1.0),
        )
        assert made.weights.kind is WeightKind.SQUARE

    def test_piecewise_with_one_list_for_all_edges_and_one_for_each(self):
        shared = scenario(weights={"kind": "piecewise", "starts": [0, 1], "values": [2, 0], "cycle": 3})
        assert shared.weights.waveforms == (PiecewiseWeight((0.0, 1.0), (2.0, 0.0), 3.0),) * 2
        own = scenario(weights={"kind": "piecewise", "starts": [0, 1], "values": [[2, 0], [1, 1]]})
        assert own.weights.waveforms[1] == PiecewiseWeight((0.0, 1.0), (1.0, 1.0), None)
        assert own.weights.kind is WeightKind.PIECEWISE

    def test_samples_in_the_file_itself(self):
        made = scenario(weights={"kind": "sampled", "times": [0, 4, 10], "values": [[1, 0, 2], [0, 1, 0]]})
        assert made.weights.waveforms[0] == SampledWeight((0.0, 4.0, 10.0), (1.0, 0.0, 2.0))
        assert made.weights.kind is WeightKind.SAMPLED

    @pytest.mark.parametrize("suffix", ["csv", "npz"])
    @pytest.mark.parametrize("columns", [1, 2])
    def test_samples_in_another_file_next_to_the_scenario(self, tmp_path, suffix, columns):
        t = np.array([0.0, 1.5, 4.0])
        w = np.array([[1.0, 0.25], [0.0, 3.0], [2.0, 0.5]])[:, :columns]
        if suffix == "csv":
            rows = [",".join(map(repr, map(float, row))) for row in np.column_stack((t, w))]
            (tmp_path / "links.csv").write_text("\n".join(["time" + ",link" * columns, *rows, ""]))
        else:
            np.savez(tmp_path / "links.npz", t=t, w=w[:, 0] if columns == 1 else w)
        (tmp_path / "s.toml").write_text(
            'name = "s"\nstop_time = 20.0\n[network]\nagents = 3\nedges = [[1, 2], [2, 3]]\ninitial = [0, 1, 2]\n'
            f'[weights]\nkind = "sampled"\nfile = "links.{suffix}"\nrepeat = true\n'
            '[trigger]\nkind = "static"\nthreshold = 0.1\n'
        )
        first, second = load_scenario(tmp_path / "s.toml").weights.waveforms
        assert first == SampledWeight((0.0, 1.5, 4.0), (1.0, 0.0, 2.0), repeat=True)
        assert second == (first if columns == 1 else SampledWeight((0.0, 1.5, 4.0), (0.25, 3.0, 0.5), repeat=True))

    def test_functions_are_given_in_python(self):
        wave = FunctionWeight(lambda t: 1 + np.sin(t))
        base = scenario()
        made = Scenario("f", 10.0, base.network, Weights((wave, wave)), NoSwitching(2), base.trigger)
        assert made.weights.kind is WeightKind.FUNCTION
        assert len(closed_loop(made).parts) == 3


class TestSwitching:
    def test_the_kind_may_be_left_out_or_said(self):
        plain = {"dwell": 2.0, "active": [[1], [2]]}
        expected = SwitchingCycle(2.0, ((1,), (2,)), 2)
        assert scenario(switching=plain).switching == expected
        assert scenario(switching={"kind": "periodic", **plain}).switching == expected

    def test_sequence(self):
        made = scenario(switching={"kind": "sequence", "dwell": [7, 4], "active": [[1], [2]]}).switching
        assert made == SwitchingSequence((7.0, 4.0), ((1,), (2,)), 2)
        again = scenario(switching={"kind": "sequence", "dwell": 1, "active": [[1], [2]], "repeat": True}).switching
        assert again.period == 2.0

    @pytest.mark.parametrize(
        "table",
        [
            {"kind": "random-dwell", "active": [[1], [2]], "shortest": 0.5, "longest": 2},
            {"kind": "markov", "active": [[1], [2]], "transition": [[0, 1], [0.5, 0.5]], "shortest": 1},
            {"kind": "jointly-connected", "window": 1.5, "graphs": 2},
        ],
        ids=lambda table: table["kind"],
    )
    def test_random_ones_cover_the_run_and_depend_on_the_seed_only(self, table):
        one, same, other = (scenario(switching=table | {"seed": seed}).switching for seed in (4, 4, 5))
        assert one == same
        assert one != other
        assert one.domain[1] >= 10.0
        cyclic = scenario(switching=table | {"seed": 4, "duration": 3.0, "repeat": True}).switching
        assert cyclic.period == pytest.approx(3.0, rel=1e-15)


@pytest.mark.parametrize(
    ("table", "entries", "message"),
    [
        ("weights", {"kind": "sin"}, r"kind is 'sin'; .*Did you mean 'sine'\?"),
        ("weights", {"kind": "function"}, "kind is 'function'; it must name the function, as 'file.py:function'"),
        ("weights", {"kind": "sine", "mean": 1, "rate": 1}, "has no 'depth'"),
        ("weights", {"kind": "sine", "mean": 1, "rate": 1, "depth": 2}, "of edge 1: depth is 2.0; it must lie between"),
        ("weights", {"kind": "square", "high": 1, "rate": 1}, "has the unknown key 'rate'"),
        ("weights", {"kind": "piecewise", "starts": [0], "values": [[1]]}, "values lists 1 lists for 2 edges"),
        ("weights", {"kind": "piecewise", "starts": [0], "values": [[1], 2]}, r"values\[2\] is 2; it must be a list"),
        ("weights", {"kind": "piecewise", "starts": [0, 1], "values": [1]}, "values lists 1 numbers for 2 starts"),
        ("weights", {"kind": "sampled"}, "has no 'times'"),
        (
            "weights",
            {"kind": "sampled", "file": "x.csv", "times": [0, 1]},
            "times is 'given beside file'; it must be left out",
        ),
        (
            "weights",
            {"kind": "sampled", "times": [0, 20], "values": [1, 1], "repeat": 1},
            "repeat is 1; it must be true",
        ),
        ("weights", {"kind": "sampled", "times": [1, 20], "values": [1, 1]}, "is given from 1 s to 20 s"),
        ("switching", {"kind": "sequnce"}, r"kind is 'sequnce'; .*Did you mean 'sequence'\?"),
        (
            "switching",
            {"kind": "sequence", "dwell": [1, 2], "active": [[1], [2]]},
            r"\[switching\] is given from 0 s to 3 s, but the run goes from 0 s to 10 s; let dwell cover the run",
        ),
        ("switching", {"kind": "markov", "active": [[1]], "seed": 1}, "has no 'shortest'"),
        (
            "switching",
            {"kind": "markov", "active": [[1]], "seed": 1, "shortest": 1, "transition": [1]},
            r"transition\[1\] is 1; it must be a list of numbers",
        ),
        (
            "switching",
            {"kind": "markov", "active": [[1], [2]], "seed": 1, "shortest": 1, "transition": [[1, 0], [0, 2]]},
            r"\[switching\] transition\[2\] is \[0.0, 2.0\]; it must hold chances",
        ),
        ("switching", {"kind": "random-dwell", "active": [[1]], "shortest": 1, "longest": 2}, "has no 'seed'"),
        (
            "switching",
            {"kind": "jointly-connected", "window": 1, "graphs": 2.5, "seed": 1},
            "graphs is 2.5; it must be a wh",
        ),
        ("switching", {"kind": "periodic", "dwell": 1, "active": [[1]], "seed": 3}, "has the unknown key 'seed'"),
    ],
)
def test_refusals_name_the_entry_the_value_and_the_rule(table, entries, message):
    with pytest.raises(ScenarioError, match=message):
        read_scenario(BASE | {table: entries})


def test_edges_of_one_agent_need_one_block():
    base = scenario()
    kinds = (SineWeight(1.0, 0.5, 1.0), SineWeight(1.0, 0.5, 1.0))
    tables = (PiecewiseWeight((0.0, 1.0), (1.0, 2.0), 3.0), PiecewiseWeight((0.0, 1.0), (1.0, 2.0), math.sqrt(2) + 1))
    mixed = (PiecewiseWeight((0.0, 1.0), (1.0, 2.0), 3.0), PiecewiseWeight((0.0, 1.0), (1.0, 2.0)))
    maps = tuple(GatedSine(4.0, 5.0, 20.0, map=weight_map) for weight_map in WeightMap)
    for waveforms, message in (
        (maps, "need the blocks GatedAbsoluteSineWeights, GatedSineWeights; give all edges of an agent weights of one"),
        (tables, "repeat with the periods 3 s, 2.41421 s without a common multiple"),
        (mixed, "repeat with the periods 3 s, none without a common multiple"),
    ):
        made = Scenario("m", 10.0, base.network, Weights(waveforms), NoSwitching(2), base.trigger)
        with pytest.raises(ScenarioError, match=message):
            closed_loop(made)
    assert closed_loop(Scenario("m", 10.0, base.network, Weights(kinds), NoSwitching(2), base.trigger)).parts
