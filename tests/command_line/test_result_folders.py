"""Folders of results: all of a run or nothing of it, and nothing of an earlier one."""

import json

import pytest
from small_scenario import small_scenario

from cosim.cli import entry
from cosim.cli.main import main
from cosim.cli.outputs import LIST, results_folder
from cosim.errors import UsageError


def names(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_what_an_earlier_run_left_goes_and_what_is_anybody_elses_stays(tmp_path):
    for files in (["a.txt", "figures/old.png"], ["a.txt", "figures/new.png"]):
        with results_folder(tmp_path, "paper") as folder:
            (folder / "figures").mkdir()
            for name in files:
                (folder / name).write_text("new")
        (tmp_path / "notes.txt").write_text("mine")
        with results_folder(tmp_path, "certify") as folder:
            (folder / "b.txt").write_text("b")
    assert names(tmp_path) == [LIST, "a.txt", "b.txt", "figures/new.png", "notes.txt"]


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_a_run_that_ends_early_leaves_what_was_there(tmp_path, error):
    with results_folder(tmp_path, "paper") as folder:
        (folder / "a.txt").write_text("old")

    def half():
        with results_folder(tmp_path, "paper") as folder:
            (folder / "a.txt").write_text("half")
            raise error

    with pytest.raises(error):
        half()
    assert names(tmp_path) == [LIST, "a.txt"]
    assert (tmp_path / "a.txt").read_text() == "old"


def test_a_list_that_names_files_elsewhere_removes_nothing(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    out = tmp_path / "out"
    out.mkdir()
    (out / LIST).write_text(json.dumps({"paper": ["../mine.txt"]}))
    with results_folder(out, "paper"):
        pass
    assert (tmp_path / "mine.txt").is_file()


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("")
    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(UsageError, match="cannot be a folder for results"), results_folder(out, "paper"):
            pass


def test_an_interrupt_while_results_are_written(tmp_path, monkeypatch, capsys):
    (tmp_path / "small.toml").write_text(small_scenario(stop_time=1.0))
    call = ["simulate", str(tmp_path / "small.toml"), "--out", str(tmp_path / "out")]

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("cosim.cli.simulate.write_csv", interrupted)
    assert main(call) == 130
    assert capsys.readouterr().err == "hybrid-fmu: interrupted.\n"
    assert names(tmp_path / "out") == []


def test_an_interrupt_while_the_command_line_is_imported(monkeypatch, capsys):
    def interrupted():
        raise KeyboardInterrupt

    monkeypatch.setattr("cosim.cli.main.main", interrupted)
    assert entry.main() == 130
    assert capsys.readouterr().err == "hybrid-fmu: interrupted.\n"
