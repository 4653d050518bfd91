"""`hybrid-fmu validate` as its users see it: output, exit status, JSON; own exports are sound."""

import json
import subprocess
import sys

import pytest
from catalogue import cases
from small_fmus import DESCRIPTIONS, PLAIN, members, only, write

from cosim.cli.main import main
from fmu.export import export_fmu
from fmu.validate.check import check_fmu
from hybrid_model.models import BouncingBall


def run(capsys, *arguments):
    status = main(["validate", *map(str, arguments)])
    return status, capsys.readouterr().out


def test_a_sound_fmu_is_status_0(tmp_path, capsys):
    status, text = run(capsys, write(tmp_path / "small.fmu", members(2)))
    assert status == 0
    assert "sound: 0 errors, 0 warnings, 0 notes; run: CoSimulation, ModelExchange" in text


def test_a_fault_is_status_1_and_is_grouped(tmp_path, capsys):
    text = only("CoSimulation", DESCRIPTIONS[3]).replace('stopTime="1"', 'stopTime="-1"')
    status, printed = run(capsys, write(tmp_path / "small.fmu", members(3, "CRASH", "STDOUT", description=text)))
    assert status == 1
    assert "\nexperiment\n  error   " in printed
    assert "\nrun\n  error   " in printed
    assert printed.index("SIGSEGV") < printed.index("stdout")  # the worst first
    assert "NOT SOUND" in printed
    assert max(map(len, printed.splitlines()[1:])) <= 120


def test_json_for_machines(tmp_path, capsys):
    path = write(tmp_path / "small.fmu", members(3, "UNREADABLE"))
    status, printed = run(capsys, path, "--json")
    report = json.loads(printed)
    assert status == 1
    assert report["file"] == str(path)
    assert (report["ok"], report["fmi_version"], report["errors"]) == (False, "3.0", 2)
    assert sorted(report["kinds"]) == sorted(report["executed"]) == ["CoSimulation", "ModelExchange"]
    assert {f["rule"] for f in report["findings"]} == {"run.refused"}
    assert all(f.keys() == {"severity", "rule", "message", "reference"} for f in report["findings"])


def test_no_run_executes_nothing(tmp_path, capsys):
    path = write(tmp_path / "small.fmu", members(3, "CRASH"))
    assert run(capsys, path, "--no-run")[0] == 0
    assert json.loads(run(capsys, path, "--no-run", "--json")[1])["executed"] == []


def test_what_no_importer_does_decides_no_verdict(tmp_path, capsys):
    """A wrong token is taken, a negative step done: warnings, which only --strict counts."""
    path = write(tmp_path / "small.fmu", members(3, "TOKEN", "ANY_STEP", description=PLAIN))
    status, printed = run(capsys, path)
    assert status == 0
    assert "\nsound: 0 errors, 3 warnings" in printed
    status, printed = run(capsys, path, "--strict")
    assert status == 1
    assert "\nNOT SOUND by --strict: 0 errors, 3 warnings" in printed


def test_strict_counts_warnings(tmp_path, capsys):
    path = write(tmp_path / "small.fmu", members(3, "SYMBOLS"))
    assert run(capsys, path, "--no-run")[0] == 0
    assert run(capsys, path, "--no-run", "--strict")[0] == 1


def test_a_time_limit_is_obeyed(tmp_path, capsys):
    path = write(tmp_path / "small.fmu", members(3, "HANG", description=PLAIN))
    status, printed = run(capsys, path, "--timeout", "4", "--strict")
    assert status == 1
    assert "hangs in fmi3DoStep(0.0, nan)" in " ".join(printed.split())


@pytest.mark.parametrize(
    "arguments", [[], ["gone.fmu"], ["a.fmu", "--timeout", "0"], ["a.fmu", "--memory", "x"], ["--bogus"]]
)
def test_wrong_usage_is_status_2(arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "a.fmu", members(3))
    try:
        status = main(["validate", *arguments])
    except SystemExit as usage:
        status = usage.code
    assert status == 2
    assert capsys.readouterr().out == ""


def test_help_says_that_code_is_executed(capsys):
    with pytest.raises(SystemExit):
        main(["validate", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert "executes the FMU's native code" in text
    assert "--no-run" in text


def test_names_of_strangers_reach_no_terminal(tmp_path, capsys):
    """An escape sequence in a name is printed as text."""
    text = DESCRIPTIONS[3].replace('name="margin"', 'name="\x9b31m\u202emargin"')
    _, printed = run(capsys, write(tmp_path / "small.fmu", members(3, description=text)), "--no-run")
    assert "\x9b" not in printed
    assert "\u202e" not in printed
    assert "margin" in printed


def test_the_static_part_loads_no_native_code_of_the_fmu(tmp_path):
    path = write(tmp_path / "small.fmu", members(3))
    code = (
        "import sys; from fmu.validate.check import check_fmu; check_fmu(sys.argv[1], run=False);"
        "assert 'small' not in open('/proc/self/maps').read()"
    )
    if sys.platform != "linux":
        pytest.skip("asks /proc")
    subprocess.run([sys.executable, "-c", code, str(path)], check=True)


@pytest.mark.parametrize("name", ["bouncing_ball", "thermostat", "integrator", "switching"])
def test_own_exports_are_sound(name, exported):
    require_sound(check_fmu(exported(cases()[name].automaton, name)))


def test_an_own_fmi_2_export_is_sound_and_its_messages_are_read(tmp_path):
    """The ball comes to rest within the experiment; FMI 2 tells why by a format and its argument."""
    report = check_fmu(export_fmu(BouncingBall(), tmp_path / "ball.fmu", fmi="2.0", stop_time=3.0))
    assert report.executed == report.kinds == ("CoSimulation", "ModelExchange")
    assert {finding.rule for finding in report.findings} == {"run.discard"}
    assert all("Zeno" in finding.message for finding in report.findings)


@pytest.mark.long
@pytest.mark.parametrize("name", cases())
def test_all_own_exports_are_sound(name, exported):
    require_sound(check_fmu(exported(cases()[name].automaton, name)))


def require_sound(report):
    assert report.executed == report.kinds
    # The clocks are the one wrong finding of fmpy that is known; a converter switches more often than is watched.
    allowed = ("fmpy.clocks", "run.ended", "run.long", "run.state")
    assert [finding for finding in report.findings if finding.rule not in allowed] == []
