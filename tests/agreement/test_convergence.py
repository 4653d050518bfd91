"""The FMU's event location against the exact impact times, whatever the communication step."""

import numpy as np
import pytest

from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.system import System
from hybrid_model.models import BouncingBall


@pytest.mark.parametrize("interval", [0.01, 0.1, None])
def test_impacts_are_located_to_rounding(interval, exported):
    ball = FmuSlave("ball", exported(BouncingBall(), "ball"))
    result = run_event_exact(System([ball], {}), 2.4, output_interval=interval)
    first = np.sqrt(2 / 9.81)
    # The k-th impact is at t1 (1 + 2 (e + e^2 + ... + e^(k-1))).
    exact = [first * (1 + 2 * sum(0.7**i for i in range(1, k))) for k in range(1, 50)]
    times = result.tick_times("ball", "impact")
    assert len(times) == sum(t <= 2.4 for t in exact)
    np.testing.assert_allclose(times, exact[: len(times)], rtol=0, atol=1e-12)
