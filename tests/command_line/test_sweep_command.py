"""`hybrid-fmu sweep` as its users see it."""

import argparse
import csv
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from small_scenario import small_scenario

from cosim.cli.main import main
from cosim.cli.options import sweep
from hybrid_model.consensus.sweeps.axes import read_axis
from hybrid_model.consensus.sweeps.execute import run_sweep
from hybrid_model.consensus.sweeps.study import METRICS, study

PAGE = (Path(__file__).parents[2] / "docs" / "sweeps.md").read_text(encoding="utf-8")


@pytest.fixture
def scenario(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("small.toml").write_text(small_scenario(stop_time=3.0))
    return "small.toml"


def test_a_sweep_and_its_end(scenario, capsys):
    call = ["sweep", scenario, "--vary", "trigger.threshold=0.1,0.2,-1", "--workers", "1", "--csv", "out/a.csv"]
    assert main(call) == 0
    out = capsys.readouterr()
    assert out.out == "small.sqlite: 3 runs, 1 failed\n"
    assert out.err == ""
    with Path("out/a.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["trigger.threshold"] for row in rows] == ["0.1", "0.2", "-1"]
    assert int(rows[0]["events"]) > int(rows[1]["events"]) > 0
    assert "threshold is -1.0; it must be positive" in rows[2]["failure"]
    # Gone on with, in both ways: nothing is left to do.
    for again in (call, ["sweep", "small.sqlite", "--csv", "out/a.csv"]):
        assert main(again) == 0
        assert capsys.readouterr().out == "small.sqlite: 3 runs, 1 failed\n"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "nothing varies"),
        (["--vary", "trigger.threshold"], "'trigger.threshold' is no axis"),
        (["--vary", "trigger.threshold=0.1,0.2", "--bounds", "radius.tight"], "there is no bound 'radius.tight'"),
        (["--vary", "trigger.threshold=0.1,0.2", "--workers", "-1"], "--workers '-1': give a whole number, 1 or more"),
        (["--vary", "trigger.threshold=0.1,0.2", "--design", "random"], "needs the number of points to draw"),
    ],
)
def test_slips_are_one_sentence(scenario, options, message, capsys):
    assert main(["sweep", scenario, *options]) == 2
    assert message in capsys.readouterr().err


def test_a_table_says_itself_what_varies(scenario, capsys):
    with run_sweep(study(scenario, ["trigger.threshold=0.3,0.4"]), "a.sqlite", executor=ThreadPoolExecutor(1)):
        pass
    assert main(["sweep", "a.sqlite", "--vary", "trigger.threshold=1,2"]) == 2
    assert "leave --vary and --table out" in capsys.readouterr().err
    assert main(["sweep", "b.sqlite"]) == 2
    assert "b.sqlite is not a file: give the path of a sweep's table" in capsys.readouterr().err


def test_the_page_names_all_columns_and_all_options():
    parser = argparse.ArgumentParser()
    sweep.add_arguments(parser)
    options = {string for action in parser._actions for string in action.option_strings} - {"-h", "--help"}
    # What `simulate` and `certify` have as well is on the line of `--help` alone.
    assert {option for option in options if option not in PAGE} <= {"--max-jumps", "--table", "--json"}
    assert [name for name in METRICS if f"`{name}`" not in PAGE] == []
    axes = [line.split("`")[1] for line in PAGE.splitlines() if line.startswith("| `") and "=" in line.split("`")[1]]
    assert len(axes) == 6
    assert all(read_axis(axis) for axis in axes)
