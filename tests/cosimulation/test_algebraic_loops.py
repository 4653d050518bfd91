"""Signals that depend on each other at once, iterated on request: y1 = a u1 + w, y2 = c u2 + d at all times."""

import contextlib

import numpy as np
import pytest

import hybrid_model as hm
from cosim import rounds
from cosim.automaton_slave import AutomatonSlave
from cosim.cli.main import main
from cosim.errors import CosimError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_error_controlled, run_fixed_step
from cosim.masters.changes import Curve
from cosim.system import System

FIRST, SECOND, SHIFT = 0.5, -0.8, 2.0
WIRES = {"second.u": "first.y", "first.u": "second.y"}
ROUNDING = 1e-13
"""The loop's gain is 0.4, and a signal that changes by less than 1e-14 has settled."""


class Affine(hm.HybridAutomaton):
    u = hm.Input(0.0)
    w = hm.Input(0.0)
    y = hm.Output()
    gain = hm.Parameter(1.0)

    def outputs(self, s):
        return {"y": s.gain * s.u + s.w}


@pytest.fixture(params=[("3.0", "2.0"), ("3.0", "3.0"), ("2.0", "2.0"), None], ids=str)
def pair(request, exported):
    """Two blocks in a loop: FMUs of both versions, and automata in this process."""

    def made(first=FIRST, second=SECOND, iterations=100):
        slaves = [
            AutomatonSlave(name, Affine())
            if request.param is None
            else FmuSlave(name, exported(Affine(), "affine", request.param[k]))
            for k, name in enumerate(("first", "second"))
        ]
        for slave, gain in zip(slaves, (first, second), strict=True):
            slave.set("gain", gain)
        slaves[1].set("w", SHIFT)
        return System(slaves, WIRES, loop_iterations=iterations)

    return made


@contextlib.contextmanager
def without_c():
    with pytest.MonkeyPatch.context() as without:
        without.setenv("CC", "/there/is/none")
        rounds._library.cache_clear()
        yield
    rounds._library.cache_clear()


@pytest.mark.parametrize("order", ["jacobi", "gauss-seidel"])
@pytest.mark.parametrize("in_c", [True, False])
def test_every_row_solves_the_loop(order, in_c, pair):
    given = {"first.w": Curve(np.sin)}
    with contextlib.nullcontext() if in_c else without_c():
        system = pair()
        result = run_fixed_step(system, 2.0, 0.1, record=["second.y", "first.y"], inputs=given, order=order)
    assert len(result.times) == 21
    first = (FIRST * SHIFT + np.sin(result.times)) / (1.0 - FIRST * SECOND)
    np.testing.assert_allclose(result.signals["first.y"], first, rtol=ROUNDING, atol=ROUNDING)
    np.testing.assert_allclose(result.signals["second.y"], SECOND * first + SHIFT, rtol=ROUNDING, atol=ROUNDING)
    assert result.final["first.y"] == result.signals["first.y"][-1]


def test_without_the_request_each_step_goes_round_once(pair):
    result = run_fixed_step(pair(0.0, 0.0, 0), 1.0, 0.5, record=["first.y"], inputs={"first.w": Curve(np.cos)})
    assert result.signals["first.y"] == pytest.approx(np.cos([0.0, 0.0, 0.5]))


@pytest.mark.parametrize(
    "run", [lambda s, **k: run_fixed_step(s, 1.0, 0.5, **k), lambda s, **k: run_error_controlled(s, 1.0, **k)]
)
def test_a_loop_that_does_not_settle_is_told_with_its_values(run, pair):
    """y1 = 2 y2 + w and y2 = -y1: y1 is w/3, and going round doubles the distance to it. At w = 0 it is at rest."""
    system = pair(2.0, -1.0, 10)
    system.slaves["second"].set("w", 0.0)
    said = r"do not settle in 13 rounds: .*first.y -> second.u \(last [-0-9.e]+, before it [-0-9.e]+\).* form a loop"
    with pytest.raises(CosimError, match=r"the signals at t = 0.* " + said):
        run(system, inputs={"first.w": Curve(lambda t: max(0.0, t - 0.3))})
    with pytest.raises(CosimError, match="the start values " + said):
        run(pair(2.0, -1.0, 10))


def test_one_that_runs_away_ends_where_numbers_do(pair):
    with pytest.raises(CosimError, match=r"do not settle in \d+ rounds: .* form a loop"):
        run_fixed_step(pair(1e10, 1e10, 1000), 1.0, 0.5)


def test_the_command_iterates_it(tmp_path, capsys):
    (tmp_path / "affine.py").write_text(
        "import hybrid_model as hm\n\n\nclass Affine(hm.HybridAutomaton):\n"
        "    u = hm.Input(0.0)\n    w = hm.Input(0.0)\n    y = hm.Output()\n    gain = hm.Parameter(0.5)\n\n"
        '    def outputs(self, s):\n        return {"y": s.gain * s.u + s.w}\n'
    )
    (tmp_path / "system.toml").write_text(
        '[experiment]\nstop_time = 1.0\nmaster = "fixed-step"\n'
        '[components.first]\nautomaton = "affine.py:Affine"\n[components.second]\nautomaton = "affine.py:Affine"\n'
        '[connections]\n"second.u" = "first.y"\n"first.u" = "second.y"\n[inputs]\nfile = "in.csv"\n'
    )
    (tmp_path / "in.csv").write_text("time,first.w\n0,1\n1,3\n")
    assert main(["cosim", str(tmp_path), "--loop-iterations", "100"]) == 0
    assert "first.y = 4\n" in capsys.readouterr().out
