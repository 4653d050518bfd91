"""At least a hundred mistakes that people make, and the answers that they read: no traceback, the thing, the remedy."""

import math
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from small_scenario import small_scenario

import hybrid_model as hm

# ruff: noqa: F401 - the lines of wrong_code.txt use these names.
from cosim.automaton_slave import AutomatonSlave
from cosim.cli.main import main
from cosim.errors import CosimError
from cosim.flow_functions import FlowError, FlowFunctions
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.system import System
from fmu.errors import BuildError, ExportError
from fmu.export import export_fmu
from hybrid_model import consensus, linear, plots
from hybrid_model.consensus import ScenarioError, load_scenario, read_scenario
from hybrid_model.models import BouncingBall

S = small_scenario()
BALL = """import hybrid_model as hm
class Ball(hm.HybridAutomaton):
    h = hm.State(1.0)
    def flow_map(self, s): return {"h": 0.0}
class NoRate(hm.HybridAutomaton):
    h = hm.State(1.0)
class Metric(Ball):
    h = hm.State(1.0, unit="meter")
NUMBER = 3
"""
SHOWN = """import hybrid_model as hm
class Shown(hm.HybridAutomaton):
    h = hm.State(1.0)
    y = hm.Output()
    def flow_map(self, s): return {"h": 0.0}
    def outputs(self, s): return {"y": s.h}
class Driven(hm.HybridAutomaton):
    h = hm.State(1.0, output=True)
    u = hm.Input(0.0)
    def flow_map(self, s): return {"h": s.u}
"""
TEXTS = {
    "small.toml": S,
    "bad.toml": "name = ",
    "empty.toml": "",
    "text.fmu": "nothing",
    "empty.fmu": "",
    "bad.ssp": "nothing",
    "sys.toml": '[components.a]\nfmu = "missing.fmu"\n',
    "sys2.toml": '[components.a]\nfum = "missing.fmu"\n',
    "sys3.toml": '[components.a]\nautomaton = "hybrid_model.models:BouncingBall"\n[connections]\n"a.u" = "a.h"\n',
    "sys4.toml": '[components.a]\nautomaton = "shown.py:Shown"\n',
    "sys5.toml": '[components.a]\nautomaton = "ball.py:Ball"\ninterface = "cs"\n',
    "sys6.toml": '[components.a]\nautomaton = "shown.py:Shown"\nstart.h = [1, 2]\n',
    "sys7.toml": '[components.a]\nautomaton = "shown.py:Shown"\n[connections]\n"b.u" = "a.h"\n',
    "sys8.toml": '[components.a]\nfmu = ""\n',
    "sys9.toml": '[components.a]\nfmu = "text.fmu"\narguments.x = 1\n',
    "sys10.toml": 'name = 3\n[components.a]\nfmu = "text.fmu"\n',
    "sys11.toml": '[components.a]\nautomaton = "shown.py:Driven"\n',
    "lone.ssd": "<x/>",
    "semi.csv": "time;u\n0;1\n",
    "nan.csv": "time,u\n0,1\n1,nan\n",
    "text.csv": "time,u\n0,x\n",
    "line.csv": "time,u\n0,0\n1,1\n",
    "run.csv": "time,x\n0,1\n",
    "bad.sqlite": "nothing",
    "file": "",
    "ball.py": BALL,
    "shown.py": SHOWN,
    "broken.py": "class Ball(:\n",
    "raises.py": "1/0\n",
}
FMI1 = (
    '<fmiModelDescription fmiVersion="1.0" modelName="m" modelIdentifier="m" guid="g" '
    'numberOfContinuousStates="0" numberOfEventIndicators="0"/>'
)
ZIPS = {
    "noxml.fmu": ("a.txt", "x"),
    "badxml.fmu": ("modelDescription.xml", "<fmiModelDescription"),
    "fmi1.fmu": ("modelDescription.xml", FMI1),
    "fmi4.fmu": ("modelDescription.xml", FMI1.replace('"1.0"', '"4.0"')),
    "nossd.ssp": ("a.txt", "x"),
}


def table(name):
    """The cases of a file beside this one: a line with what is typed, and one with how the answer begins."""
    lines = (Path(__file__).parent / name).read_text(encoding="utf-8").splitlines()
    return list(zip(lines[::2], map(str.strip, lines[1::2]), strict=True))


CALLS = table("wrong_calls.txt")
"""Exit status and what is typed."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    here = tmp_path_factory.mktemp("wrong")
    for name, text in TEXTS.items():
        (here / name).write_text(text)
    (here / "utf.toml").write_bytes(b"\xff\xfe")
    for name, (member, text) in ZIPS.items():
        with zipfile.ZipFile(here / name, "w") as archive:
            archive.writestr(member, text)
    (here / "folder").mkdir()
    yield here
    # Other tests have a module of this name.
    for name in ("ball", "shown"):
        sys.modules.pop(name, None)


def read(sentence):
    """Refuse what no person should have to read."""
    assert not [
        word for word in ("Traceback", "Errno", "object is not", "NoneType", " object at 0x") if word in sentence
    ]
    assert sentence[-1] in ".?)", sentence


@pytest.mark.parametrize(("case", "answer"), CALLS, ids=[row[0] for row in CALLS])
def test_what_is_typed(case, answer, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    status, *call = case.split()
    try:
        found = main(call)
    except SystemExit as exit_:
        found = exit_.code
    told = capsys.readouterr().err.strip().splitlines()[-1]
    assert found == int(status)
    sentence = told.partition("error: ")[2] if ": error: " in told else told.removeprefix("hybrid-fmu: ")
    assert sentence.startswith(answer)
    # What argparse says of missing and unknown words comes below a line with those that there are.
    if ": error: " not in told:
        read(sentence)


def wrong(**body):
    return type("Wrong", (BouncingBall,), body)


def edited(before, after):
    assert before in S
    return read_scenario(tomllib.loads(S.replace(before, after)))


ball = BouncingBall()


class Heating(hm.ModalAutomaton):
    x = hm.State(0.0)
    modes = (hm.Mode("off", lambda self, s: {"x": -1.0}), hm.Mode("on", lambda self, s: {"x": 1.0}))


def run():
    return hm.simulate(ball, 1.0, engine="python")


SLIPS = table("wrong_code.txt")
"""What is written in Python."""


@pytest.mark.parametrize(("slip", "answer"), SLIPS, ids=[row[0] for row in SLIPS])
def test_what_is_written(slip, answer, folder, monkeypatch):
    monkeypatch.chdir(folder)
    with pytest.raises((hm.HybridModelError, ScenarioError, ExportError, BuildError, CosimError, FlowError)) as raised:
        eval(slip, globals())
    assert str(raised.value).startswith(answer)
    read(str(raised.value))


def test_there_are_a_hundred_and_more():
    assert len(CALLS) + len(SLIPS) > 150
