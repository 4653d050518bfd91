"""An exported FMU is right in each way that importers use it: fmpy as it is, with and without event mode."""

import itertools
import math

import fmpy
import numpy as np
import pytest
from catalogue import cases
from executions import reference

import hybrid_model as hm
from hybrid_model.models import BouncingBall

USES = {
    "event mode off": {},
    "event mode, early return": {"use_event_mode": True, "early_return_allowed": True},
    "event mode without early return": {"use_event_mode": True},
}


def error_on_either_side(arc, name, times, values):
    """Distance from the run; at the time of an event fmpy writes a row for each side, and times differ by rounding."""
    sides = [arc.at(name, np.clip(times + shift, arc.t[0], arc.t[-1])) for shift in (-1e-10, 1e-10)]
    return np.minimum(*(np.abs(np.asarray(values) - side) for side in sides))


@pytest.mark.parametrize("use", USES)
def test_bouncing_ball_in_fmpy_equals_python_run(use, exported):
    """Jumps happen inside at exact times, or the FMU stops itself at them; either way the outputs are exact."""
    arc = hm.simulate(BouncingBall(), 2.0)
    result = fmpy.simulate_fmu(
        str(exported(BouncingBall(), "ball")), stop_time=2.0, output_interval=0.1, output=["h", "v"], **USES[use]
    )
    for name in ("h", "v"):
        # Falling for 1e-10 s changes h by less than 1e-9 and v by 1e-9.
        assert error_on_either_side(arc, name, result["time"], result[name]).max() < 1e-8


def test_events_are_rows_of_their_own_in_event_mode(exported):
    result = fmpy.simulate_fmu(
        str(exported(BouncingBall(), "ball")), stop_time=1.0, output_interval=0.25, **USES["event mode, early return"]
    )
    impact = np.sqrt(2 / 9.81)
    rows = [row for row in result if abs(row["time"] - impact) < 1e-9]
    assert len(rows) == 2
    assert rows[0]["v"] == pytest.approx(-9.81 * impact, abs=1e-9)
    assert rows[1]["v"] == pytest.approx(0.7 * 9.81 * impact, abs=1e-9)


@pytest.mark.parametrize("use", USES)
def test_agent_with_changing_inputs_in_fmpy(use, exported):
    """The neighbours' broadcasts come as discrete inputs at communication points."""
    case = cases()["agent2_dynamic"]
    changes = {name: dict(steps) for name, steps in case.steps.items()}
    times = sorted({0.0, case.t_end, *itertools.chain(*changes.values())})
    start = {"neighbours[1]": 0.0, "neighbours[2]": 0.0}
    rows = []
    for t in times:
        start.update({name: steps[t] for name, steps in changes.items() if t in steps})
        rows.append((t, *start.values()))
    signals = np.array(rows, dtype=[("time", float), *((name, float) for name in start)])
    arc = reference("agent2_dynamic")
    result = fmpy.simulate_fmu(
        str(exported(case.automaton, "agent2_dynamic")),
        stop_time=case.t_end,
        output_interval=0.5,
        input=signals,
        output=["x", "broadcast", "events"],
        **USES[use],
    )
    events = arc.event_times("trigger.broadcast")
    assert len(events) == result["events"][-1] > 3
    assert error_on_either_side(arc, "x", result["time"], result["x"]).max() < 1e-8


@pytest.mark.parametrize("name", list(cases()))
def test_every_declared_variable_is_readable_right_after_initialisation(name, exported):
    path = str(exported(cases()[name].automaton, name))
    description = fmpy.read_model_description(path)
    folder = fmpy.extract(path)
    # A jump that is due at the start has been taken, or shows in the values already.
    quiet = hm.Execution(cases()[name].automaton).due() is None
    for events in (False, True):
        fmu = fmpy.fmi3.FMU3Slave(
            guid=description.instantiationToken,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="block",
        )
        fmu.instantiate(eventModeUsed=events, earlyReturnAllowed=events)
        fmu.enterInitializationMode(startTime=0.0)
        fmu.exitInitializationMode()
        for variable in description.modelVariables:
            size = () if variable.type == "Clock" else (math.prod(variable.shape or ()),)
            values = getattr(fmu, f"get{variable.type}")([variable.valueReference], *size)
            assert np.all(np.isfinite(values))
            if variable.start is not None and variable.type != "Clock" and quiet:
                assert list(map(float, values)) == list(map(float, str(variable.start).split()))
        fmu.terminate()
        fmu.freeInstance()


class Sampler(hm.HybridAutomaton):
    """Takes its input every 1/8 s."""

    u = hm.Input(0.0)
    y = hm.DiscreteState(0.0, output=True)
    k = hm.DiscreteState(0, integer=True)
    transitions = (hm.TimeEvent("sample", lambda self, s: 0.125 * s.k, lambda self, s: {"y": s.u, "k": s.k + 1}),)


@pytest.mark.parametrize(
    ("fmi", "kind", "use", "sampled"),
    [
        ("2.0", "CoSimulation", {}, 0.0),
        ("2.0", "ModelExchange", {}, 1.0),
        ("3.0", "CoSimulation", {}, 0.0),
        ("3.0", "CoSimulation", {"use_event_mode": True, "early_return_allowed": True}, 1.0),
        ("3.0", "ModelExchange", {}, 1.0),
    ],
)
def test_an_input_that_steps_when_it_is_sampled(fmi, kind, use, sampled, exported):
    """The input steps at the fourth sample, 3/8 s; only without event mode the sample is taken before it can be set."""
    step = np.array([(0.0, 0.0), (0.375, 0.0), (0.375, 1.0), (1.0, 1.0)], dtype=[("time", float), ("u", float)])
    path = str(exported(Sampler(), fmi=fmi))
    result = fmpy.simulate_fmu(path, stop_time=0.45, input=step, fmi_type=kind, output_interval=0.025, **use)
    assert result["y"][-1] == sampled
    arc = hm.simulate(Sampler(), 0.45, inputs={"u": hm.Signal(lambda t: 1.0 * (t >= 0.375), [0.375])})
    assert arc.end.y == 1.0


def test_start_values_and_parameters_can_be_set(exported):
    path = str(exported(BouncingBall(), "ball"))
    result = fmpy.simulate_fmu(path, stop_time=0.4, start_values={"h": 2.0, "g": 5.0}, output_interval=0.4)
    assert result["h"][-1] == pytest.approx(2.0 - 0.5 * 5.0 * 0.4**2, abs=1e-12)


def test_computed_start_values_follow_what_is_set(exported):
    """The first broadcast is the agent's start state, whatever that is set to."""
    case = cases()["agent2_static"]
    path = str(exported(case.automaton, "agent2_static"))
    result = fmpy.simulate_fmu(path, stop_time=0.0001, start_values={"x": 7.0}, output=["x", "broadcast"])
    assert result["broadcast"][0] == 7.0
