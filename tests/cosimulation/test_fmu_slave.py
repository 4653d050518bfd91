"""FMUs of both versions as slaves, ours and somebody else's."""

import gc
import math
import os
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest

import hybrid_model as hm
from cosim.cli.main import main
from cosim.errors import CosimError, MisfitError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.result import Ended
from cosim.system import System
from hybrid_model.models import BouncingBall, Thermostat

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="{version}" modelName="other" guid="{guid}">
  <{kind} modelIdentifier="other"/>
  <TypeDefinitions>
    <SimpleType name="Level"><Enumeration>
      <Item name="low" value="1"/><Item name="middle" value="2"/><Item name="high" value="3"/>
    </Enumeration></SimpleType>
  </TypeDefinitions>
  <DefaultExperiment stopTime="2"/>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="0" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="rate" valueReference="1" causality="parameter" variability="tunable"><Real start="1"/>
    </ScalarVariable>
    <ScalarVariable name="limit" valueReference="2" causality="parameter" variability="tunable"><Real start="9"/>
    </ScalarVariable>
    <ScalarVariable name="behaviour" valueReference="3" causality="parameter" variability="tunable">
      <Integer start="0"/></ScalarVariable>
    <ScalarVariable name="steps" valueReference="4" causality="output" variability="discrete"><Integer/>
    </ScalarVariable>
    <ScalarVariable name="level" valueReference="5" causality="parameter" variability="tunable">
      <Enumeration declaredType="Level" start="2"/></ScalarVariable>
    <ScalarVariable name="double_rate" valueReference="6" causality="parameter" variability="tunable">
      <Boolean start="false"/></ScalarVariable>
    <ScalarVariable name="note" valueReference="7" causality="parameter" variability="tunable"><String start=""/>
    </ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="1"/><Unknown index="5"/></Outputs></ModelStructure>
</fmiModelDescription>
"""
STUCK, ENDS, FAILS, CRAWLS, DIES, BREAKS, SHRUGS = 1, 2, 3, 4, 5, 6, 7


@pytest.fixture
def other(foreign_binary, tmp_path):
    """Somebody else's FMU, with what the description is to say."""

    variable = 'canHandleVariableCommunicationStepSize="true"'

    def write(version="2.0", kind=f"CoSimulation {variable}", guid="someone-else", member="binaries/linux64/other.so"):
        path = tmp_path / "other.fmu"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", DESCRIPTION.format(version=version, kind=kind, guid=guid))
            archive.write(foreign_binary("someone_elses.c"), member)
        return path

    return write


def run(slave, t_stop=2.0, step=0.1):
    return run_fixed_step(System([slave], {}), t_stop, step, record=[f"{slave.name}.{port}" for port in slave.outputs])


# Ours.


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_ball_under_the_fixed_step_master_is_the_python_run(fmi, exported):
    arc = hm.simulate(BouncingBall(), 2.0)
    result = run(FmuSlave("ball", exported(BouncingBall(), "ball", fmi)), step=0.05)
    times = np.array(result.times)
    for name in ("h", "v"):
        # No impact lies on a communication point.
        np.testing.assert_allclose(result.signals[f"ball.{name}"], arc.at(name, times), rtol=0, atol=1e-8)


def test_the_end_of_what_an_fmu_foresees_is_no_event(exported):
    """Impacts are at sqrt(2 h/g) and 2.4 times that: what ends in between ends with no event."""
    ball, impact = FmuSlave("ball", exported(BouncingBall())), math.sqrt(2.0 / 9.81)
    for stop, count in ((0.5 * impact, 0), (2.0 * impact, 1)):
        assert len(run_event_exact(System([ball], {}), stop).events) == count


def test_steps_that_fmi2_ends_at_events_are_carried_on(exported):
    """With the option set, fmi2DoStep answers fmi2Discard at each impact; the master sees whole steps."""
    slave = FmuSlave("ball", exported(BouncingBall(), "ball", "2.0"))
    plain = run(slave, step=0.25)
    slave.set("stop_at_events", 1.0)
    stopping = run(slave, step=0.25)
    assert stopping.times == plain.times
    for name, values in plain.signals.items():
        # The solver begins anew behind each stop.
        np.testing.assert_allclose(stopping.signals[name], values, rtol=0, atol=1e-10)


def test_zeno_of_an_fmi2_fmu_ends_the_run_in_its_own_words(exported):
    result = run(FmuSlave("ball", exported(BouncingBall(), "ball", "2.0")), t_stop=5.0, step=0.5)
    assert result.ended is Ended.ZENO
    assert "accumulate at t = 2.5586" in result.message
    # The end of an accumulation of impacts, sqrt(2 h/g) (1+e)/(1-e); the guard stops a little before it.
    assert result.t == pytest.approx(math.sqrt(2 / 9.81) * 1.7 / 0.3, abs=1e-3)


def test_an_fmi2_slave_returns_to_a_saved_state(exported):
    slave = FmuSlave("ball", exported(BouncingBall(), "ball", "2.0"))
    assert slave.can_restore
    slave.start(0.0, 2.0, events=False)
    slave.begin()
    slave.step(0.0, 0.3)
    saved = slave.save()
    slave.step(0.3, 1.0)
    first = slave.get("h"), slave.get("v")
    slave.restore(saved)
    slave.release(saved)
    slave.step(0.3, 1.0)
    assert (slave.get("h"), slave.get("v")) == first
    slave.close()


def test_two_fmi2_slaves_keep_their_messages_apart(exported):
    """fmpy has one logger for all FMUs of FMI 2.0 in a process."""
    slaves = [FmuSlave(name, exported(BouncingBall(), "ball", "2.0")) for name in ("first", "second")]
    for slave in slaves:
        slave.start(0.0, 1.0, events=False)
        slave.begin()
    for slave in slaves:
        with pytest.raises(CosimError, match=f"^{slave.name}: fmi2DoStep failed: {slave.name}: .*stop time 1"):
            slave.step(0.0, 3.0)
    for slave in slaves:
        slave.close()


def test_slaves_of_both_versions_in_one_system(exported):
    """The thermostat's temperature is the same, whichever version it comes in, and they share one process."""
    slaves = [FmuSlave(f"t{fmi[0]}", exported(Thermostat(), "thermostat", fmi)) for fmi in ("2.0", "3.0")]
    final = run_fixed_step(System(slaves, {}), 40.0, 0.5).final
    names = [name.removeprefix("t2.") for name in final if name.startswith("t2.")]
    assert names
    assert all(final[f"t2.{name}"] == final[f"t3.{name}"] for name in names)


def test_the_event_exact_master_refuses_fmi2_by_name(exported):
    system = System([FmuSlave("ball", exported(BouncingBall(), "ball", "2.0"))], {})
    with pytest.raises(MisfitError, match="ball has no event mode: use the error-controlled master"):
        run_event_exact(system, 1.0)


def test_fmpy_still_prints_what_its_own_fmus_say(exported, capfd):
    """The slave's logger hands on what is not for it."""
    path = str(exported(BouncingBall(), "ball", "2.0"))
    slave = FmuSlave("ball", path)
    run(slave)
    with pytest.raises(fmpy.fmi1.FMICallException):
        fmpy.simulate_fmu(path, stop_time=1.0, start_values={"h": math.nan}, fmi_type="CoSimulation")
    assert "finite" in capfd.readouterr().out


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_values_that_are_no_numbers_are_refused(fmi, exported):
    slave = FmuSlave("ball", exported(BouncingBall(), "ball", fmi))
    with pytest.raises(CosimError, match=r"ball\.h is set to nan: set a finite number"):
        slave.set("h", math.nan)
    with pytest.raises(MisfitError, match="ball has no variable 'hh'; it has time, "):
        slave.set("hh", 1.0)


@pytest.mark.parametrize(("fmi", "master"), [("2.0", "fixed-step"), ("3.0", "event-exact")])
def test_command_line_takes_the_master_that_fits(fmi, master, exported, capsys):
    path = exported(BouncingBall(), "ball", fmi)
    assert main(["cosim", str(path), "--stop-time", "1.0"]) == 0
    own = capsys.readouterr().out
    assert main(["cosim", str(path), "--stop-time", "1.0", "--master", master]) == 0
    assert capsys.readouterr().out == own
    assert "reached t = 1 s" in own


def test_command_line_says_that_fmi2_has_no_event_mode(exported, capsys):
    path = exported(BouncingBall(), "ball", "2.0")
    assert main(["cosim", str(path), "--stop-time", "1.0", "--master", "event-exact"]) == 2
    assert "has no event mode" in capsys.readouterr().err


# Somebody else's.


def test_someone_elses_fmu_runs(other):
    slave = FmuSlave("other", other())
    assert (slave.has_event_mode, slave.can_restore, slave.default_stop_time) == (False, False, 2.0)
    assert slave.variable_names == ["x", "rate", "limit", "behaviour", "steps", "level", "double_rate", "note"]
    result = run(slave)
    # The FMU multiplies 20 factors, each rounded.
    assert result.final["other.x"] == pytest.approx(math.exp(-2.0), rel=1e-14)
    assert result.final["other.steps"] == 20


def test_integers_booleans_and_enumerations_are_numbers(other):
    slave = FmuSlave("other", other())
    for name, value in (("rate", 0.5), ("double_rate", 1.0), ("level", 3.0)):
        slave.set(name, value)
    slave.start(0.0, 2.0, events=False)
    slave.begin()
    slave.step(0.0, 2.0)
    assert slave.get("x") == pytest.approx(math.exp(-2.0), rel=1e-14)
    assert (slave.get("level"), slave.get("double_rate")) == (3.0, 1.0)
    slave.close()


def test_discarded_steps_are_carried_on_from_the_last_successful_time(other):
    slave = FmuSlave("other", other())
    slave.set("limit", 0.03)
    result = run(slave)
    assert result.final["other.x"] == pytest.approx(math.exp(-2.0), rel=1e-13)
    # Steps of 0.1 in parts of at most 0.03; rounding may leave a part more.
    assert 80 <= result.final["other.steps"] <= 100


def test_an_fmu_that_ends_the_run_says_when_and_why(other):
    slave = FmuSlave("other", other())
    slave.set("behaviour", ENDS)
    result = run(slave, step=0.3)
    assert result.ended is Ended.FINISHED
    assert result.message == "other ended the run at t = 1 s: the tank ran empty at 1"
    assert (result.t, result.times[-1]) == (1.0, 1.0)
    assert result.signals["other.x"][-1] == pytest.approx(math.exp(-1.0), rel=1e-14)


@pytest.mark.parametrize(
    ("behaviour", "sentence"),
    [
        (SHRUGS, "other returns from a step at 0 s and gets no further"),
        (STUCK, "other returns from a step at 0 s and gets no further"),
        (CRAWLS, "other returned early from one step 10000 times"),
        (FAILS, "other: fmi2DoStep failed: no solution at 0"),
    ],
)
def test_steps_that_lead_nowhere_are_errors(behaviour, sentence, other):
    slave = FmuSlave("other", other())
    slave.set("behaviour", behaviour)
    with pytest.raises(CosimError, match=sentence):
        run(slave)


def test_nothing_is_called_after_a_fatal_answer(other):
    slave = FmuSlave("other", other())
    slave.set("behaviour", BREAKS)
    freed, free = [], slave.load().free
    slave.load().free = lambda: freed.append(free())
    with pytest.raises(CosimError, match="other: fmi2DoStep failed"):
        run(slave)
    assert freed == []


def test_an_fmu_that_refuses_to_be_instantiated_is_quoted(other):
    slave = FmuSlave("other", other(guid="nobody"))
    with pytest.raises(CosimError, match="other refuses to be instantiated: this is no block number 7"):
        run(slave)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"kind": "ModelExchange"}, r"it says FMI 2\.0, Model Exchange\): export it as one"),
        ({"version": "1.0"}, "other"),
        ({"member": "../other.so"}, "cannot be read as an FMU: .*other.so"),
    ],
)
def test_files_that_are_no_cosimulation_fmu_are_refused(given, sentence, other):
    with pytest.raises(CosimError, match=sentence):
        FmuSlave("other", other(**given))


def test_an_fmu_for_another_machine_is_refused_when_it_is_loaded(other):
    slave = FmuSlave("other", other(member="binaries/win64/other.dll"))
    with pytest.raises(CosimError, match=r"there is no binaries/linux64/other\.so in it; it has binaries for win64"):
        run(slave)


def test_a_slave_that_is_gone_leaves_nothing(other):
    slave = FmuSlave("other", other())
    run(slave)
    folder = Path(slave.load().fmu.unzipDirectory)
    assert folder.is_dir()
    del slave
    gc.collect()
    assert not folder.exists()


def test_a_binary_that_cannot_be_loaded_leaves_this_process_where_it_is(tmp_path):
    path, here = tmp_path / "other.fmu", os.getcwd()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "modelDescription.xml", DESCRIPTION.format(version="2.0", kind="CoSimulation", guid="someone-else")
        )
        archive.writestr("binaries/linux64/other.so", "no library at all")
    with pytest.raises(CosimError, match="cannot be loaded on this machine"):
        FmuSlave("other", path).load()
    assert os.getcwd() == here


def test_nothing_is_left_of_an_fmu_that_ends_the_process(other, tmp_path):
    place = tmp_path / "temporary"
    place.mkdir()
    code = (
        "from cosim.fmu_slave import FmuSlave\n"
        f"slave = FmuSlave('other', {str(other())!r})\n"
        f"slave.set('behaviour', {DIES})\n"
        "slave.start(0.0, 1.0, events=False)\n"
        "slave.begin()\n"
        "slave.step(0.0, 1.0)\n"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env={**os.environ, "TMPDIR": str(place)}, capture_output=True, check=False)
    assert done.returncode == 7
    for _ in range(600):  # another process removes it, at its own speed
        if not list(place.iterdir()):
            break
        time.sleep(0.05)
    assert list(place.iterdir()) == []


class Doubles(hm.HybridAutomaton):
    x = hm.State(1.0, output=True)
    y = hm.Output()

    def flow_map(self, s):
        return {"x": 0.0}

    def outputs(self, s):
        return {"y": 2.0 * s.x}


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_what_an_fmu_computes_is_no_start_value(fmi, exported):
    slave = FmuSlave("it", exported(Doubles(), "doubles", fmi))
    slave.set("x", 3.0)
    with pytest.raises(MisfitError, match=r"it\.y is computed by the FMU \(initial: calculated\): set parameters"):
        slave.set("y", 3.0)
    with pytest.raises(MisfitError, match=r"it\.der\(x\) is computed by the FMU"):
        slave.set("der(x)", 3.0)
