"""Product, series and feedback are compositions with the usual wires."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import BouncingBall, Thermostat


class Lag(hm.HybridAutomaton):
    """y' = u - y."""

    u = hm.Input(0.0)
    y = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"y": s.u - s.y}


class Gain(hm.HybridAutomaton):
    u = hm.Input(0.0)
    k = hm.Parameter(2.0)
    y = hm.Output()

    def outputs(self, s):
        return {"y": s.k * s.u}


def test_a_product_runs_its_parts_apart():
    arc = hm.simulate(hm.product("pair", BouncingBall("ball"), Thermostat("room")), 2.0)
    alone = hm.simulate(BouncingBall(), 2.0)
    assert [jump.t for jump in arc.jumps if jump.name == "ball.jump"] == pytest.approx(
        [jump.t for jump in alone.jumps], abs=1e-11
    )


def test_series_of_two_lags():
    chain = hm.series("chain", Lag("first", u=1.0), Lag("second"), {"u": "y"})
    arc = hm.simulate(chain, 3.0, inputs={"first.u": 1.0})
    # Two equal lags in a row: 1 - (1 + t) exp(-t).
    assert arc.end["second.y"] == pytest.approx(1.0 - 4.0 * np.exp(-3.0), abs=1e-12)


def test_feedback_of_a_lag_by_a_gain():
    loop = hm.feedback("loop", Lag("plant", y=1.0), Gain("controller", k=-2.0), {"u": "y"}, {"u": "y"})
    assert hm.simulate(loop, 1.5).end["plant.y"] == pytest.approx(np.exp(-4.5), abs=1e-12)


def test_an_algebraic_loop_is_refused_with_its_names():
    with pytest.raises(hm.AlgebraicLoopError, match="left -> right -> left"):
        hm.feedback("loop", Gain("left"), Gain("right"), {"u": "y"}, {"u": "y"})


def test_equal_names_are_refused():
    with pytest.raises(hm.WiringError, match="give each a name of its own"):
        hm.product("pair", Lag(), Lag())
