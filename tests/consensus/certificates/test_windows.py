"""The best window: a search against fine grids, published rates, windows by hand."""

import math

import numpy as np
import pytest
from catalogue_weights import ring

from hybrid_model.consensus.certificates.rates import tree_free_rate
from hybrid_model.consensus.certificates.tree_bound import BoundForm, convergence_bound
from hybrid_model.consensus.certificates.windows import (
    RateForm,
    best_window,
    rate_over_window,
    search_window,
)
from hybrid_model.consensus.exact.floquet import floquet_spectrum
from hybrid_model.consensus.excitation.persistence import (
    Signal,
    scenario_excitation,
)
from hybrid_model.consensus.scenario.files import load_scenario


class TestBestWindow:
    def test_rates_over_a_window_are_those_of_the_certificates(self):
        scenario = load_scenario("paper-a")
        for window in (2 * math.pi, 5.0):
            for form, rate in ((RateForm.PRINTED, BoundForm.PRINTED), (RateForm.VALID, BoundForm.VALID)):
                expected = convergence_bound(scenario, rate, window=window).rate
                assert rate_over_window(scenario, form, window) == pytest.approx(expected, rel=1e-12)
            constants = scenario_excitation(scenario, Signal.DISAGREEMENT, window=window)
            assert rate_over_window(scenario, RateForm.IMPROVED, window) == pytest.approx(
                tree_free_rate(constants, 1.0), rel=1e-12
            )

    def test_published_rates_of_scenario_a_and_a_larger_window_that_is_worse(self):
        # Audit, sections 8 and 10; windows from the theorem of Van der Waerden are worse than one cycle.
        scenario = load_scenario("paper-a")
        rates = [rate_over_window(scenario, form, 2 * math.pi) for form in RateForm]
        assert rates == pytest.approx([4.8108e-4, 1.2112e-4, 9.5818e-3], rel=5e-5)
        assert rate_over_window(scenario, RateForm.PRINTED, 3 * math.pi) == pytest.approx(1.486e-4, rel=5e-4)

    @pytest.mark.parametrize("name", ["paper-a", "paper-a-dwell-two-pi"])
    def test_the_best_window_beats_a_fine_grid_and_stays_below_the_exact_rate(self, name):
        scenario = load_scenario(name)
        best = best_window(scenario, RateForm.IMPROVED)
        period = scenario.edge_weights.period
        grid = [rate_over_window(scenario, RateForm.IMPROVED, float(T)) for T in np.linspace(0.05, 1.2, 24) * period]
        # Between two points of either grid the rate of scenario A changes by less than a hundredth.
        assert best.rate >= 0.99 * max(grid)
        assert best.rate >= rate_over_window(scenario, RateForm.IMPROVED, period)
        assert best.rate == pytest.approx(rate_over_window(scenario, RateForm.IMPROVED, best.window), rel=1e-12)
        assert best.rate <= floquet_spectrum(scenario).rate

    def test_a_shorter_window_is_half_as_good_again_in_scenario_a(self):
        best = best_window(load_scenario("paper-a"), RateForm.IMPROVED)
        assert best.window == pytest.approx(1.632, abs=2e-3)
        assert best.rate == pytest.approx(0.014716, rel=1e-3)

    def test_any_formula_can_be_maximised(self):
        best = search_window(lambda T: math.exp(-((T - 2.3456) ** 2)), 0.1, 10.0)
        assert best.window == pytest.approx(2.3456, abs=1e-4)  # a maximum to rounding is flat over 1e-8
        assert search_window(lambda T: float(T == 3.25), 0.1, 10.0, [3.25]).window == 3.25
        assert search_window(lambda T: 0.0, 0.1, 10.0).rate == 0.0
        with pytest.raises(ValueError, match="is not one of windows"):
            search_window(lambda T: T, 2.0, 1.0)

    def test_constant_weights_need_a_range(self):
        scenario = ring()
        with pytest.raises(ValueError, match="a shorter window always gives a better rate"):
            best_window(scenario, RateForm.VALID)
        assert best_window(scenario, RateForm.VALID, shortest=0.01, longest=1.0).window == 0.01
