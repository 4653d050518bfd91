"""`hybrid-fmu export` as its users see it: targets, options, files, exit status, sentences."""

import math
import os
import subprocess
import sys
import zipfile

import fmpy
import pytest

from cosim.cli.main import main
from fmu.build.platforms import PLATFORMS, this_platform
from fmu.errors import ExportError
from fmu.export import export_fmu
from hybrid_model.models import BouncingBall

MODEL = '''
import hybrid_model as hm

class Decay(hm.HybridAutomaton):
    """Something that fades."""
    x = hm.State(1.0)
    rate = hm.Parameter(2.0)
    def flow_map(self, s):
        return {"x": -s.rate * s.x}

slow = Decay(rate=0.5)
'''


DATA = """
@dataclass
class Limits:
    low: "float" = 0.0
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a module of the user's, who works in it."""
    (tmp_path / "fading.py").write_text(MODEL)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield tmp_path
    sys.modules.pop("fading", None)


def description(path):
    with zipfile.ZipFile(path) as archive:
        return archive.read("modelDescription.xml").decode()


def test_a_class_of_the_current_folder_is_found(here, capsys):
    before = list(sys.path)
    assert main(["export", "fading:Decay", "--fmi", "3.0", "--out", "out"]) == 0
    assert capsys.readouterr().out.split() == [os.path.join("out", "Decay.fmu")]
    with zipfile.ZipFile(here / "out" / "Decay.fmu") as archive:
        folders = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    assert folders == {this_platform().name}
    assert sys.path == before


def test_the_installed_command_finds_it_too(here):
    """Not the test's process, whose path for modules holds the current folder perhaps."""
    command = os.path.join(os.path.dirname(sys.executable), "hybrid-fmu")
    done = subprocess.run([command, "export", "fading:slow", "--out", "a folder #1 %"], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert os.listdir(here / "a folder #1 %") == ["Decay.fmu"]


def test_an_instance_brings_its_values(here):
    assert main(["export", "fading:slow", "--out", "out"]) == 0
    assert 'start="0.5"' in description(here / "out" / "Decay.fmu")
    assert main(["export", "fading:slow", "--start-value", "rate=3", "--out", "out"]) == 2


def test_a_class_is_found_in_a_file_anywhere(here, tmp_path_factory, capsys):
    """Also one that is named as a module in use, and that imports what lies beside it."""
    folder = tmp_path_factory.mktemp("a folder")
    (folder / "beside.py").write_text(MODEL)
    (folder / "fmu.py").write_text("from dataclasses import dataclass\nfrom beside import Decay, slow\n" + DATA)
    before = list(sys.path), sys.modules["fmu"]
    assert main(["export", f"{folder / 'fmu.py'}:Decay", "--start-value", "rate=0.25", "--out", "out"]) == 0
    assert 'start="0.25"' in description(here / "out" / "Decay.fmu")
    assert (list(sys.path), sys.modules["fmu"]) == before
    assert main(["export", f"{folder / 'missing.py'}:Decay", "--out", "out"]) == 2
    assert "there is no file" in capsys.readouterr().err


def test_start_values_and_the_proposed_stop_time_are_written(here):
    options = ["--start-value", "rate=0.25", "--stop-time", "7.5"]
    assert main(["export", "fading:Decay", *options, "--out", "out"]) == 0
    text = description(here / "out" / "Decay.fmu")
    assert 'start="0.25"' in text
    assert 'stopTime="7.5"' in text


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("1 / 0", "ZeroDivisionError"),
        ("import no_such_module_at_all", "No module named 'no_such_module_at_all'"),
        ("def", "SyntaxError"),
        ("import hybrid_model\nhybrid_model.no_such_name", "has no attribute 'no_such_name'"),
        ("raise SystemExit(0)", "SystemExit"),
    ],
)
def test_a_module_that_fails_is_named_with_its_error(here, capsys, content, sentence):
    (here / "failing.py").write_text(content)
    assert main(["export", "failing:Thing", "--out", "out"]) == 1
    captured = capsys.readouterr()
    assert "The module 'failing' cannot be imported" in captured.err
    assert sentence in captured.err
    assert captured.err.count("\n") == 1
    assert not (here / "out").exists()


@pytest.mark.parametrize(
    "target",
    [
        "fading:Nothing",
        "nowhere:Decay",
        ":Decay",
        "fading:",
        ".fading:Decay",
        "os:sep",
        "fading.py:Nothing",
        "fading.py:",
        "nowhere.py:Decay",
    ],
)
def test_targets_that_are_not_there_are_wrong_usage(here, capsys, target):
    assert main(["export", target, "--out", "out"]) == 2
    assert target in capsys.readouterr().err
    assert not (here / "out").exists()


def test_a_class_whose_constructor_leaves_its_base_out(here, capsys):
    (here / "half.py").write_text(
        "from hybrid_model.models import BouncingBall\nclass Half(BouncingBall):\n    def __init__(self): pass\n"
    )
    assert main(["export", "half.py:Half", "--out", "."]) == 1
    assert "Half has an __init__ that leaves the variables out: call super().__init__(...)" in capsys.readouterr().err


@pytest.mark.parametrize(
    "option", [["--fmi", "1.0"], ["--kind", "se"], ["--platform", "linux64"], ["--platform", "x86_64-beos"]]
)
def test_unknown_versions_kinds_and_platforms_are_wrong_usage(here, capsys, option):
    assert main(["export", "fading:Decay", *option, "--out", "out"]) == 2
    assert option[1] in capsys.readouterr().err


def test_files_that_cannot_be_written_fail_before_the_build(here, capsys, monkeypatch):
    # A compiler would say so.
    monkeypatch.setenv("CC", "no-such-compiler")
    (here / "taken").write_text("")
    assert main(["export", "fading:Decay", "--out", "taken"]) == 1
    assert "cannot be written" in capsys.readouterr().err


def test_the_options_reach_the_exporter(here, monkeypatch):
    """Kinds and platforms in a fixed order; nothing chosen is everything, or this machine."""
    seen = []

    def note(automaton, path, *, fmi, kinds, platforms, stop_time, step_size, clocks, progress):
        assert clocks
        seen.append((fmi, kinds, platforms, stop_time, step_size))
        return path

    monkeypatch.setattr("cosim.cli.export.export_fmu", note)
    assert main(["export", "fading:Decay", "--out", "out"]) == 0
    options = ["--kind", "me", "--platform", "aarch64-linux", "--platform", "x86_64-linux", "--step-size", "0.1"]
    assert main(["export", "fading:Decay", *options, "--out", "out"]) == 0
    assert main(["export", "fading:Decay", "--kind", "me", "--kind", "cs", "--platform", "all", "--out", "out"]) == 0
    assert seen == [
        ("3.0", ("cs", "me"), None, None, None),
        ("3.0", ("me",), ("x86_64-linux", "aarch64-linux"), None, 0.1),
        ("3.0", ("cs", "me"), tuple(PLATFORMS), None, None),
    ]


@pytest.mark.parametrize(
    ("name", "file"), [("a/../b", "a_.._b.fmu"), ("..", "_.fmu"), ("naïve ball", "naïve_ball.fmu")]
)
def test_files_stay_in_the_folder_whatever_the_automaton_is_called(here, name, file, monkeypatch):
    (here / "fading.py").write_text(MODEL + f"\nslow.name = {name!r}\n")
    monkeypatch.setattr("cosim.cli.export.export_fmu", lambda automaton, path, **options: path.touch())
    assert main(["export", "fading:slow", "--out", "out"]) == 0
    assert os.listdir(here / "out") == [file]


def test_progress_is_for_terminals_only(here, capsys, monkeypatch):
    assert main(["export", "fading:Decay", "--out", "out"]) == 0
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    assert main(["export", "fading:Decay", "--out", "out"]) == 0
    assert "exporting Decay ..." in capsys.readouterr().err


def test_clocks_can_be_left_out(here):
    target = "hybrid_model.models:BouncingBall"
    assert main(["export", target, "--out", "with"]) == 0
    assert main(["export", target, "--no-clocks", "--out", "without"]) == 0
    shown, plain = (description(here / folder / "BouncingBall.fmu") for folder in ("with", "without"))
    assert (shown.count("<Clock "), plain.count("<Clock ")) == (2, 0)
    run = {"stop_time": 1.0, "output": ["h"], "use_event_mode": True, "early_return_allowed": True}
    heights = [fmpy.simulate_fmu(str(here / folder / "BouncingBall.fmu"), **run)["h"] for folder in ("with", "without")]
    assert list(heights[0]) == list(heights[1])


@pytest.mark.parametrize("option", ["--stop-time", "--step-size"])
@pytest.mark.parametrize("value", ["0", "-1", "nan", "inf", "soon"])
def test_times_that_no_experiment_has_are_wrong_usage(here, capsys, option, value):
    assert main(["export", "fading:Decay", f"{option}={value}", "--out", "out"]) == 2
    assert f"{option} {value!r}: give a positive, finite number of seconds." in capsys.readouterr().err


@pytest.mark.parametrize("times", [{"stop_time": math.nan}, {"stop_time": -1.0}, {"step_size": 0.0}])
def test_times_that_no_experiment_has_are_refused_by_the_exporter(here, times):
    with pytest.raises(ExportError, match=r"cannot be proposed: give a finite number above zero, or none\."):
        export_fmu(BouncingBall(), here / "ball.fmu", **times)
    assert not (here / "ball.fmu").exists()


def test_an_interrupted_command_ends_with_one_line(here, monkeypatch, capsys):
    def interrupt(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("cosim.cli.export.export_fmu", interrupt)
    assert main(["export", "fading:Decay", "--out", "out"]) == 130
    assert capsys.readouterr().err == "hybrid-fmu: interrupted.\n"
