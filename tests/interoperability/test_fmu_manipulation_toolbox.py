"""FMU Manipulation Toolbox: its checks, its build of our sources, and containers with our FMUs inside, run by fmpy."""

import logging
import os
import shutil
import zipfile

import fmpy
import numpy as np
import pytest
from catalogue import cases
from executions import reference, shown, values_of
from small_automata import Blinking, Listening

import hybrid_model as hm
from fmu.export import export_fmu
from hybrid_model.models import BouncingBall

reason = "fmu-manipulation-toolbox is not installed: pip install -e .[interop]"
checker = pytest.importorskip("fmu_manipulation_toolbox.checker", reason=reason)
compiler = pytest.importorskip("fmu_manipulation_toolbox.compiler", reason=reason)
containers = pytest.importorskip("fmu_manipulation_toolbox.container", reason=reason)
operations = pytest.importorskip("fmu_manipulation_toolbox.operations", reason=reason)

STATE_TOLERANCE = 1e-8
VERSIONS = ["2.0", "3.0"]


def container(folder, paths, fmi):
    made = containers.FMUContainer("container", folder, fmi_version=int(fmi[0]))
    for path in paths:
        made.get_fmu(str(path))
    return made


def run(made, path, stop, step, names, **options):
    made.make_fmu(path, step_size=step, **options)
    fmpy.read_model_description(str(path), validate=True)
    return fmpy.simulate_fmu(str(path), stop_time=stop, output_interval=step, output=names)


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", ["bouncing_ball", "newtons_cradle", "finite_state_machine", "agent2_dynamic"])
def test_its_checks_find_nothing(name, fmi, exported, caplog):
    logging.getLogger("fmu_manipulation_toolbox").propagate = True
    with caplog.at_level(logging.INFO), operations.FMU(str(exported(cases()[name].automaton, name, fmi))) as opened:
        for check in checker.get_checkers():
            opened.apply_operation(check(), None)
    assert [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING] == []
    assert f"compliant with FMI-{fmi}" in caplog.text
    assert "No semantic error" in caplog.text


@pytest.mark.parametrize("fmi", [pytest.param("2.0", marks=pytest.mark.long), "3.0"])
def test_it_builds_our_sources(fmi, exported, tmp_path, monkeypatch):
    """Without the options of our build, and with the compiler that it finds: here one that does not optimise."""
    if shutil.which("gcc") is None:
        pytest.skip("there is no gcc")
    for name in ("cc", "gcc"):
        found = shutil.which(name)
        if found is not None:
            quick = tmp_path / "bin" / name
            quick.parent.mkdir(exist_ok=True)
            quick.write_text(f'#!/bin/sh\nexec "{found}" "$@" -O0\n')
            quick.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}")
    path = exported(BouncingBall(), "ball", fmi)
    with zipfile.ZipFile(path) as ours, zipfile.ZipFile(tmp_path / "bare.fmu", "w") as bare:
        for name in ours.namelist():
            if not name.startswith("binaries"):
                bare.writestr(name, ours.read(name))
    with operations.FMU(str(tmp_path / "bare.fmu")) as opened:
        opened.apply_operation(compiler.OperationCompileSources(), None)
        opened.repack(str(tmp_path / "built.fmu"))
    runs = [fmpy.simulate_fmu(str(fmu), stop_time=2.0, output_interval=0.01) for fmu in (path, tmp_path / "built.fmu")]
    for name in ("h", "v"):
        np.testing.assert_allclose(runs[1][name], runs[0][name], rtol=0, atol=1e-10)


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", ["bouncing_ball", "thermostat", "newtons_cradle"])
def test_models_in_a_container_are_the_python_run(name, fmi, exported, tmp_path):
    case = cases()[name]
    made = container(tmp_path, [exported(case.automaton, name, fmi)], fmi)
    made.add_implicit_rule()
    step = case.t_end / 40
    found = run(made, tmp_path / "container.fmu", case.t_end, step, shown(case.automaton))
    arc = reference(name)
    away = np.min(np.abs(found["time"][:, None] - [jump.t for jump in arc.jumps]), axis=1) > 1e-9
    for variable in shown(case.automaton):
        expected = values_of(arc, variable, found["time"])
        np.testing.assert_allclose(found[variable][away], expected[away], rtol=0, atol=STATE_TOLERANCE)


@pytest.mark.parametrize(
    ("versions", "fmi", "sequential", "along", "late"),
    [
        (("2.0", "2.0"), "2.0", False, True, True),
        (("3.0", "3.0"), "3.0", False, True, True),
        (("3.0", "2.0"), "2.0", False, True, True),
        (("2.0", "2.0"), "2.0", True, True, False),
        (("2.0", "2.0"), "2.0", True, False, True),
        # The switch at the end of a step is an event of its own, behind the step: the receiver got what was sent in it.
        (("3.0", "3.0"), "3.0", True, True, True),
    ],
)
def test_signals_between_our_fmus_in_a_container(versions, fmi, sequential, along, late, exported, tmp_path):
    """In parallel mode outputs are handed over at the end of a step; the receiver follows in closed form.

    In sequential mode at once, if the FMUs are listed along the links.
    """
    sender, receiver = exported(Blinking(), "blinking", versions[0]), exported(Listening(), "listening", versions[1])
    made = container(tmp_path, [sender, receiver] if along else [receiver, sender], fmi)
    made.add_link(sender.name, "sent", receiver.name, "heard")
    made.add_output(sender.name, "sent", "sent")
    made.add_start_value(receiver.name, "gain", "2.0")
    made.add_implicit_rule(auto_link=False)
    found = run(made, tmp_path / "container.fmu", 1.0, 0.01, ["sent", "x"], sequential=sequential)
    sent = np.where((np.arange(101) // 25) % 2 == 0, 1.0, -1.0)
    np.testing.assert_array_equal(found["sent"], sent)
    x = [0.0]
    for k in range(1, 101):
        heard = sent[k - 1] if late else sent[k]
        x.append(heard + (x[-1] - heard) * np.exp(-0.02))
    np.testing.assert_allclose(found["x"], x, rtol=0, atol=STATE_TOLERANCE)


def interface(path):
    """What a container shows, and the step that it proposes."""
    description = fmpy.read_model_description(str(path))
    return {variable.name for variable in description.modelVariables}, float(description.defaultExperiment.stepSize)


@pytest.mark.parametrize(("fmi", "clocks"), [("2.0", set()), ("3.0", {"impact", "next_event"})])
def test_clocks_are_shown_by_containers_of_fmi_3_only(fmi, clocks, exported, tmp_path):
    made = container(tmp_path, [exported(BouncingBall(), "ball")], fmi)
    made.add_implicit_rule()
    made.make_fmu(tmp_path / "container.fmu", step_size=0.01)
    assert interface(tmp_path / "container.fmu")[0] == {"time", "h", "v"} | clocks


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_container_takes_the_step_that_our_fmu_proposes(fmi, tmp_path):
    export_fmu(BouncingBall(), tmp_path / "ball.fmu", fmi=fmi, stop_time=2.0)
    made = container(tmp_path, [tmp_path / "ball.fmu"], fmi)
    made.add_implicit_rule()
    made.make_fmu(tmp_path / "container.fmu")
    assert interface(tmp_path / "container.fmu")[1] == 0.005


def test_parameters_that_are_arrays_cannot_be_shown_by_its_containers(exported, tmp_path):
    """It knows lengths that are numbers, not those that are structural parameters."""
    case = cases()["agent2_dynamic"]
    made = container(tmp_path, [exported(case.automaton, "agent2_dynamic")], "3.0")
    with pytest.raises(operations.FMUError, match="structuralParameter"):
        made.add_implicit_rule(auto_parameter=True)


def test_model_exchange_in_a_container_is_euler(tmp_path):
    """Errors of the first order in the step of the container, as its integrator has them."""
    export_fmu(BouncingBall(), tmp_path / "ball.fmu", kinds=("me",))
    arc = hm.simulate(BouncingBall(), 1.0)
    errors = []
    for step in (0.002, 0.001):
        made = container(tmp_path, [tmp_path / "ball.fmu"], "3.0")
        made.add_implicit_rule()
        found = run(made, tmp_path / "container.fmu", 1.0, step, ["h"])
        errors.append(np.max(np.abs(found["h"] - arc.at("h", np.minimum(found["time"], 1.0)))))
    assert 1e-4 < errors[1] < 0.02
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.3)
