"""What `certify` says where a hypothesis fails: which one, where and when; and the same lookups in every case."""

import math

import numpy as np
import pytest
from certified import CONSTANT, coarse, failed, network, run_of

from hybrid_model.consensus.certificates.analysis import analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.certify import certify

TWO_PAIRS = {"edges": [[1, 2], [3, 4]], "weights": CONSTANT}


class TestDisconnectedUnions:
    def test_a_weak_edge_that_counts_as_absent_is_named(self):
        found = coarse(network([[1, 2], [2, 3]], {"kind": "constant", "value": [1.0, 1e-13]}))
        assert "Edge 2 carries less than a share of 1e-12" in failed(found)["connected union"]
        assert not any("never moves" in note for note in found.notes)
        assert any(note.startswith("Agent 3 by itself") for note in found.notes)

    def test_an_edge_of_weight_zero_is_not_called_weak(self):
        found = coarse(network([[1, 2], [2, 3]], {"kind": "constant", "value": [1.0, 0.0]}))
        assert "1e-12" not in failed(found)["connected union"]
        assert any("Agent 3 never moves" in note for note in found.notes)

    def test_each_part_names_the_hypothesis_that_fails_for_it(self):
        weights = {"kind": "constant", "value": [1.0, 0.1]}
        trigger = {"kind": "dynamic", "threshold": 0.3, "decay": 1.0}
        found = coarse(network([[1, 2], [3, 4]], weights, agents=4, trigger=trigger))
        # The rates are 2 and 0.2: beta is above the second only.
        notes = [note for note in found.notes if "'beta below the Floquet rate' fails" in note]
        assert len(notes) == 1
        assert notes[0].startswith("Agents 3, 4 by themselves: hypothesis")
        assert "beta is 1/s, the Floquet rate 0.2/s" in notes[0]

    def test_every_lookup_of_a_connected_network_is_there(self):
        whole = coarse(network([[1, 2], [2, 3]], CONSTANT))
        parts = coarse(network(**TWO_PAIRS))
        assert [(v.quantity, v.form) for v in parts.values] == [(v.quantity, v.form) for v in whole.values]
        assert [v.unit for v in parts.values] == [v.unit for v in whole.values]
        assert parts.value("radius", "improved") is None
        with pytest.raises(KeyError, match="no imagined radius"):
            parts.value("radius", "imagined")


class TestSampledChecks:
    SLOW = {"kind": "sampled", "threshold": 0.3, "period": 0.5}  # noqa: RUF012

    def test_the_reason_why_no_bound_on_the_errors_exists(self):
        found = coarse(network([[1, 2], [2, 3]], CONSTANT, trigger=self.SLOW))
        detail = failed(found)["bounded errors"]
        assert "checks every 0.5 s" in detail
        slope = float(detail.split("factor ")[1].split(",")[0])
        # Agent 2 has two edges: h k omega (sqrt(2) R + 4); R is the exact radius or the energy bound for c = 1.
        radius = coarse(network([[1, 2], [2, 3]], CONSTANT)).value("radius", "exact") / 0.3
        assert slope == pytest.approx(0.5 * (math.sqrt(2) * radius + 4), rel=0.02)
        assert slope >= 1
        assert found.value("radius", "exact") is None
        assert any("'bounded errors' fails" in note for note in found.notes)

    def test_beta_above_the_rate_is_the_reason_then(self):
        trigger = {"kind": "sampled", "threshold": 0.3, "period": 0.01, "decay": 2.0}
        found = coarse(network([[1, 2], [2, 3]], CONSTANT, trigger=trigger))
        assert "beta" in failed(found)["bounded errors"]

    def test_a_short_period_bounds_the_errors(self):
        found = coarse(network([[1, 2], [2, 3]], CONSTANT, trigger={**self.SLOW, "period": 0.01}))
        assert "bounded errors" not in failed(found)

    @pytest.mark.parametrize("period", [0.004, 0.1 / 3, 0.07])
    def test_gaps_are_whole_numbers_of_periods(self, period):
        """No tolerance: checks are at known times, so the order holds exactly."""
        trigger = {"kind": "sampled", "threshold": 0.02, "period": period}
        scenario = network([[1, 2], [2, 3]], {"kind": "constant", "value": 3.0}, trigger=trigger, stop_time=2.0)
        found = coarse(scenario, run_of(scenario))
        observed = found.value("min_gap", "observed")
        assert observed % period in (0.0, pytest.approx(0.0), pytest.approx(period))
        known = [found.value("min_gap", form) for form in ("valid", "improved")]
        order = [gap for gap in known if gap is not None] + [observed]
        assert order == sorted(order)


class TestWindowsWithoutExcitation:
    def test_the_edge_and_the_window_are_named(self):
        # Edge 2 carries nothing from 2 s to 4 s of each 5 s; a window of 1.5 s fits in.
        weights = {
            "kind": "piecewise",
            "starts": [0.0, 2.0, 4.0],
            "values": [[1.0, 1.0, 1.0], [1.0, 0.0, 1.0]],
            "cycle": 5.0,
        }
        found = certify(network([[1, 2], [2, 3]], weights), window=1.5, resolution=0.05)
        detail = failed(found)["exciting tree"]
        start, end = (float(text.split(" s")[0]) for text in (detail.split("from t = ")[1], detail.split(" to ")[1]))
        assert end - start == pytest.approx(1.5)
        assert start >= 2.0
        assert end <= 4.0
        assert "edge 2" in detail
        assert "edge 1" not in detail
        detail = failed(found)["persistent excitation"]
        assert "{1, 2} and {3}" in detail

    def test_with_the_period_as_window_both_hold(self):
        weights = {"kind": "piecewise", "starts": [0.0, 2.0], "values": [[1.0, 0.0], [0.0, 1.0]], "cycle": 5.0}
        assert not failed(coarse(network([[1, 2], [2, 3]], weights)))

    def test_without_a_period(self):
        # Weight ends at 2 s: late windows hold nothing.
        weights = {"kind": "piecewise", "starts": [0.0, 2.0], "values": [[1.0, 0.0]]}
        found = coarse(network([[1, 2]], weights, agents=2, stop_time=20.0))
        detail = failed(found)["persistent excitation"]
        assert "no edge carries weight" in detail
        assert float(detail.split("from t = ")[1].split(" s")[0]) >= 2.0


class TestLongCycles:
    SLOW = {"kind": "sine", "mean": 1.0, "depth": 0.5, "rate": 0.02, "phase": [0.0, 0.3]}  # noqa: RUF012

    def test_the_floquet_rate_keeps_its_digits(self):
        """One edge: twice the mean weight. Two edges, slow weights: the mean of the least eigenvalue."""
        weights = {"kind": "sine", "mean": 1.0, "depth": 0.5, "rate": 0.02}
        assert Bounds(analyse(network([[1, 2]], weights))).floquet_rate == pytest.approx(2.0, rel=1e-9)
        bounds = Bounds(analyse(network([[1, 2], [2, 3]], self.SLOW)))
        t = np.linspace(0.0, 100 * math.pi, 4001)[:-1]
        first, second = (1 + 0.5 * np.sin(0.02 * t - phase) for phase in (0.0, 0.3))
        least = first + second - np.sqrt(first**2 + second**2 - first * second)
        # The eigenvectors turn slowly, at 0.02 rad/s against rates of order 1.
        assert bounds.floquet_rate == pytest.approx(float(least.mean()), rel=2e-3)
        assert bounds.floquet_overshoot >= 1.0

    def test_fewer_cells_are_said(self):
        found = certify(network([[1, 2]], {**self.SLOW, "rate": 0.001, "phase": 0.0}))
        note = next(note for note in found.notes if "from below" in note)
        assert "in place of 0.01" in note
        order = [found.value("radius", form) for form in ("exact", "energy", "improved", "valid")]
        assert order == sorted(order)


def test_the_exact_radius_says_that_it_is_reached_from_below():
    found = coarse(network([[1, 2], [2, 3]], CONSTANT))
    source = next(v.source for v in found.values if (v.quantity, v.form) == ("radius", "exact"))
    assert "from below" in source
