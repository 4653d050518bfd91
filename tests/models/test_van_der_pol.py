"""Van der Pol's oscillator against periods of the literature, and against times of collocation in 113 bits."""

import math

import numpy as np
import pytest
from stiff_systems import RISES

import hybrid_model as hm
from hybrid_model.models import VanDerPol

WEAK = 6.6632868593231301897
"""Period in s for damping 1: Andersen and Geer (1982)."""


def test_the_period_is_that_of_the_power_series():
    arc = hm.simulate(VanDerPol(damping=1.0), 60.0)
    rises = arc.event_times("rise")
    # The start lies beside the cycle, which attracts by exp(-7) a period.
    assert np.diff(rises)[3:] == pytest.approx(WEAK, abs=1e-10)
    assert arc.end["period"] == pytest.approx(WEAK, abs=1e-10)
    assert arc.end["last"] == rises[-1]


def test_rises_of_a_start_beside_the_cycle():
    arc = hm.simulate(VanDerPol(damping=10.0), 38.0)
    assert arc.event_times("rise") == pytest.approx(RISES[10.0], abs=1e-10)


def test_it_is_declared_stiff():
    assert VanDerPol().stiff is True


@pytest.mark.parametrize("damping", [1e3, 1e4])
def test_the_exact_times_have_the_asymptotic_period(damping):
    period = np.diff(RISES[damping])[-1]
    expected = (3.0 - 2.0 * math.log(2.0)) * damping + 7.01432 * damping ** (-1.0 / 3.0)
    # The next terms: -(2/3) ln(damping)/damping - 1.3246/damping.
    assert period - expected == pytest.approx(-(2.0 / 3.0 * math.log(damping) + 1.3246) / damping, rel=0.05)
