"""The run in child processes: each fault of a small FMU becomes the finding that names it, and no sound FMU has one."""

import os
import subprocess
import sys
import time

import pytest
from small_fmus import DESCRIPTIONS, PLAIN, SCHEDULED, members, only, write

from fmu.check.child_process import RunLimits
from fmu.check.findings import Severity
from fmu.check.fmu_file import check_fmu

# Generous for a machine under load: only what hangs takes all of it.
LIMITS = RunLimits(seconds=30.0, memory=512 << 20)


def check(tmp_path, major, *faults, description=None, limits=LIMITS):
    return check_fmu(write(tmp_path / "small.fmu", members(major, *faults, description=description)), run_limits=limits)


def errors(report):
    return {finding.rule for finding in report.findings if finding.severity is Severity.ERROR}


@pytest.mark.parametrize("major", [2, 3])
def test_a_sound_fmu_has_no_finding(major, tmp_path):
    report = check(tmp_path, major)
    assert report.findings == []
    assert set(report.executed) == {"CoSimulation", "ModelExchange"}


def test_scheduled_execution_runs(tmp_path):
    report = check(tmp_path, 3, description=SCHEDULED)
    assert report.findings == []
    assert report.executed == ("ScheduledExecution",)


FAULTS = [
    ("TOKEN", (2, 3), "run.token"),
    ("INSTANTIATE", (2, 3), "run.instantiate"),
    ("CRASH", (2, 3), "run.crash"),
    ("ABORT", (3,), "run.crash"),
    ("EXIT", (2, 3), "run.exit"),
    ("NAN", (2, 3), "run.nan"),
    ("GETTER", (2, 3), "run.getter"),
    ("UNREADABLE", (2, 3), "run.refused"),
    ("ANY_STEP", (2, 3), "run.bad_step"),
    ("RESET", (2, 3), "run.reset"),
    ("REPEAT", (2, 3), "run.reset"),
    ("STATE", (2, 3), "run.state"),
    ("SERIALIZE", (3,), "run.serialize"),
    ("ITERATION", (2, 3), "run.iteration"),
    ("NEXT_TIME", (3,), "run.next_time"),
    ("LAST_TIME", (3,), "run.time"),
    ("PROGRESS", (3,), "run.progress"),
    ("COUNTS", (3,), "run.counts"),
    ("NEEDS_EVENT_MODE", (3,), "run.step"),
]


@pytest.mark.parametrize(
    ("fault", "major", "rule"), [(f, major, rule) for f, majors, rule in FAULTS for major in majors]
)
def test_each_fault_is_found(fault, major, rule, tmp_path):
    kind = "ModelExchange" if fault in ("COUNTS", "ITERATION") else "CoSimulation"
    assert rule in errors(check(tmp_path, major, fault, description=only(kind, DESCRIPTIONS[major])))


DIRECTIONAL = {
    2: 'canGetAndSetFMUstate="true" providesDirectionalDerivative="true"',
    3: 'canGetAndSetFMUState="true" providesDirectionalDerivatives="true" providesAdjointDerivatives="true"',
}


@pytest.mark.parametrize(
    ("fault", "major", "rule"),
    [
        ("NONE", 2, None),
        ("NONE", 3, None),
        ("DERIVATIVE_LINEAR", 2, "run.derivative"),
        ("DERIVATIVE_NAN", 3, "run.derivative"),
        ("DERIVATIVE_REFUSED", 3, "run.refused"),
        ("ADJOINT", 3, "run.derivative"),
        ("OUTPUT_DERIVATIVE", 3, "run.nan"),
    ],
)
def test_derivatives_that_are_promised_are_asked_for(fault, major, rule, tmp_path):
    flag = DIRECTIONAL[major].partition(" ")[0]
    text = DESCRIPTIONS[major].replace(flag, DIRECTIONAL[major])
    text = text.replace("canHandleVariable", 'maxOutputDerivativeOrder="1" canHandleVariable')
    report = check(tmp_path, major, fault, description=text)
    assert {finding.rule for finding in report.findings} == ({rule} if rule else set())


def test_a_hang_on_nan_is_named_and_ends(tmp_path):
    began = time.monotonic()
    report = check(tmp_path, 3, "HANG", description=PLAIN, limits=RunLimits(seconds=4.0))
    [finding] = [finding for finding in report.findings if finding.rule == "run.hang"]
    assert "fmi3DoStep(0.0, nan)" in finding.message
    assert time.monotonic() - began < 60.0  # it would take for ever


def test_a_flood_of_output_is_limited(tmp_path):
    """The limit of file size holds on stdout: the disk is not filled while the time runs out."""
    report = check(tmp_path, 3, "FLOOD", description=PLAIN, limits=RunLimits(seconds=2.0, file_bytes=1 << 20))
    assert errors(report) == {"run.hang"}
    assert any("talkative" in finding.message for finding in report.findings)


def test_memory_is_limited(tmp_path):
    report = check(tmp_path, 3, "MEMORY", description=PLAIN, limits=RunLimits(seconds=20.0, memory=192 << 20))
    assert {"run.crash"} == errors(report)
    assert all("fmi3Instantiate" in f.message for f in report.findings)


@pytest.mark.parametrize(
    ("fault", "rule", "text"), [("STDOUT", "stdout", "hello from"), ("FILE", "files", "solver.log")]
)
def test_traces_in_the_host_are_warnings(fault, rule, text, tmp_path):
    report = check(tmp_path, 2, fault)
    assert report.ok
    found = [finding for finding in report.findings if finding.rule == f"run.{rule}"]
    assert found
    assert all(f.severity is Severity.WARNING and text in f.message for f in found)


def test_a_discarded_step_is_a_note(tmp_path):
    report = check(tmp_path, 2, "DISCARD")
    assert report.ok
    assert any(finding.rule == "run.discard" for finding in report.findings)


def test_a_run_of_many_events_is_cut_short(tmp_path):
    """Thousands of early returns are legal as long as time goes on."""
    report = check(tmp_path, 3, "MANY", description=only("CoSimulation", DESCRIPTIONS[3]))
    [cut, *_] = [finding for finding in report.findings if finding.rule == "run.long"]
    assert "ends at t = 0.500" in cut.message
    assert cut.severity is Severity.NOTE
    assert "run.progress" not in errors(report)


def test_a_start_value_that_the_fmu_refuses_is_named(tmp_path):
    text = DESCRIPTIONS[3].replace(
        'name="margin" valueReference="4"', 'name="margin" valueReference="4" initial="exact" start="2"'
    )
    report = check(tmp_path, 3, description=text)
    assert "run.refused" in errors(report)
    assert any("fmi3SetFloat64(margin)" in finding.message for finding in report.findings)


def test_a_binary_that_does_not_load_is_named(tmp_path):
    report = check(tmp_path, 3, "UNDEFINED")
    assert errors(report) == {"run.load"}
    assert any("solver_of_the_vendor" in finding.message for finding in report.findings)


def test_without_the_run_nothing_is_executed(tmp_path):
    report = check_fmu(write(tmp_path / "small.fmu", members(3, "CRASH")), run=False)
    assert report.ok
    assert report.executed == ()
    assert [finding.rule for finding in report.findings] == ["run.off"]


def test_the_host_keeps_its_folder_and_leaves_no_file(tmp_path):
    """A process of its own makes the check, with its own folder for temporary files."""
    fmu = write(tmp_path / "small.fmu", members(3, "CRASH", "FILE"))
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    code = (
        "import os, sys; from fmu.check.fmu_file import check_fmu; before = os.getcwd(), dict(os.environ)\n"
        "report = check_fmu(sys.argv[1]); assert not report.ok; assert before == (os.getcwd(), dict(os.environ))"
    )
    subprocess.run(
        [sys.executable, "-c", code, str(fmu)], check=True, cwd=tmp_path, env={**os.environ, "TMPDIR": str(temporary)}
    )
    assert list(temporary.iterdir()) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["small.fmu", "temporary"]


def test_what_the_fmu_starts_ends_with_it(tmp_path):
    """A child of the child does not outlive the time limit."""
    report = check(tmp_path, 3, "FORK", description=PLAIN, limits=RunLimits(seconds=1.0))
    assert "run.hang" in errors(report)
    listed = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True, check=True).stdout
    assert "sleep 3141592" not in listed
