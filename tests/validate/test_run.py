"""The run in child processes: each fault of a small FMU becomes the finding that names it, and no sound FMU has one."""

import os
import subprocess
import sys
import time

import pytest
from small_fmus import DESCRIPTIONS, EXTENSION, PLAIN, SCHEDULED, members, only, write

from fmu.validate.check import check_fmu
from fmu.validate.findings import Severity
from fmu.validate.smoke.child_process import RunLimits

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
    ("INSTANTIATE", (2, 3), "run.instantiate"),
    ("CRASH", (2, 3), "run.crash"),
    ("ABORT", (3,), "run.crash"),
    ("PARENT", (3,), "run.crash"),
    ("EXIT", (2, 3), "run.exit"),
    ("NAN", (2, 3), "run.nan"),
    ("GETTER", (2, 3), "run.getter"),
    ("UNREADABLE", (2, 3), "run.refused"),
    ("RESET", (2, 3), "run.reset"),
    ("REPEAT", (2, 3), "run.reset"),
    ("STATE", (2, 3), "run.state"),
    ("SERIALIZE", (2, 3), "run.serialize"),
    ("ITERATION", (2, 3), "run.iteration"),
    ("NEXT_TIME", (3,), "run.next_time"),
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


def warnings(report):
    return {finding.rule for finding in report.findings if finding.severity is Severity.WARNING}


@pytest.mark.parametrize("major", [2, 3])
@pytest.mark.parametrize(("fault", "rule"), [("TOKEN", "run.token"), ("ANY_STEP", "run.bad_step")])
def test_what_no_importer_does_is_a_warning(fault, rule, major, tmp_path):
    report = check(tmp_path, major, fault, description=only("CoSimulation", DESCRIPTIONS[major]))
    assert errors(report) == set()
    assert warnings(report) == {rule}


def test_differences_within_a_tolerance_are_warnings(tmp_path):
    """A solver may take other steps after a reset; its users hardly meet that."""
    report = check(tmp_path, 3, "REPEAT", "-DREPEATED=1e-6", description=PLAIN)
    assert errors(report) == set()
    assert warnings(report) == {"run.reset", "run.repeat"}
    assert all("a solver's tolerance" in finding.message for finding in report.findings)


def test_a_difference_is_told_with_its_values(tmp_path):
    report = check(tmp_path, 3, "REPEAT", description=PLAIN)
    [text] = [finding.message for finding in report.findings if finding.rule == "run.reset"]
    # x goes from 1 to 0.9 in a step of 0.1; the run after the reset begins with the eleventh step that is counted.
    assert "'y' has another value after a reset than at first, from t = 0.1 on: 1.0, not 0.9" in text


def test_a_finding_of_several_experiments_is_told_once(tmp_path):
    report = check(tmp_path, 3, "UNREADABLE", description=only("CoSimulation", DESCRIPTIONS[3]))
    [finding] = report.findings
    assert "CoSimulation, life cycle (and " in finding.message


def test_a_last_successful_time_beside_the_end_of_the_step_is_a_warning(tmp_path):
    """Without an early return FMI 3.0.2 lets the two differ."""
    report = check(tmp_path, 3, "LAST_TIME", description=PLAIN)
    [finding] = report.findings
    assert (finding.rule, finding.severity) == ("run.time", Severity.WARNING)


def test_what_a_crashing_fmu_printed_is_told(tmp_path):
    report = check(tmp_path, 3, "CRASH", description=PLAIN)
    assert any("the solver lost its way" in f.message for f in report.findings if f.rule == "run.crash")


@pytest.mark.parametrize(("step", "points"), [("1", 1), ("0.4", 2), ("0.1", 10), ("0.05", 20)])
@pytest.mark.parametrize("major", [2, 3])
def test_no_experiment_goes_beyond_its_stop_time(step, points, major, tmp_path):
    """Steps of one and of an odd number in a run, and sums of steps that are larger than the stop time by rounding."""
    text = only("CoSimulation", DESCRIPTIONS[major]).replace('stepSize="0.1"', f'stepSize="{step}"')
    assert check(tmp_path, major, "STOP", description=text).findings == []


@pytest.mark.parametrize("major", [2, 3])
def test_the_place_of_resources_is_given(major, tmp_path):
    """Packers drop empty folders: importers make them again."""
    assert check(tmp_path, major, "RESOURCES", description=only("CoSimulation", DESCRIPTIONS[major])).findings == []


def test_a_run_that_ends_early_after_a_reset_is_told_with_both_times(tmp_path):
    report = check(tmp_path, 3, "RESET_ENDS", description=PLAIN)
    [text] = [finding.message for finding in report.findings if finding.rule == "run.reset"]
    assert "ends at t = 0.1, the first one at t = 1.0" in text


@pytest.mark.parametrize("stiffness", [1e4, 1e12])
@pytest.mark.parametrize("major", [2, 3])
def test_a_stiff_model_stays_finite(stiffness, major, tmp_path):
    """Steps of a thousandth of the run would be unstable by factors of 10 and 1e9."""
    text = only("ModelExchange", DESCRIPTIONS[major]).replace(
        'fixed"><Real start="1"/>', f'fixed"><Real start="{stiffness}"/>'
    )
    text = text.replace('variability="fixed" start="1"', f'variability="fixed" start="{stiffness}"')
    report = check(tmp_path, major, f"-DSTIFFNESS={stiffness}", description=text)
    assert report.findings == []


@pytest.mark.skipif(EXTENSION != ".so", reason="options of the ELF linker")
def test_a_library_that_this_machine_lacks_is_told_once_and_is_no_error(tmp_path):
    source, library = tmp_path / "vendor.c", tmp_path / "libvendor.so.7"
    source.write_text("void solver_of_the_vendor(void) {}\n")
    subprocess.run(["cc", "-shared", "-fPIC", "-Wl,-soname,libvendor.so.7", source, "-o", library], check=True)
    needed = (f"-L{tmp_path}", "-Wl,--no-as-needed", "-l:libvendor.so.7")
    report = check(tmp_path, 3, "UNDEFINED", *needed, description=PLAIN)
    assert report.ok
    assert report.executed == ()
    [finding] = [finding for finding in report.findings if finding.rule == "run.library"]
    assert "libvendor.so.7" in finding.message


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
    report = check(tmp_path, 3, "HANG", description=PLAIN, limits=RunLimits(seconds=30.0, bad_step_seconds=0.2))
    [finding] = [finding for finding in report.findings if finding.rule == "run.hang"]
    assert "fmi3DoStep(0.0, nan): no answer within 0.2 s" in finding.message
    assert finding.severity is Severity.WARNING
    assert time.monotonic() - began < 60.0  # it would take for ever


def test_a_bad_step_has_two_seconds():
    assert RunLimits().bad_step_seconds == 2.0


def test_a_flood_of_output_is_limited(tmp_path):
    """The limit of file size holds on stdout: the disk is not filled while the time runs out."""
    report = check(tmp_path, 3, "FLOOD", description=PLAIN, limits=RunLimits(seconds=1.0, file_bytes=1 << 20))
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
        "import os, sys; from fmu.validate.check import check_fmu; before = os.getcwd(), dict(os.environ)\n"
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
