"""CasADi's import of FMUs: functions of Model Exchange with derivatives, for integrators and optimisation; no jumps."""

import shutil
from pathlib import Path

import casadi as ca
import fmpy
import numpy as np
import pytest

import hybrid_model as hm
from fmu.validate.check import check_fmu
from hybrid_model.models import BouncingBall

VERSIONS = ["2.0", "3.0"]


class Pendulum(hm.HybridAutomaton):
    """A pendulum with a motor."""

    theta = hm.State(0.3, output=True)
    omega = hm.State(-0.2)
    torque = hm.Input(0.0)
    length = hm.Parameter(0.7)
    height = hm.Output()

    def flow_map(self, s):
        return {"theta": s.omega, "omega": -9.81 / s.length * np.sin(s.theta) + s.torque}

    def outputs(self, s):
        return {"height": s.length * (1 - np.cos(s.theta)) + 0.5 * s.torque**2}


@pytest.fixture
def imported(exported, tmp_path):
    """CasADi's view of an automaton's FMU; it wants the archive unpacked."""

    def load(automaton, fmi, **options):
        path = exported(automaton, f"casadi-{automaton.name}", fmi, **options)
        folder = tmp_path / path.stem
        fmpy.extract(str(path), str(folder))
        return ca.DaeBuilder("plant", str(folder))

    return load


@pytest.mark.parametrize("fmi", VERSIONS)
def test_functions_and_jacobians_are_those_of_the_automaton(fmi, imported):
    plant = imported(Pendulum(), fmi)
    assert (plant.x(), plant.u(), plant.y()) == (["theta", "omega"], ["torque"], ["height", "theta"])
    assert plant.start(plant.x()) == [0.3, -0.2]
    function = plant.create("f", ["x", "u"], ["ode", "y"])
    theta, omega, torque = 0.8, -0.5, 0.6
    rates, outputs = function([theta, omega], [torque])
    # Rounding of the same expressions in C.
    np.testing.assert_allclose(np.ravel(rates), [omega, -9.81 / 0.7 * np.sin(theta) + torque], rtol=1e-14)
    np.testing.assert_allclose(np.ravel(outputs), [0.7 * (1 - np.cos(theta)) + 0.5 * torque**2, theta], rtol=1e-14)
    # From the FMU's directional derivatives.
    jacobian = function.jacobian()([theta, omega], [torque], 0, 0)
    expected = [
        [[0, 1], [-9.81 / 0.7 * np.cos(theta), 0]],
        [[0], [1]],
        [[0.7 * np.sin(theta), 0], [1, 0]],
        [[torque], [0]],
    ]
    for found, matrix in zip(jacobian, expected, strict=True):
        np.testing.assert_allclose(np.array(found), matrix, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_parameters_are_set_before_the_function_is_made(fmi, imported):
    plant = imported(Pendulum(), fmi)
    plant.set("length", 2.0)
    [rates] = [plant.create("f", ["x"], ["ode"])([0.8, -0.5])]
    assert float(rates[1]) == pytest.approx(-9.81 / 2.0 * np.sin(0.8), rel=1e-14)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_its_integrator_gives_the_python_run(fmi, imported):
    times = np.linspace(0.0, 3.0, 31)
    options = {"reltol": 1e-12, "abstol": 1e-12}
    integrator = ca.integrator("F", "cvodes", imported(Pendulum(), fmi).create("f"), 0.0, list(times[1:]), options)
    found = integrator(x0=[0.3, -0.2], u=np.full((1, 30), 0.4))["xf"]
    arc = hm.simulate(Pendulum(), 3.0, inputs={"torque": 0.4})
    np.testing.assert_allclose(np.array(found)[0], arc.at("theta", times[1:]), rtol=0, atol=1e-8)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_it_goes_on_with_the_flow_where_the_automaton_jumps(fmi, imported):
    """Its functions leave the indicators out: the ball falls through the floor, h(1) = 1 - g/2."""
    function = imported(BouncingBall(), fmi, clocks=False).create("f")
    assert function.numel_out("zero") == 0
    found = ca.integrator("F", "cvodes", function, 0.0, 1.0)(x0=[1.0, 0.0])["xf"]
    assert float(found[0]) == pytest.approx(1.0 - 9.81 / 2.0, abs=1e-6)
    assert hm.simulate(BouncingBall(), 1.0).end["h"] > 0


def test_output_clocks_it_reads_as_numbers(imported):
    """So FMUs with clocks are asked for their rates only, or exported without."""
    with_clocks, without = (imported(BouncingBall(), "3.0", clocks=clocks) for clocks in (True, False))
    assert (with_clocks.y(), without.y()) == (["h", "v", "impact"], ["h", "v"])
    np.testing.assert_array_equal(np.ravel(with_clocks.create("f", ["x"], ["ode"])([1.0, -2.0])), [-2.0, -9.81])
    np.testing.assert_array_equal(np.ravel(without.create("g", ["x"], ["y"])([1.0, -2.0])), [1.0, -2.0])
    with pytest.raises(RuntimeError, match="Evaluation failed"):
        with_clocks.create("h", ["x"], ["y"])([1.0, -2.0])


@pytest.mark.skipif(shutil.which("gcc") is None, reason="CasADi's compile_fmu needs gcc")
def test_validate_reads_its_own_export(tmp_path, monkeypatch):
    """A stranger's file; its code is left alone, for CasADi calls its export experimental and incomplete."""
    monkeypatch.chdir(tmp_path)
    ball = ca.DaeBuilder("ball")
    h, v = ball.add("h", {"start": 1.0}), ball.add("v", {"start": 0.0})
    ball.eq(ball.der(h), v)
    ball.eq(ball.der(v), -9.81)
    ball.when(h < 0, [ball.reinit("v", -0.8 * v)])
    headers = Path(fmpy.__file__).parent / "c-code"
    files = ball.compile_fmu(ball.export_fmu({"no_warning": True}), {"include_dirs": [str(headers)]})
    report = check_fmu(Path(ball.pack_fmu(files, {})), run=False)
    found = {finding.rule: finding.message for finding in report.findings}
    # The rate of h is v, a state; it is listed as an unknown of initialisation that depends on v, which is none.
    assert "'der(h)'" in found["structure.dependency"]
    # A manifest with a prefix of a name space that it does not declare.
    assert "fmi-ls-manifest.xml" in found["xml.syntax"]
