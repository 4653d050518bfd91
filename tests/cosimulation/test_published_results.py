"""The FMI Reference FMUs of a folder that the environment names, against their published results; none is kept here.

The folder holds the FMUs, of both versions, and their tables: ``BouncingBall_out.csv`` and so on.
"""

import os
from pathlib import Path

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.cli.main import main
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_error_controlled, run_fixed_step
from cosim.system import System
from hybrid_model.models import BouncingBall
from hybrid_model.models.ball_on_moving_table import BallOnMovingTable

FOLDER = os.environ.get("HYBRID_FMU_REFERENCE_FMUS")
TABLES = {path.name.removesuffix("_out.csv"): path for path in Path(FOLDER).rglob("*_out.csv")} if FOLDER else {}
FMUS = sorted(path for path in Path(FOLDER).rglob("*.fmu") if path.stem in TABLES) if FOLDER else []
CLOCKS = sorted(Path(FOLDER).rglob("Clocks.fmu")) if FOLDER else []

pytestmark = pytest.mark.skipif(not FMUS, reason="HYBRID_FMU_REFERENCE_FMUS names no folder with FMUs and tables")


@pytest.mark.parametrize("path", FMUS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_a_run_with_the_default_options_is_the_published_one(path, capsys):
    """Both step their own forward Euler, so they agree to rounding."""
    status = main(["cosim", str(path), "--reference-file", str(TABLES[path.stem]), "--reference-tolerance", "1e-12"])
    said = capsys.readouterr()
    if path.stem == "Roberts":
        pytest.skip("it claims an event mode that its binary refuses")
    assert status == 0, said.out + said.err
    if path.stem == "Stair":
        assert "Stair ended the run at t = 9 s" in said.out


@pytest.mark.parametrize("path", [path for path in FMUS if path.stem == "Feedthrough"], ids=lambda p: p.parent.name)
def test_inputs_from_a_file_come_out(path, tmp_path, capsys):
    table = tmp_path / "in.csv"
    table.write_text("time,Int32_input,Boolean_input,Float64_continuous_input\n0,-7,true,0\n1,2147483647,false,2\n")
    assert main(["cosim", str(path), "--input-file", str(table), "--stop-time", "1.5"]) == 0
    said = capsys.readouterr().out
    for line in ("Int32_output = 2147483647", "Boolean_output = false", "Float64_continuous_output = 2"):
        assert f"Feedthrough.{line}\n" in said


@pytest.mark.parametrize("path", CLOCKS, ids=lambda path: path.parent.name)
def test_scheduled_execution_is_refused(path, capsys):
    assert main(["cosim", str(path)]) == 1
    assert "Scheduled Execution" in capsys.readouterr().err


@pytest.mark.parametrize("path", [path for path in FMUS if path.stem == "Feedthrough"], ids=lambda p: p.parent.name)
def test_a_ball_falls_on_a_ball_that_is_seen_through_feedthrough(path):
    parts = {"first": BouncingBall(), "second": BallOnMovingTable(h=1.2)}
    wires = {"second.table": "first.h", "second.table_velocity": "first.v"}
    expected = hm.simulate(hm.Composition("two", parts, wires), 1.6).event_times("second.jump")
    slaves = [AutomatonSlave("first", parts["first"]), FmuSlave("h", path), FmuSlave("v", path)]
    slaves.append(AutomatonSlave("second", parts["second"]))
    wires = {"second.table": "h.Float64_continuous_output", "second.table_velocity": "v.Float64_continuous_output"}
    wires |= {"h.Float64_continuous_input": "first.h", "v.Float64_continuous_input": "first.v"}
    result = run_error_controlled(System(slaves, wires), 1.6)
    np.testing.assert_allclose(result.event_times("second"), expected, atol=1e-7, rtol=0)


@pytest.mark.parametrize("path", [path for path in FMUS if path.stem == "StateSpace"], ids=lambda p: p.parent.name)
def test_two_in_a_loop(path):
    """x' = -x/2 + u; u is the other's x at the beginning of each step of 1 s, and one has 2 more."""
    slaves = [FmuSlave("a", path), FmuSlave("b", path)]
    for slave in slaves:
        for k in range(1, 4):
            slave.set(f"A[{k},{k}]", -0.5)
            slave.set(f"D[{k},{k}]", 0.0)
    slaves[0].set("B[1,2]", 1.0)
    result = run_fixed_step(System(slaves, {"b.u[1]": "a.y[1]", "a.u[1]": "b.y[1]"}), 5.0, 1.0)
    x = np.zeros(2)
    for _ in range(5):
        x = np.exp(-0.5) * x + 2.0 * (1.0 - np.exp(-0.5)) * (x[::-1] + np.array([2.0, 0.0]))
    assert [result.final["a.y[1]"], result.final["b.y[1]"]] == pytest.approx(
        list(x), rel=1e-3
    )  # it steps by forward Euler


@pytest.mark.parametrize("path", FMUS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_by_model_exchange_it_is_the_solution(path, capsys):
    """The published results are by forward Euler; here the flow is integrated and events are located."""
    if path.stem == "Roberts":
        pytest.skip("it claims an event mode that its binary refuses")
    assert main(["cosim", str(path), "--interface", "me"]) == 0
    said = capsys.readouterr().out
    known = {
        "BouncingBall": "at 0.451523641, 1.08365674, 1.52614991",
        "Dahlquist": "Dahlquist.x = 4.539992",  # exp(-10)
        "Resource": "Resource.y = 97",
        "Stair": "Stair: 9 events at 1, 2, 3, 4",
        "StateSpace": "StateSpace.y[1] = 22026.46579",  # exp(10)
        "VanDerPol": "VanDerPol.x0 = 2.00814976",
    }
    assert known.get(path.stem, "reached t = 2 s") in said
