"""fmuloader: the functions of FMI by ctypes and nothing else, so the calls here are those of the standard."""

import fmpy
import numpy as np
import pytest
from catalogue import cases
from executions import reference, shown, values_of

import hybrid_model as hm

reason = "fmuloader is not installed: pip install -e .[interop]"
fmi2 = pytest.importorskip("fmuloader.fmi2", reason=reason)
fmi3 = pytest.importorskip("fmuloader.fmi3", reason=reason)

STATE_TOLERANCE = 1e-8
TIME_TOLERANCE = 1e-7


def description(path):
    """The token of the FMU, and its variables by name: fmuloader does not read descriptions."""
    found = fmpy.read_model_description(str(path))
    return found, {variable.name: variable for variable in found.modelVariables}


def read(slave, variable):
    getter = {"Real": "real", "Integer": "integer", "Float64": "float64", "Int32": "int32"}[variable.type]
    return getattr(slave, f"get_{getter}")([variable.valueReference])[0]


def loaded(path, fmi, found):
    module = fmi2.Fmi2Slave if fmi == "2.0" else fmi3.Fmi3Slave
    return module(path, model_identifier=found.coSimulation.modelIdentifier)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("name", ["bouncing_ball", "thermostat", "newtons_cradle"])
def test_cosimulation_is_the_python_run_after_reset_too(name, fmi, exported):
    case = cases()[name]
    path = exported(case.automaton, name, fmi)
    found, variables = description(path)
    arc = reference(name)
    step = case.t_end / 40
    with loaded(path, fmi, found) as slave:
        for again in (False, True):
            if again:
                slave.reset()
            elif fmi == "2.0":
                slave.instantiate("block", fmi2.Fmi2Type.CO_SIMULATION, guid=found.guid)
            else:
                slave.instantiate_co_simulation("block", instantiation_token=found.guid)
            if fmi == "2.0":
                slave.setup_experiment(0.0, case.t_end)
                slave.enter_initialization_mode()
            else:
                slave.enter_initialization_mode(0.0, case.t_end)
            slave.exit_initialization_mode()
            for k in range(40):
                slave.do_step(k * step, step)
                t = (k + 1) * step
                if min(abs(jump.t - t) for jump in arc.jumps) < 1e-9:
                    continue
                for output in shown(case.automaton):
                    assert abs(read(slave, variables[output]) - values_of(arc, output, t)) < STATE_TOLERANCE, (
                        output,
                        t,
                    )
        slave.terminate()


@pytest.mark.parametrize("name", ["bouncing_ball", "thermostat", "newtons_cradle"])
def test_event_mode_with_early_return_gives_the_times_of_the_python_run(name, exported):
    """Steps of a twentieth of the run, cut short by the FMU itself at each event."""
    case = cases()[name]
    path = exported(case.automaton, name)
    found, _ = description(path)
    arc = reference(name)
    events = []
    with loaded(path, "3.0", found) as slave:
        slave.instantiate_co_simulation(
            "block", instantiation_token=found.guid, event_mode_used=True, early_return_allowed=True
        )
        slave.enter_initialization_mode(0.0, case.t_end)
        slave.exit_initialization_mode()
        while slave.update_discrete_states().discrete_states_need_update:
            pass
        slave.enter_step_mode()
        t = 0.0
        while t < case.t_end - 1e-9:
            done = slave.do_step(t, min(case.t_end / 20, case.t_end - t))
            assert not done.terminate_simulation
            t = done.last_successful_time
            if done.event_handling_needed:
                slave.enter_event_mode()
                while slave.update_discrete_states().discrete_states_need_update:
                    pass
                slave.enter_step_mode()
                events.append(t)
        slave.terminate()
    expected = sorted({jump.t for jump in arc.jumps if jump.t < case.t_end - 1e-9})
    assert len(events) >= len(expected) >= 3
    for t in expected:
        assert np.min(np.abs(np.array(events) - t)) < TIME_TOLERANCE


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_states_are_kept_and_set_back_between_instances(fmi, exported):
    """The bytes of a state, taken by one instance, go on in another: bit for bit."""
    automaton = hm.models.BouncingBall()
    path = exported(automaton, "ball", fmi)
    found, variables = description(path)
    ends = []
    kept = None
    for _ in range(2):
        with loaded(path, fmi, found) as slave:
            if fmi == "2.0":
                slave.instantiate("ball", fmi2.Fmi2Type.CO_SIMULATION, guid=found.guid)
                slave.setup_experiment(0.0)
            else:
                slave.instantiate_co_simulation("ball", instantiation_token=found.guid)
            slave.enter_initialization_mode()
            slave.exit_initialization_mode()
            if kept is None:
                for k in range(5):
                    slave.do_step(0.125 * k, 0.125)
                state = slave.get_fmu_state()
                kept = slave.serialize_fmu_state(state)
            else:
                state = slave.deserialize_fmu_state(kept)
                slave.set_fmu_state(state)
            slave.free_fmu_state(state)
            for k in range(5, 12):
                slave.do_step(0.125 * k, 0.125)
            ends.append([read(slave, variables[name]) for name in ("h", "v")])
            slave.terminate()
    assert ends[0] == ends[1]
