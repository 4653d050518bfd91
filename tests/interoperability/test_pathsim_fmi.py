"""pathsim-fmi: FMUs as blocks of PathSim, Co-Simulation and Model Exchange.

It reads and writes real variables only, so models with whole numbers or clocks among inputs and outputs are not for it;
of our FMI 3.0 FMUs these are all that predict their events, for that is told by an input clock.
"""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import BouncingBall

reason = "pathsim-fmi is not installed: pip install -e .[interop]"
pathsim = pytest.importorskip("pathsim", reason=reason)
blocks = pytest.importorskip("pathsim_fmi", reason=reason)
solvers = pytest.importorskip("pathsim.solvers", reason=reason)


class DrivenBall(hm.HybridAutomaton):
    """A ball on a table whose height is an input: its events cannot be predicted, so it has no clocks."""

    table = hm.Input(0.0)
    h = hm.State(1.0, output=True)
    v = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"h": s.v, "v": -9.81}

    def jump_set(self, s):
        return hm.least(s.table - s.h, -s.v)

    def jump_map(self, s):
        return {"v": -0.7 * s.v}


def simulate(block, t_stop, dt, inputs=()):
    scope = pathsim.blocks.Scope()
    wires = [pathsim.Connection(block[k], scope[k]) for k in range(2)]
    wires += [pathsim.Connection(source, block[k]) for k, source in enumerate(inputs)]
    simulation = pathsim.Simulation(
        [*inputs, block, scope],
        wires,
        dt=dt,
        Solver=solvers.RKDP87,
        tolerance_lte_abs=1e-12,
        tolerance_lte_rel=1e-10,
        log=False,
    )
    simulation.run(t_stop)
    times, values = scope.read()
    return np.array(times), np.array(values)


def test_ball_by_model_exchange_is_the_python_run(exported):
    block = blocks.ModelExchangeFMU(str(exported(BouncingBall(), "ball", "2.0")))
    times, (h, v) = simulate(block, 2.0, 0.01)
    arc = hm.simulate(BouncingBall(), 2.0)
    # PathSim locates an event to 1e-10 s; at an impact h is continuous, v has two sides.
    np.testing.assert_allclose(h, arc.at("h", np.minimum(times, 2.0)), rtol=0, atol=1e-8)
    quiet = np.min(np.abs(times[:, None] - [jump.t for jump in arc.jumps]), axis=1) > 1e-8
    np.testing.assert_allclose(v[quiet], arc.at("v", np.minimum(times[quiet], 2.0)), rtol=0, atol=1e-8)
    assert len(arc.jumps) >= 4


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_driven_ball_by_model_exchange_of_both_versions(fmi, exported):
    """The table moves within PathSim; the reference moves the same table in Python."""
    block = blocks.ModelExchangeFMU(str(exported(DrivenBall(), "driven_ball", fmi)))
    table = pathsim.blocks.Source(lambda t: 0.1 * np.sin(3.0 * t))
    times, (h, _) = simulate(block, 1.5, 0.01, [table])
    arc = hm.simulate(DrivenBall(), 1.5, inputs={"table": hm.Signal(lambda t: 0.1 * np.sin(3.0 * t))})
    np.testing.assert_allclose(h, arc.at("h", np.minimum(times, 1.5)), rtol=0, atol=1e-7)
    assert len(arc.jumps) >= 2


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_cosimulation_is_one_step_ahead_of_its_own_time(fmi, exported):
    """pathsim-fmi steps at t to t + dt and shows at t what it has then; the values are exact there."""
    block = blocks.CoSimulationFMU(str(exported(DrivenBall(), "driven_ball", fmi)), dt=0.01)
    times, (h, _) = simulate(block, 1.5, 0.01, [pathsim.blocks.Constant(0.0)])
    arc = hm.simulate(DrivenBall(), 1.6)
    inner = times[(times > 0.005) & (times < 1.495)]
    np.testing.assert_allclose(h[(times > 0.005) & (times < 1.495)], arc.at("h", inner + 0.01), rtol=0, atol=1e-8)


def test_what_it_cannot_load_it_refuses(exported):
    """The countdown clock of the next event is an input; pathsim-fmi sets it as a real number."""
    block = blocks.ModelExchangeFMU(str(exported(BouncingBall(), "ball", "3.0")))
    with pytest.raises(Exception, match="fmi3SetFloat64 failed"):
        simulate(block, 0.1, 0.01)
