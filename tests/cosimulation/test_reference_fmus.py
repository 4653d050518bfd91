"""The FMI Reference FMUs of a folder that the environment names, against their published results; none is kept here.

The folder holds the FMUs, of both versions, and their tables: ``BouncingBall_out.csv`` and so on.
"""

import os
from pathlib import Path

import pytest

from cosim.cli.main import main

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
