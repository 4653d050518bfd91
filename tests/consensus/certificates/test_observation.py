"""What a run shows stays on its side of the bounds: mixed thresholds, sampled checks, fast weights, short gaps."""

import pytest
from certified import CONSTANT, network, path, run_of

from hybrid_model.consensus.certificates.certify import certify
from hybrid_model.consensus.runs.report import run_report


def shown(weights, trigger, initial, stop_time):
    """Certificates of a path of agents under a trigger, beside its run."""
    scenario = network(path(len(initial)), weights, trigger=trigger, initial=initial, stop_time=stop_time)
    return certify(scenario, run_of(scenario))


@pytest.mark.parametrize("decay", [0.05, 1.0, 2.0, 3.0])
def test_the_passing_part_of_a_mixed_threshold_is_no_radius(decay):
    trigger = {"kind": "mixed", "offset": 0.001, "threshold": 1.0, "decay": decay}
    found = shown(CONSTANT, trigger, [0.0, 3.0], 10.0)
    assert found.value("radius", "observed") <= found.value("radius", "exact")


def test_a_gap_of_a_microsecond_is_observed_as_it_is():
    trigger = {"kind": "static", "threshold": 1e-3}
    scenario = network([[1, 2]], CONSTANT, trigger=trigger, initial=[0.0, 1000.0], stop_time=2e-4)
    arc = run_of(scenario)
    found = certify(scenario, arc)
    assert found.value("min_gap", "observed") == run_report(scenario, arc).min_gap
    assert found.value("min_gap", "improved") <= found.value("min_gap", "observed")


def test_weights_without_corners_hide_no_shorter_gap():
    """Fast sine weights: the most that an edge carries in a gap lies between the starts of a coarse search."""
    weights = {"kind": "sine", "mean": 0.05, "depth": 1.0, "rate": 50.0, "phase": 0.7853981633974483}
    found = shown(weights, {"kind": "static", "threshold": 0.0002}, [1.0, 0.0], 0.3)
    assert found.value("min_gap", "valid") <= found.value("min_gap", "improved") <= found.value("min_gap", "observed")


def test_sampled_checks_broadcast_from_the_threshold_on():
    """Errors overshoot the threshold between checks, but a broadcast needs no more than the threshold."""
    trigger = {"kind": "sampled", "threshold": 0.3, "period": 0.02}
    found = shown(CONSTANT, trigger, [100.0, 0.0], 2.0)
    # The observed gap is reported less the tolerance of its two times.
    assert found.value("min_gap", "improved") <= found.value("min_gap", "observed") + 1e-8


def test_the_observed_radius_of_a_mixed_threshold_is_that_of_its_lasting_part():
    trigger = {"kind": "mixed", "offset": 0.1, "threshold": 0.5, "decay": 0.3}
    found = shown(CONSTANT, trigger, [1.0, 0.0, 2.0], 40.0)
    assert 0.0 < found.value("radius", "observed") <= found.value("radius", "exact")


def test_a_mixed_threshold_that_decays_fast_is_promised_no_consensus():
    trigger = {"kind": "mixed", "offset": 0.1, "threshold": 0.5, "decay": 3.0}
    found = shown(CONSTANT, trigger, [1.0, 0.0], 6.0)
    assert not any("onsensus is still reached" in note or "still ||x_e(t)||" in note for note in found.notes)
