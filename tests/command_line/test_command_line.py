"""The command line as its users see it: output, exit status, sentences."""

import csv
import io
import json
import sys
import tomllib
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import pytest
from PIL import Image, ImageChops
from small_scenario import small_scenario

import hybrid_model as hm
from cosim.cli.main import main
from cosim.cli.paper import FIXED_STEPS
from fmu.export import export_fmu
from hybrid_model.models import BouncingBall

SMALL = small_scenario()
README_PICTURE = Path(__file__).parents[2] / "docs" / "figures" / "dynamic_states.png"


@pytest.fixture
def small(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(SMALL)
    return str(path)


def test_simulate_prints_one_run_object(small, capsys):
    assert main(["simulate", small, "--json"]) == 0
    run = json.loads(capsys.readouterr().out)
    assert run["stop"] == "HORIZON"
    assert run["events_total"] == sum(run["events_per_agent"]) == sum(map(len, run["event_times"])) > 5
    assert sum(run["x_end"]) == pytest.approx(0.6, abs=1e-12)
    assert {"min_gap", "edge_norm_end", "mean_drift"} <= run.keys()


def test_simulate_names_the_scenario_once(small, capsys):
    assert main(["simulate", small]) == 0
    assert capsys.readouterr().out.splitlines()[0].count(tomllib.loads(SMALL)["name"]) == 1


def test_engines_agree(small, capsys):
    runs = []
    for engine in ("automaton", "network"):
        assert main(["simulate", small, "--json", "--engine", engine]) == 0
        runs.append(json.loads(capsys.readouterr().out))
    assert runs[0]["events_per_agent"] == runs[1]["events_per_agent"]
    for first, second in zip(runs[0]["event_times"], runs[1]["event_times"], strict=True):
        assert first == pytest.approx(second, abs=1e-9)


def test_events_of_a_network_go_to_a_folder(small, tmp_path, capsys):
    folder = str(tmp_path / "events")
    assert main(["simulate", small, "--json", "--engine", "network", "--events", folder]) == 0
    run = json.loads(capsys.readouterr().out)
    events = hm.load_network_events(folder)
    assert len(events) == events.named("trigger.broadcast").sum() == run["events_total"]
    assert main(["simulate", small, "--engine", "automaton", "--events", folder]) == 2
    assert "--events goes with --engine network" in capsys.readouterr().err


def test_simulate_writes_run_and_trajectory(small, tmp_path, capsys):
    assert main(["simulate", small, "--stop-time", "1.05", "--out", str(tmp_path / "out")]) == 0
    assert json.loads((tmp_path / "out" / "run.json").read_text())["scenario"] == "small"
    with (tmp_path / "out" / "trajectory.csv").open() as file:
        rows = list(csv.DictReader(file))
    times = [float(row["time"]) for row in rows]
    # Beside the grid there are both rows of each broadcast.
    twice = {t for t, after in pairwise(times) if t == after}
    assert [t for t in times if t not in twice] == pytest.approx([*(0.1 * k for k in range(11)), 1.05])
    assert len(twice) >= 3
    assert float(rows[0]["agent1.x"]) == 1.0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["simulate", "nowhere"], "no preset 'nowhere'"),
        (["simulate", "missing.toml"], "missing.toml"),
        (["simulate", "ball.fmu"], "is an FMU, and this command takes a scenario: 'hybrid-fmu cosim ball.fmu'"),
        (["certify", "ball.py:Ball"], "'hybrid-fmu export ball.py:Ball --out DIR' makes an FMU"),
        (["simulate", "ball.py"], "'hybrid-fmu export ball.py:ClassName --out DIR'"),
        (["export", "no.such.module:Thing", "--out", "out"], "cannot be found"),
        (["export", "json:JSONDecoder", "--out", "out"], "is not an automaton class"),
    ],
)
def test_wrong_usage_is_status_2_and_one_sentence(arguments, sentence, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert sentence in captured.err
    assert captured.err.count("\n") == 1
    assert captured.out == ""


@pytest.mark.parametrize("arguments", [["bogus"], ["simulate"]])
def test_unknown_commands_and_options_are_status_2(arguments, capsys):
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    assert exit_.value.code == 2


def test_a_slip_in_a_command_gets_a_suggestion(capsys):
    with pytest.raises(SystemExit):
        main(["simulte", "paper-a"])
    assert "there is no command 'simulte'. Did you mean 'simulate'?" in capsys.readouterr().err


def test_the_version_is_that_of_the_package(capsys):
    with pytest.raises(SystemExit) as exit_:
        main(["--version"])
    assert exit_.value.code == 0
    assert capsys.readouterr().out == f"hybrid-fmu {version('hybrid-fmu')}\n"
    assert hm.__version__ == version("hybrid-fmu")


def test_unknown_keys_of_a_scenario_are_named(small, capsys):
    with open(small, "a") as file:
        file.write("decya = 0.1\n")
    assert main(["simulate", small]) == 2
    assert "decya" in capsys.readouterr().err


def test_export_of_a_class_and_run_of_its_fmu(tmp_path, capsys):
    target = "hybrid_model.consensus.laws.agents:Integrator"
    assert main(["export", target, "--start-value", "degree=2", "--out", str(tmp_path)]) == 0
    fmu = capsys.readouterr().out.strip()
    assert fmu == str(tmp_path / "Integrator.fmu")
    table = tmp_path / "out.csv"
    arguments = ["cosim", fmu, "--stop-time", "1", "--start-value", "x=3", "--output-file", str(table)]
    assert main(arguments) == 0
    with table.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 11
    assert float(rows[-1]["x"]) == 3.0


def test_the_table_of_a_cosimulation_has_both_rows_of_a_jump(tmp_path, capsys):
    """An impact at sqrt(2 / 9.81) s, between two points of the output."""
    fmu, table = export_fmu(BouncingBall(), tmp_path / "ball.fmu"), tmp_path / "out.csv"
    assert main(["cosim", str(fmu), "--stop-time", "1", "--output-file", str(table)]) == 0
    with table.open() as file:
        rows = [{name: float(cell) for name, cell in row.items()} for row in csv.DictReader(file)]
    before, after = rows[5:7]
    assert len(rows) == 11 + 2
    assert before["time"] == after["time"] == pytest.approx((2 / 9.81) ** 0.5, abs=1e-9)
    assert after["v"] == -0.7 * before["v"] > 0.0


def test_a_scenario_exports_one_fmu_an_agent(small, tmp_path, capsys):
    assert main(["export", small, "--out", str(tmp_path / "fmus")]) == 0
    assert sorted(path.name for path in (tmp_path / "fmus").iterdir()) == ["agent1.fmu", "agent2.fmu", "agent3.fmu"]


@pytest.mark.parametrize("master", ["event-exact", "fixed-step"])
def test_zeno_is_status_3(master, tmp_path, capsys):
    fmu = export_fmu(BouncingBall(), tmp_path / "ball.fmu")
    assert main(["cosim", str(fmu), "--stop-time", "5", "--master", master]) == 3
    assert "accumulate at t = 2.5586" in capsys.readouterr().out


def test_an_fmu_without_a_proposed_stop_time_needs_one(tmp_path, capsys):
    fmu = export_fmu(BouncingBall(), tmp_path / "ball.fmu")
    assert main(["cosim", str(fmu)]) == 2
    assert "give --stop-time" in capsys.readouterr().err


def test_a_file_that_is_no_fmu_is_status_1(tmp_path, capsys):
    (tmp_path / "broken.fmu").write_text("nothing")
    assert main(["cosim", str(tmp_path / "broken.fmu"), "--stop-time", "1"]) == 1
    assert "cannot be read as an FMU" in capsys.readouterr().err


def test_unknown_start_values_are_errors(tmp_path, capsys):
    fmu = export_fmu(BouncingBall(), tmp_path / "ball.fmu")
    assert main(["cosim", str(fmu), "--stop-time", "1", "--start-value", "height=2"]) == 2
    assert "no variable 'height'; it has time, g, e, h, v" in capsys.readouterr().err
    assert main(["cosim", str(fmu), "--stop-time", "1", "--start-value", "h"]) == 2
    assert "not NAME=VALUE" in capsys.readouterr().err


@pytest.mark.parametrize("interval", ["0", "-1", "nan"])
def test_impossible_output_intervals_are_refused(small, interval, capsys):
    assert main(["simulate", small, "--output-interval", interval]) == 2
    assert f"--output-interval '{interval}': give a positive, finite number of seconds." in capsys.readouterr().err


def test_a_stop_time_of_zero_is_refused(small, tmp_path, capsys):
    assert main(["simulate", small, "--stop-time", "0"]) == 2
    assert main(["cosim", small, "--stop-time", "0"]) == 2
    assert "the stop after the start" in capsys.readouterr().err


@pytest.mark.parametrize("steps", [FIXED_STEPS[:2], pytest.param(FIXED_STEPS, marks=pytest.mark.long)], ids=len)
def test_paper_reproduces_compares_and_draws(steps, tmp_path, capsys, monkeypatch):
    """Most of its time goes into the shortest of the fixed steps."""
    monkeypatch.setattr("cosim.cli.paper.FIXED_STEPS", steps)
    assert main(["paper", "--out", str(tmp_path)]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["scenario"] == "paper-a"
    expected = {"static": [2, 6, 13, 4], "dynamic": [4, 10, 13, 8]}
    for kind, events in expected.items():
        assert summary["runs"][kind]["events_per_agent"] == events
        assert summary["runs"][kind]["mean_drift"] < 1e-12
        cosim = summary["cosim"][kind]
        assert cosim["fmi"] == "3.0"
        assert all((tmp_path / name).is_file() for name in cosim["fmus"])
        assert cosim["events_total"] == sum(events)
        assert cosim["max_event_time_difference"] < 1e-7
        assert cosim["max_state_difference"] < 1e-8
        assert [trial["step"] for trial in cosim["fixed_step"]] == list(steps)
        assert all(trial["max_final_state_difference"] > 1e-3 for trial in cosim["fixed_step"])
        assert summary["certificates"][kind]["valid"]["rate"] == pytest.approx(1.2112e-4, rel=1e-4)
        for figure in ("states", "edge_norm"):
            assert (tmp_path / f"{kind}_{figure}.png").stat().st_size > 10_000
            assert (tmp_path / f"{kind}_{figure}.pdf").stat().st_size > 3_000
    # The picture of the README is this one.
    shown, drawn = (Image.open(p).convert("L") for p in (README_PICTURE, tmp_path / README_PICTURE.name))
    assert ImageChops.difference(shown, drawn).histogram()[32:] == [0] * 224
    table = capsys.readouterr().out
    assert "FMUs through fmpy                35  4, 10, 13, 8" in table


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "latin-1"])
def test_letters_that_the_terminal_does_not_have_end_no_run(small, tmp_path, monkeypatch, encoding):
    """A scenario whose name has letters of three alphabets, printed on a terminal that has but few."""
    named = tmp_path / "named.toml"
    named.write_text(SMALL.replace('"small"', '"Größe Ω 面"'), encoding="utf-8")
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, encoding=encoding))
    assert main(["simulate", str(named)]) == 0
    sys.stdout.flush()
    text = written.getvalue().decode(encoding)
    assert text.startswith(("Gr\\xf6\\xdfe \\u03a9 \\u9762: ", "Größe \\u03a9 \\u9762: "))
    # What cannot be found is told on such a terminal too.
    complaint = io.BytesIO()
    monkeypatch.setattr(sys, "stderr", io.TextIOWrapper(complaint, encoding=encoding, errors="strict"))
    assert main(["simulate", "Ω.toml"]) == 2
    sys.stderr.flush()
    assert b"\\u03a9.toml" in complaint.getvalue()


def test_a_byte_order_mark_is_no_part_of_a_scenario_or_its_samples(tmp_path, capsys):
    mark = b"\xef\xbb\xbf"
    weights = SMALL.replace('kind = "constant"\nvalue = 1.0', 'kind = "sampled"\nfile = "w.csv"')
    (tmp_path / "marked.toml").write_bytes(mark + weights.encode())
    (tmp_path / "w.csv").write_bytes(mark + b"0,1\n2,1\n6,1\n")
    assert main(["simulate", str(tmp_path / "marked.toml"), "--json"]) == 0
    marked = json.loads(capsys.readouterr().out)
    # The samples are the constant weight of the other scenario, from the first row on.
    (tmp_path / "plain.toml").write_text(SMALL)
    assert main(["simulate", str(tmp_path / "plain.toml"), "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)
    assert marked["x_end"] == pytest.approx(plain["x_end"], abs=1e-9)
    assert marked["events_total"] == plain["events_total"]
