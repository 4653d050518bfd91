"""The error of fixed steps over their length: a table and a figure, made by the program."""

import csv

import pytest

from cosim.cli.main import main
from cosim.cli.step_study import study
from hybrid_model.consensus.scenario.files import load_scenario

TWO = """
name = "two"
stop_time = 2.0
[network]
agents = 2
edges = [[1, 2]]
initial = [1.0, 0.0]
[weights]
kind = "constant"
value = 1.0
[trigger]
kind = "static"
threshold = 0.2
decay = 0.0
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "two.toml").write_text(TWO)
    table, figure = study(load_scenario(folder / "two.toml"), folder / "out", steps=(0.1, 0.01))
    with table.open() as file:
        return list(csv.DictReader(file)), figure


def test_errors_go_down_with_the_step_and_error_control_is_below_them(made):
    rows, figure = made
    errors = {(row["agents"], row["master"], row["step"]): float(row["largest error of a state"]) for row in rows}
    for kind in ("FMI 3.0", "FMI 2.0", "mixed"):
        # An agent hears up to one step late of a broadcast of its neighbour; between, states move by 1 s^-1 at most.
        assert 1e-4 < errors[kind, "fixed-step", "0.01"] < errors[kind, "fixed-step", "0.1"] < 0.2
    for kind in ("FMI 2.0", "mixed"):
        assert errors[kind, "error-controlled", ""] < 1e-7
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_it_is_for_scenarios(stranger, tmp_path, capsys):
    assert main(["cosim", str(stranger()), "--step-study", str(tmp_path)]) == 2
    assert "--step-study is for scenarios" in capsys.readouterr().err
