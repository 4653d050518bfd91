"""At least a hundred mistakes that people make, and the answers that they read: no traceback, the thing, the remedy."""

import tomllib
import zipfile

import pytest
from small_scenario import small_scenario

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.cli.main import main
from cosim.errors import CosimError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.system import System
from fmu.errors import BuildError, ExportError
from fmu.export import export_fmu
from hybrid_model.consensus import ScenarioError, load_scenario, read_scenario
from hybrid_model.models import BouncingBall

S = small_scenario()
BALL = """import hybrid_model as hm
class Ball(hm.HybridAutomaton):
    h = hm.State(1.0)
    def flow_map(self, s): return {"h": 0.0}
class NoRate(hm.HybridAutomaton):
    h = hm.State(1.0)
NUMBER = 3
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
    "run.csv": "time,x\n0,1\n",
    "bad.sqlite": "nothing",
    "file": "",
    "ball.py": BALL,
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
    "nossd.ssp": ("a.txt", "x"),
}
CALLS = [
    (
        "simulat paper-a",
        2,
        "there is no command 'simulat'. Did you mean 'simulate'? Commands: paper, simulate, certify, sweep,",
    ),
    ("simulate", 2, "the following arguments are required: SCENARIO"),
    ("simulate paper-a --stop 1", 2, "unrecognized arguments: --stop 1"),
    ("simulate paper-b1", 2, "there is no preset 'paper-b1'. Did you mean 'paper-b'? Presets: paper-a, paper-a-abs,"),
    ("simulate paper_a", 2, "there is no preset 'paper_a'. Did you mean 'paper-a'? Presets: paper-a, paper-a-abs,"),
    ("simulate missing.toml", 2, "the scenario file missing.toml cannot be read: No such file or directory."),
    (
        "simulate folder/missing.toml",
        2,
        "the scenario file folder/missing.toml cannot be read: No such file or directory.",
    ),
    ("simulate folder", 2, "folder is a folder: give the path of a scenario file in it, which ends in .toml."),
    ("simulate bad.toml", 2, "the scenario file bad.toml is not valid TOML: Invalid value (at end of document)."),
    ("simulate utf.toml", 2, "the scenario file utf.toml is not a text in UTF-8: byte 0 cannot be decoded."),
    (
        "simulate empty.toml",
        2,
        "the scenario file empty.toml: the scenario has no 'network'; it must be a table, written [network].",
    ),
    (
        "simulate text.fmu",
        2,
        "text.fmu is an FMU, and this command takes a scenario: 'hybrid-fmu cosim text.fmu' runs it,",
    ),
    (
        "simulate bad.ssp",
        2,
        "bad.ssp is a system, and this command takes a scenario: 'hybrid-fmu cosim bad.ssp' runs it.",
    ),
    ("simulate run.csv", 2, "run.csv is a table, and this command takes a scenario: a preset, or a .toml file."),
    (
        "simulate ball.py",
        2,
        "ball.py is code, and this command takes a scenario: 'hybrid-fmu export ball.py:ClassName --out DIR'",
    ),
    (
        "simulate ball.py:Ball",
        2,
        "ball.py:Ball is code, and this command takes a scenario: 'hybrid-fmu export ball.py:Ball --out DIR'",
    ),
    (
        "simulate sys.toml",
        2,
        "sys.toml is a system, and this command takes a scenario: 'hybrid-fmu cosim sys.toml' runs it.",
    ),
    ("simulate paper-a --stop-time soon", 2, "--stop-time 'soon': give a positive, finite number of seconds."),
    ("simulate paper-a --stop-time -1", 2, "--stop-time '-1': give a positive, finite number of seconds."),
    ("simulate paper-a --stop-time inf", 2, "--stop-time 'inf': give a positive, finite number of seconds."),
    ("simulate paper-a --output-interval 0", 2, "--output-interval '0': give a positive, finite number of seconds."),
    (
        "simulate paper-a --output-interval 1e-12",
        2,
        "--output-interval 1e-12 makes more than 1e+07 points up to 50 s; choose a longer one.",
    ),
    (
        "simulate paper-a --engine fast",
        2,
        "--engine: invalid choice: 'fast' (choose from 'auto', 'automaton', 'network').",
    ),
    (
        "simulate small.toml --engine automaton --events ev",
        2,
        "--events goes with --engine network: one automaton keeps its run in memory.",
    ),
    ("simulate small.toml --out file", 2, "file cannot be a folder for results, since there is a file: give another."),
    (
        "simulate small.toml --out file/below",
        2,
        "file/below cannot be a folder for results, since there is a file: give another.",
    ),
    (
        "certify nowhere",
        2,
        "there is no preset 'nowhere'. Presets: paper-a, paper-a-abs, paper-a-dwell-2.5, paper-a-dwell-5,",
    ),
    ("certify small.toml --max-jumps 0", 2, "--max-jumps '0': give a whole number, 1 or more."),
    ("certify small.toml --max-jumps many", 2, "--max-jumps 'many': give a whole number, 1 or more."),
    ("certify small.toml --patience -1", 2, "--patience '-1': give a positive, finite number."),
    ("certify run.csv", 2, "run.csv is a table, and this command takes a scenario: a preset, or a .toml file."),
    ("sweep small.toml", 2, "nothing varies: give an axis at least, such as trigger.decay=0:0.1:11."),
    (
        "sweep small.toml --vary threshold=1,2",
        2,
        "the scenario has the unknown key 'threshold'. Known keys: name, stop_time, network, weights,",
    ),
    (
        "sweep small.toml --vary trigger.treshold=1,2",
        2,
        "[trigger] has the unknown key 'treshold'. Did you mean 'threshold'? Known keys: kind, threshold, decay.",
    ),
    (
        "sweep small.toml --vary trigger.threshold",
        2,
        "'trigger.threshold' is no axis: write key=low:high:count, key=a,b,c or key=seeds.",
    ),
    (
        "sweep small.toml --vary trigger.threshold=a:b:3",
        2,
        "'a:b:3' is no range for trigger.threshold: write low:high:count, with :log behind it for a",
    ),
    (
        "sweep small.toml --vary trigger.threshold=1:2",
        2,
        "trigger.threshold has no number of values for a grid: write trigger.threshold=1:2:10, or choose a",
    ),
    (
        "sweep small.toml --vary trigger.threshold=1,2 --bounds radius.tight",
        2,
        "there is no bound 'radius.tight'; there are rate.printed, rate.valid, rate.improved, rate.floquet,",
    ),
    (
        "sweep small.toml --vary trigger.threshold=1,2 --design sobol",
        2,
        "--design: invalid choice: 'sobol' (choose from 'grid', 'random', 'latin-hypercube').",
    ),
    ("sweep small.toml --vary trigger.threshold=1,2 --workers 0", 2, "--workers '0': give a whole number, 1 or more."),
    (
        "sweep small.toml --vary trigger.threshold=1:2:3 --design random",
        2,
        "runs is None; the design 'random' needs the number of points to draw, 1 or more.",
    ),
    ("sweep missing.sqlite", 2, "missing.sqlite is not a file: give the path of a sweep's table, or of a scenario."),
    ("sweep bad.sqlite", 2, "bad.sqlite cannot be used as the table of a sweep: file is not a database."),
    (
        "sweep text.fmu",
        2,
        "text.fmu is an FMU, and this command takes a scenario: 'hybrid-fmu cosim text.fmu' runs it,",
    ),
    ("export ball.py --out o", 2, "ball.py names no class: write ball.py:ClassName; it has Ball, NoRate."),
    (
        "export ball.py:Bal --out o",
        2,
        "ball.py:Bal cannot be found: module 'ball' has no attribute 'Bal'. Did you mean 'Ball'?",
    ),
    (
        "export ball.py:NUMBER --out o",
        2,
        "ball.py:NUMBER is not an automaton class: derive it from hybrid_model.HybridAutomaton.",
    ),
    ("export ball.py:NoRate --out o", 1, "flow_map of NoRate must also give ['h']."),
    (
        "export missing.py:Ball --out o",
        2,
        "missing.py:Ball cannot be found: there is no file missing.py. Give file.py:ClassName.",
    ),
    (
        "export broken.py:Ball --out o",
        1,
        "The module 'broken.py' cannot be imported, because it fails with SyntaxError: invalid syntax",
    ),
    (
        "export raises.py:Ball --out o",
        1,
        "The module 'raises.py' cannot be imported, because it fails with ZeroDivisionError: division by",
    ),
    ("export no.such:Ball --out o", 2, "no.such:Ball cannot be found: No module named 'no'. Give module:ClassName."),
    (
        "export json:JSONDecoder --out o",
        2,
        "json:JSONDecoder is not an automaton class: derive it from hybrid_model.HybridAutomaton.",
    ),
    (
        "export hybrid_model.models:BouncingBal --out o",
        2,
        "hybrid_model.models:BouncingBal cannot be found: module 'hybrid_model.models' has no attribute",
    ),
    ("export ball.py:Ball", 2, "the following arguments are required: --out"),
    ("export ball.py:Ball --out o --fmi 1.0", 2, "--fmi: invalid choice: '1.0' (choose from '2.0', '3.0')."),
    ("export ball.py:Ball --out o --kind se", 2, "--kind: invalid choice: 'se' (choose from 'cs', 'me')."),
    (
        "export ball.py:Ball --out o --platform beos",
        2,
        "--platform: invalid choice: 'beos' (choose from 'x86_64-linux', 'aarch64-linux', 'x86_64-windows',",
    ),
    ("export ball.py:Ball --out o --start-value h", 2, "--start-value 'h' is not NAME=VALUE with a number for VALUE."),
    (
        "export ball.py:Ball --out o --start-value h=high",
        2,
        "--start-value 'h=high' is not NAME=VALUE with a number for VALUE.",
    ),
    (
        "export ball.py:Ball --out o --start-value g=1",
        2,
        "ball.py:Ball cannot be made with the start values given: Ball has nothing named 'g' to set; it has h.",
    ),
    (
        "export ball.py:Ball --out o --start-value h=nan",
        2,
        "ball.py:Ball cannot be made with the start values given: Ball.h = nan is not finite: start values",
    ),
    ("export ball.py:Ball --out o --stop-time 0", 2, "--stop-time '0': give a positive, finite number of seconds."),
    (
        "export ball.py:Ball --out file",
        1,
        "The file 'file/Ball.fmu' cannot be written: File exists. Remedy: choose a folder where you may",
    ),
    (
        "export small.toml --out o --start-value h=1",
        2,
        "--start-value goes with module:ClassName; a scenario has its values in its file.",
    ),
    ("export text.fmu --out o", 2, "text.fmu is an FMU already: 'hybrid-fmu cosim text.fmu' runs it."),
    ("cosim missing.fmu", 2, "missing.fmu is not a file: give the path of an FMU or a system."),
    (
        "cosim text.fmu --stop-time 1",
        1,
        "text: text.fmu cannot be read as an FMU: The file is not a readable ZIP archive: File is not a zip",
    ),
    (
        "cosim empty.fmu --stop-time 1",
        1,
        "empty: empty.fmu cannot be read as an FMU: The file is not a readable ZIP archive: File is not a",
    ),
    (
        "cosim noxml.fmu --stop-time 1",
        1,
        "noxml: noxml.fmu cannot be read as an FMU: The archive has no modelDescription.xml at its top;",
    ),
    (
        "cosim badxml.fmu --stop-time 1",
        1,
        "badxml: badxml.fmu cannot be read as an FMU: Couldn't find end of Start Tag fmiModelDescription",
    ),
    (
        "cosim fmi1.fmu --stop-time 1",
        1,
        "fmi1: fmi1.fmu cannot be read as an FMU: It is of FMI 1.0, and FMI 2.0 and 3.0 are run here:",
    ),
    (
        "cosim bad.ssp",
        1,
        "bad.ssp cannot be read as an SSP: The file is not a readable ZIP archive: File is not a zip file.",
    ),
    (
        "cosim nossd.ssp",
        1,
        "nossd.ssp cannot be read as an SSP: The archive has no SystemStructure.ssd at its top; every",
    ),
    ("cosim folder", 1, "folder has no system.toml and no FMU: give one of them."),
    (
        "cosim nowhere",
        2,
        "there is no preset 'nowhere'. Presets: paper-a, paper-a-abs, paper-a-dwell-2.5, paper-a-dwell-5,",
    ),
    (
        "cosim ball.py:Ball",
        2,
        "ball.py:Ball is code: 'hybrid-fmu export ball.py:Ball --out DIR' makes FMUs, which this command runs.",
    ),
    ("cosim sys.toml --stop-time 1", 1, "a: there is no file missing.fmu: give the path of an FMU."),
    (
        "cosim sys2.toml --stop-time 1",
        1,
        "sys2.toml: there is no entry components.a.fum; there are fmu, automaton, start, arguments,",
    ),
    ("cosim sys3.toml --stop-time 1", 1, "a.u is not an input; the inputs of a are none."),
    (
        "cosim small.toml --master exact",
        2,
        "--master: invalid choice: 'exact' (choose from 'event-exact', 'error-controlled', 'fixed-step').",
    ),
    ("cosim small.toml --stop-time 0", 2, "--stop-time 0: the run starts at 0 s; give the stop after the start."),
    ("cosim small.toml --tolerance -1", 2, "--tolerance '-1': give a positive, finite number."),
    (
        "cosim small.toml --input-file missing.csv",
        2,
        "missing.csv is not a file: give the path of a table of comma-separated values.",
    ),
    (
        "cosim small.toml --reference-file missing.csv",
        2,
        "missing.csv is not a file: give the path of a table of comma-separated values.",
    ),
    ("cosim small.toml --loop-iterations -1", 2, "--loop-iterations '-1': give a whole number, 0 or more."),
    ("validate missing.fmu", 2, "missing.fmu is not a file: give the path of an FMU."),
    ("validate folder", 2, "folder is a folder: give the path of an FMU."),
    (
        "validate small.toml",
        2,
        "small.toml is no FMU: 'hybrid-fmu export small.toml --out DIR' makes FMUs to be checked.",
    ),
    (
        "validate ball.py:Ball",
        2,
        "ball.py:Ball is no FMU: 'hybrid-fmu export ball.py:Ball --out DIR' makes FMUs to be checked.",
    ),
    ("validate text.fmu --timeout 0", 2, "--timeout '0': give a positive, finite number of seconds."),
    ("validate text.fmu --memory 1", 2, "--memory '1': give a whole number, 64 or more."),
    ("completion ksh", 2, "SHELL: invalid choice: 'ksh' (choose from 'bash', 'zsh', 'fish', 'tcsh')."),
    ("doctor now", 2, "unrecognized arguments: now"),
    ("paper --out file", 2, "file cannot be a folder for results, since there is a file: give another."),
]
"""What is typed, the exit status, and how the answer begins."""


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
    return here


def read(sentence):
    """Refuse what no person should have to read."""
    assert not [
        word for word in ("Traceback", "Errno", "object is not", "NoneType", " object at 0x") if word in sentence
    ]
    assert sentence[-1] in ".?)", sentence


@pytest.mark.parametrize(("call", "status", "answer"), CALLS, ids=[row[0] for row in CALLS])
def test_what_is_typed(call, status, answer, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    try:
        found = main(call.split())
    except SystemExit as exit_:
        found = exit_.code
    told = capsys.readouterr().err.strip().splitlines()[-1]
    assert found == status
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


def run():
    return hm.simulate(ball, 1.0, engine="python")


SLIPS = [
    (
        lambda: hm.simulate(BouncingBall, 1.0),
        "simulate was given the class BouncingBall, but takes an instance: write BouncingBall().",
    ),
    (lambda: hm.simulate(ball, "1"), "t_end = '1' is not a number: give a number in s."),
    (
        lambda: hm.simulate(ball, float("inf")),
        "the end time is inf s and the start 0.0 s: give a finite end after the start.",
    ),
    (
        lambda: hm.simulate(ball, 1.0, t_start=2.0),
        "the end time is 1.0 s and the start 2.0 s: give a finite end after the start.",
    ),
    (lambda: hm.simulate(ball, 1.0, rtol=1e-6), "simulate has no option 'rtol': write solver=hm.Solver(rtol=1e-06)."),
    (lambda: hm.simulate(ball, 1.0, engine="c"), "engine = 'c': give one of 'auto', 'native', 'python'."),
    (
        lambda: hm.simulate(ball, 1.0, inputs={"u": 1.0}),
        "BouncingBall has no input 'u'; it has no inputs: leave it out.",
    ),
    (
        lambda: hm.simulate(ball, 1.0, starts={"height": 1.0}),
        "starts: BouncingBall has no variable 'height'; it has h, v, g, e.",
    ),
    (
        lambda: hm.simulate(ball, 1.0, starts={"h": float("nan")}),
        "start value of h = nan is not finite: start values and parameters must be finite numbers.",
    ),
    (lambda: hm.simulate(ball), "simulate needs t_end: write simulate(automaton, t_end)."),
    (
        lambda: hm.Solver(method="Euler"),
        "solver option method = 'Euler': the methods are DOP853, RK45, Radau, BDF, LSODA.",
    ),
    (lambda: hm.Solver(rtol=-1), "solver option rtol = -1: give a positive number."),
    (lambda: hm.Solver(rtoll=1), "hm.Solver has no option 'rtoll': write 'rtol'."),
    (lambda: hm.ZenoGuard(max_jumps=0), "ZenoGuard option max_jumps = 0: give a whole number of jumps, 1 or more."),
    (lambda: BouncingBall(gg=1), "BouncingBall has nothing named 'gg' to set; it has h, v, g, e."),
    (lambda: BouncingBall(g="9.81"), "BouncingBall.g = '9.81' is not a number or an array of numbers."),
    (lambda: BouncingBall(9.81), "BouncingBall was given 9.81 as the name of the instance: give values by name,"),
    (lambda: hm.State(1.0, unit=3), "unit = 3 is no text: write unit='3'."),
    (lambda: hm.State(1.0, units="m"), "hm.State has no option 'units': write 'unit'."),
    (
        lambda: hm.State([1.0, 2.0], shape=3),
        "shape = (3,) does not fit the start value [1.0, 2.0]: leave it out, since an array has its shape,",
    ),
    (
        lambda: wrong(x=hm.State(1.0, minimum=2.0))(),
        "Wrong.x = 1 lies outside its range from 2 to inf: give a value within it.",
    ),
    (
        lambda: wrong(reset=lambda self, s: {})(),
        "Wrong defines 'reset', a name of the framework: choose another. Yours to write are flow_map,",
    ),
    (
        lambda: wrong(derivatives=lambda self, s: {})(),
        "Wrong defines 'derivatives', a name of the framework: choose another. Yours to write are flow_map,",
    ),
    (
        lambda: wrong(start_values=lambda self, s: {})(),
        "Wrong defines 'start_values', a name of the framework: choose another. Yours to write are flow_map,",
    ),
    (lambda: hm.simulate(wrong(flow_map=lambda self, s: {"h": s.v})(), 1.0), "flow_map of Wrong must also give ['v']."),
    (
        lambda: hm.simulate(wrong(flow_map=lambda self, s: {"h": s.v, "v": 0.0, "w": 1.0})(), 1.0),
        "flow_map of Wrong sets ['w'], but may set only ['h', 'v'].",
    ),
    (
        lambda: hm.simulate(wrong(flow_map=lambda self, s: {"h": "x", "v": 0.0})(), 1.0),
        "Wrong: the value computed for h is 'x': return one number.",
    ),
    (
        lambda: hm.simulate(wrong(flow_map=lambda self: {})(), 1.0),
        "flow_map of Wrong takes (self), but is called with (self, s): write lambda self, s: ....",
    ),
    (
        lambda: hm.simulate(wrong(jump_set=lambda self, s: s.h <= 0)(), 1.0),
        "the jump set of 'jump' of Wrong is a boolean: return a margin instead, a number that is zero or",
    ),
    (
        lambda: type("W", (hm.HybridAutomaton,), {"jump_set": lambda self, s: 1.0})(),
        "W has one of jump_set and jump_map: write both, or neither.",
    ),
    (
        lambda: wrong(up=hm.Jump("up", lambda s, x: 1.0, lambda s, x: {}))(),
        "Wrong.up is a Jump that is not in transitions, which alone is read: write transitions = (up,) below it.",
    ),
    (
        lambda: hm.simulate(wrong(flow_map=lambda self, s: {"h": s.vel, "v": 0.0})(), 1.0),
        "Wrong has no variable 'vel'; it has t, h, v, g, e.",
    ),
    (
        lambda: setattr(ball, "e", 0.5),
        "BouncingBall.e is one of the parameters, whose values are given when an instance is made: write",
    ),
    (lambda: run()["height"], "BouncingBall has no variable 'height'; it has h, v, g, e."),
    (lambda: run().at("h", 5.0), "a time in [5, 5] s lies outside the run, which covers [0, 1] s."),
    (lambda: run().at("h", "x"), "the times are 'x': give numbers in s."),
    (lambda: run().event_times("bounce"), "BouncingBall has no jump 'bounce'; it has jump."),
    (
        lambda: run().save("run.xyz"),
        "run.xyz ends in '.xyz', but an arc is saved as .npz, which hm.load_arc reads, or as .csv, .mat or .nc, its",
    ),
    (
        lambda: hm.load_arc("text.fmu"),
        "text.fmu is no hybrid arc, or is damaged (File is not a zip file): give a file that HybridArc.save",
    ),
    (lambda: hm.lookup([], 0), "a table of shape (0,) cannot be looked up: give a list of entries, or of rows."),
    (
        lambda: hm.least(),
        "no margin is given to least or greatest: write least(first, second), or *margins for a list.",
    ),
    (
        lambda: hm.Composition("c", [ball]),
        "c: the parts are [BouncingBall(BouncingBall: continuous states h, v; parameters g, e; jumps",
    ),
    (lambda: hm.Composition("c", {"a": ball}, {"a.u": "a.h"}), "c: a.u is not an input; a has none."),
    (lambda: hm.Composition("c", {"a": ball}, {"b.u": "a.h"}), "c (parts) has no variable 'b.u'; it has a."),
    (
        lambda: hm.Composition("c", {"a": BouncingBall}),
        "BouncingBall is a class: make an instance of it, BouncingBall().",
    ),
    (
        lambda: hm.product("p", ball, ball),
        "p: its parts are called ['BouncingBall', 'BouncingBall']: give each a name of its own when it is",
    ),
    (
        lambda: ball * ball,
        "BouncingBall*BouncingBall: two parts are called 'BouncingBall': give each a name of its own when it",
    ),
    (
        lambda: hm.simulate_network(ball, 1.0),
        "simulate_network runs the parts of a Composition, and BouncingBall(BouncingBall: continuous states",
    ),
    (
        lambda: hm.verify(ball, {"t": [0]}),
        "a dict holds no samples of a run: give a HybridArc, Samples or a DataFrame.",
    ),
    (
        lambda: export_fmu("ball", "x.fmu"),
        "export_fmu was given 'ball', but takes an automaton: give an instance of a HybridAutomaton or a",
    ),
    (
        lambda: export_fmu(BouncingBall, "x.fmu"),
        "export_fmu was given the class BouncingBall, but takes an instance: write BouncingBall().",
    ),
    (
        lambda: export_fmu(ball, "x.fmu", fmi="1.0"),
        "FMI version '1.0' is not one that can be exported: choose from 2.0, 3.0.",
    ),
    (
        lambda: export_fmu(ball, "x.fmu", kinds=("se",)),
        "The kinds ('se',) are not kinds of FMU: give one or both of cs, me.",
    ),
    (
        lambda: export_fmu(ball, "x.fmu", platforms=("beos",)),
        "There is no platform 'beos'. Remedy: choose from x86_64-linux, aarch64-linux, x86_64-windows,",
    ),
    (lambda: export_fmu(ball, "x.fmu", fmii="3.0"), "export_fmu has no option 'fmii': write 'fmi'."),
    (lambda: FmuSlave("a", "missing.fmu"), "a: there is no file missing.fmu: give the path of an FMU."),
    (
        lambda: FmuSlave("a", "text.fmu"),
        "a: text.fmu cannot be read as an FMU: The file is not a readable ZIP archive: File is not a zip",
    ),
    (
        lambda: System([AutomatonSlave("a", ball), AutomatonSlave("a", ball)], {}),
        "two slaves have one name among ['a', 'a']: name them apart.",
    ),
    (lambda: System([AutomatonSlave("a", ball)], {"a.u": "a.h"}), "a.u is not an input; the inputs of a are none."),
    (
        lambda: run_event_exact(System([AutomatonSlave("a", ball)], {}), -1.0),
        "the run goes from 0.0 to -1.0 s: give finite times, the stop after the start.",
    ),
    (
        lambda: run_fixed_step(System([AutomatonSlave("a", ball)], {}), 1.0, 0.0),
        "the communication step is 0.0 s: give a positive, finite number.",
    ),
    (
        lambda: load_scenario("paper-z"),
        "there is no preset 'paper-z'. Did you mean 'paper-t'? Presets: paper-a, paper-a-abs,",
    ),
    (
        lambda: edited("agents = 3", "agents = 3\nagnets = 3"),
        "[network] has the unknown key 'agnets'. Did you mean 'agents'? Known keys: agents, edges, graph,",
    ),
    (lambda: edited("agents = 3", "agents = 1"), "[network] agents is 1; consensus needs at least 2 agents."),
    (lambda: edited("agents = 3", 'agents = "three"'), "[network] agents is 'three'; it must be a whole number."),
    (
        lambda: edited("[[1, 2], [2, 3]]", "[[1, 2], [2, 4]]"),
        "[network] edges: edge 2 is [2, 4] and names agent 4; agents are numbered from 1 to 3.",
    ),
    (
        lambda: edited("[[1, 2], [2, 3]]", "[[1, 1], [2, 3]]"),
        "[network] edges: edge 1 is [1, 1], a self-loop; an edge must join two different agents.",
    ),
    (
        lambda: edited("[[1, 2], [2, 3]]", "[[1, 2], [2, 1]]"),
        "[network] edges: edge 2 is [2, 1] and repeats edge 1, [1, 2]; edges are undirected, so list each",
    ),
    (
        lambda: edited("[1.0, 0.0, -0.4]", "[1.0, 0.0]"),
        "[network] initial lists 2 numbers for 3 agents; give one each.",
    ),
    (
        lambda: edited('kind = "constant"', 'kind = "constnat"'),
        "[weights] kind is 'constnat'; it must be one of 'gated-sine', 'constant', 'sine', 'square',",
    ),
    (
        lambda: edited("value = 1.0", "value = [1.0]"),
        "[weights] value lists 1 numbers for 2 edges; give one number for each of them, or a single number",
    ),
    (
        lambda: edited('kind = "static"', 'kind = "statc"'),
        "[trigger] kind is 'statc'; it must be one of 'static', 'dynamic', 'mixed', 'relative', 'girard',",
    ),
    (lambda: edited("threshold = 0.2", "threshold = -0.2"), "[trigger] threshold is -0.2; it must be positive."),
    (lambda: edited("stop_time = 5.0", "stop_time = 0.0"), "stop_time is 0.0; it must be positive."),
    (lambda: edited("threshold = 0.2", "threshold = true"), "[trigger] threshold is true; it must be a number."),
]
"""What is written in Python, and how the answer begins."""


@pytest.mark.parametrize(("slip", "answer"), SLIPS, ids=range(len(SLIPS)))
def test_what_is_written(slip, answer, folder, monkeypatch):
    monkeypatch.chdir(folder)
    with pytest.raises((hm.HybridModelError, ScenarioError, ExportError, BuildError, CosimError)) as raised:
        slip()
    assert str(raised.value).startswith(answer)
    read(str(raised.value))


def test_there_are_a_hundred_and_more():
    assert len(CALLS) + len(SLIPS) > 150
