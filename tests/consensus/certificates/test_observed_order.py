"""What a run shows stays on its side of the bounds also for mixed thresholds and for very short gaps."""

import pytest

import hybrid_model as hm
from hybrid_model.consensus.certificates.certify import certify
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.files import read_scenario


def pair(stop_time, initial, **trigger):
    network = {"agents": 2, "edges": [[1, 2]], "initial": [0.0, initial], "gain": 1.0}
    weights = {"kind": "constant", "value": 1.0}
    return read_scenario(
        {"name": "pair", "stop_time": stop_time, "network": network, "weights": weights, "trigger": trigger}
    )


@pytest.mark.parametrize("decay", [0.05, 1.0, 2.0, 3.0])
def test_the_passing_part_of_a_mixed_threshold_is_no_radius(decay):
    scenario = pair(10.0, 3.0, kind="mixed", offset=0.001, threshold=1.0, decay=decay)
    found = certify(scenario, hm.simulate(closed_loop(scenario), scenario.stop_time))
    assert found.value("radius", "observed") <= found.value("radius", "exact")


def test_a_gap_of_a_microsecond_is_observed_as_it_is():
    scenario = pair(2e-4, 1000.0, kind="static", threshold=1e-3)
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    found = certify(scenario, arc)
    assert found.value("min_gap", "observed") == run_report(scenario, arc).min_gap
    assert found.value("min_gap", "improved") <= found.value("min_gap", "observed")
