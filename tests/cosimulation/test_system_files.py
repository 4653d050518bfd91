"""Systems from TOML files and folders: what they hold, and what is refused, with the entry."""

import pytest

from cosim.cli.main import main
from cosim.errors import MisfitError
from cosim.systems.assembly import assemble
from cosim.systems.files import read_system
from cosim.systems.toml_file import read_toml

AUTOMATA = """
import hybrid_model as hm

class Counter(hm.HybridAutomaton):
    period = hm.Parameter(0.5)
    last = hm.DiscreteState(0.0)
    count = hm.DiscreteState(0.0, output=True)

    def due(self, s):
        return s.last + s.period

    def tick(self, s):
        return {"count": s.count + 1, "last": s.last + s.period}

    transitions = (hm.TimeEvent("tick", due, tick),)

class Sum(hm.HybridAutomaton):
    many = hm.Input([0.0, 0.0], discrete=True)
    rate = hm.Input(0.0, discrete=True)
    total = hm.Output()
    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": s.rate}

    def outputs(self, s):
        return {"total": s.many[0] + s.many[1]}
"""
SYSTEM = """
[experiment]
stop_time = 2.2

[components.a]
automaton = "blocks.py:Counter"
start = { period = 0.5 }
[components.b]
automaton = "blocks.py:Counter"
start = { period = 1.0, count = 10 }
[components.sum]
automaton = "blocks.py:Sum"

[connections]
"sum.many" = ["a.count", "b.count"]

[inputs]
file = "in.csv"
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "blocks.py").write_text(AUTOMATA)
    (tmp_path / "system.toml").write_text(SYSTEM)
    (tmp_path / "in.csv").write_text("time,sum.rate\n0,1\n1,2\n")
    return tmp_path


def changed(folder, old, new):
    path = folder / "system.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize("name", ["", "system.toml"])
def test_a_system_in_a_file_runs(name, folder, capsys):
    assert main(["cosim", str(folder / name), "--output-file", str(folder / "out.csv")]) == 0
    said = capsys.readouterr().out
    # Four ticks of 0.5 s, and two of 1 s after ten.
    assert "sum.total = 16" in said
    assert "sum.x = 3.4" in said
    assert "a: 4 events at 0.5, 1, 1.5, 2 s" in said


def test_options_go_before_what_the_file_says(folder, capsys):
    command = ["cosim", str(folder), "--stop-time", "1.2", "--start-value", "b.count=20", "--output-interval", "0.6"]
    assert main(command) == 0
    assert "sum.total = 23" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[inputs]", "[input]", "there is no entry input; .* Did you mean inputs"),
        ("stop_time = 2.2", 'stop_time = "2"', "experiment.stop_time is '2': give a number"),
        ("start = { period = 0.5 }", "strat = 1", "there is no entry components.a.strat.* Did you mean start"),
        ('automaton = "blocks.py:Sum"', "", "components.sum has neither fmu nor automaton"),
        ('["a.count", "b.count"]', "3", "connections.'sum.many' is 3: give the name of an output"),
        ('"sum.many" =', "sum.many =", "connections.'sum' is .*Names with points are quoted"),
        ("[experiment]", "[experiment", "cannot be read as TOML"),
        ('automaton = "blocks.py:Sum"', 'fmu = "x.fmu"\ninterface = "se"', "interface is 'se': give one of cs, me"),
        ("stop_time = 2.2", f"stop_time = {10**400}", "experiment.stop_time is inf: give a finite number"),
        (
            "stop_time = 2.2",
            "stop_time = 0",
            "experiment.stop_time is 0, and the run starts at 0 s .* a stop after the",
        ),
        (
            "stop_time = 2.2",
            "start_time = 5\nstop_time = 2.2",
            r"experiment.stop_time is 2.2, and the run starts at 5 s",
        ),
        ("stop_time = 2.2", "output_interval = 0", "experiment.output_interval is 0: give seconds, more than 0"),
        ("stop_time = 2.2", "output_interval = -0.1", "experiment.output_interval is -0.1: give seconds"),
        ("stop_time = 2.2", "step_size = -1", "experiment.step_size is -1: give seconds, more than 0"),
        ("stop_time = 2.2", "tolerance = 2", "experiment.tolerance is 2: give a number between 0 and 1, such as 1e-9"),
        ("stop_time = 2.2", "tolerance = -1e-9", "experiment.tolerance is -1e-09: give a number between 0 and 1"),
        (
            "stop_time = 2.2",
            'master = "best"',
            "experiment.master is 'best': give one of event-exact, ",
        ),
        ("stop_time = 2.2", "master = 1", "experiment.master is 1: give one of event-exact, "),
        ("[components.b]", '[components.""]', "a component is called '': give it a name, which connections begin with"),
        (
            'automaton = "blocks.py:Sum"',
            'automaton = "blocks.py:Sum"\ninterface = "me"',
            "components.sum.interface is 'me', and an automaton runs in this process without one: leave it out",
        ),
        ("period = 0.5", "period = 2026-01-01", "components.a.start.period is 2026-01-01: give a number"),
        ("period = 0.5", "period = [1, 2026-01-01]", "components.a.start.period is 2026-01-01: give a number"),
        ("period = 0.5", f"period = {10**400}", "components.a.start.period is a whole number of more than 64 bits"),
        (
            '["a.count", "b.count"]',
            f'{{ from = "a.count", factor = {10**400} }}',
            "connections.'sum.many'.factor is inf: give a finite number",
        ),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_entry(old, new, sentence, folder):
    path = changed(folder, old, new)
    with pytest.raises(MisfitError, match=sentence):
        read_toml(path)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("period = 0.5", "perod = 0.5", "a has no variable 'perod'"),
        ('"b.count"]', '"b.cuont"]', "b.cuont is not an output"),
        ('["a.count", "b.count"]', '"a.count"', r"sum.many has the elements \[1\] to \[2\] and a.count no elements"),
        (
            '["a.count", "b.count"]',
            '["a.count"]',
            r"sum.many has 2 elements, \[1\] to \[2\], but is given a list of 1",
        ),
        ('"blocks.py:Sum"', '"blocks.py:Sum"\nstart.total = 1.0', "sum.total is an output that the automaton computes"),
        ("count = 10", "count = [10]", "b.count is no array, but is given a list of 1: give one value"),
    ],
)
def test_what_does_not_fit_is_refused(old, new, sentence, folder):
    path = changed(folder, old, new)
    with pytest.raises(MisfitError, match=sentence):
        assemble(read_toml(path))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("period = 0.5", "perod = 0.5"),
        ('"b.count"]', '"b.cuont"]'),
        ("[inputs]", "[input]"),
        ('automaton = "blocks.py:Sum"', 'fmu = "nowhere.fmu"'),
        ("in.csv", "nowhere.csv"),
        ("stop_time = 2.2", "stop_time = -1"),
        ("stop_time = 2.2", "stop_time = 1\ntolerance = 5"),
    ],
)
def test_a_slip_in_the_file_is_wrong_usage(old, new, folder, capsys):
    assert main(["cosim", str(changed(folder, old, new))]) == 2
    assert capsys.readouterr().err.count("\n") == 1


STEPS = """
import hybrid_model as hm

class Steps(hm.HybridAutomaton):
    count = hm.DiscreteState(0.0)
    y = hm.Output({})

    def outputs(self, s):
        return {{"y": s.count + {} * s.t}}

    def due(self, s):
        return 0.3 * (s.count + 1.0)

    transitions = (hm.TimeEvent("up", due, lambda self, s: {{"count": s.count + 1.0}}),)

class Follows(hm.HybridAutomaton):
    u = hm.Input(0.0)
    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {{"x": s.u}}
"""


@pytest.mark.parametrize(
    ("declared", "slope", "hinted"), [("", 0, True), ("", 0.1, False), ("discrete=True", 0, False)]
)
def test_outputs_that_change_at_events_alone_are_told(declared, slope, hinted, tmp_path, capsys):
    (tmp_path / "steps.py").write_text(STEPS.format(declared, slope))
    (tmp_path / "system.toml").write_text(
        "experiment.stop_time = 1.0\n[components]\na.automaton = 'steps.py:Steps'\nb.automaton = 'steps.py:Follows'\n"
        "[connections]\n'b.u' = 'a.y'\n"
    )
    assert main(["cosim", str(tmp_path), "--output-file", str(tmp_path / "out.csv")]) == 0
    said = capsys.readouterr()
    # Steps of 0.3 s: 0.3 (0 + 1 + 2) + 0.1 * 3, and the ramp; within the tolerance of some steps.
    assert float(said.out.partition("b.x = ")[2]) == pytest.approx(1.2 + slope / 2.0, abs=1e-8)
    assert ("a.y changed at events alone" in said.err) == hinted


def test_an_interval_in_a_file_that_is_no_multiple_of_the_step_is_wrong_usage(folder, capsys):
    given = 'stop_time = 2.2\nmaster = "fixed-step"\noutput_interval = 0.3\nstep_size = 0.2'
    path = changed(folder, "stop_time = 2.2", given)
    assert main(["cosim", str(path)]) == 2
    told = "output_interval: the output interval is 0.3 s, which is no multiple of the communication step, 0.2 s: give"
    assert f"hybrid-fmu: {path}, {told} one." in capsys.readouterr().err


def test_a_folder_of_fmus_is_a_system_of_them(stranger, tmp_path, capsys):
    stranger("one"), stranger("two")
    assert main(["cosim", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "one.count = 2" in said
    assert "two.count = 2" in said
    (tmp_path / "empty").mkdir()
    assert main(["cosim", str(tmp_path / "empty")]) == 2
    assert "has no system.toml and no FMU" in capsys.readouterr().err


def test_a_scenario_is_no_system(tmp_path):
    (tmp_path / "scenario.toml").write_text("stop_time = 1.0\n[network]\nagents = 2\n")
    assert read_system(tmp_path / "scenario.toml") is None
    assert read_system("paper-a") is None
