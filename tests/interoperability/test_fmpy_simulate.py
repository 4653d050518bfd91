"""`fmpy.simulate_fmu` as it is: both versions, both kinds, CVode and Euler, with event mode and without.

The reference is the Python run, for the ball also its closed form. fmpy writes two rows at the time of an event.
"""

import itertools

import fmpy
import numpy as np
import pytest
from catalogue import cases
from executions import reference, shown, starts, step_inputs, values_of

import hybrid_model as hm
from hybrid_model.declare.variables import Kind, element_names
from hybrid_model.models import BouncingBall

WAYS = {
    "2.0 ME, CVode": ("2.0", "ModelExchange", {"relative_tolerance": 1e-12}),
    "3.0 ME, CVode": ("3.0", "ModelExchange", {"relative_tolerance": 1e-12}),
    "2.0 CS": ("2.0", "CoSimulation", {}),
    "3.0 CS": ("3.0", "CoSimulation", {}),
    "3.0 CS, event mode": ("3.0", "CoSimulation", {"use_event_mode": True}),
    "3.0 CS, early return": ("3.0", "CoSimulation", {"use_event_mode": True, "early_return_allowed": True}),
}
# The project's limits, also where fmpy integrates by CVode with a relative tolerance of 1e-12 in each step.
STATES = 1e-8
TIMES = {"CoSimulation": 1e-9, "ModelExchange": 1e-7}
# A kind of event each: impact, mode, samples, continuous inputs, discrete inputs with breakpoints of the flow, network.
MODELS = [
    "bouncing_ball",
    "thermostat",
    "sampled_lti_loop",
    "ball_on_moving_table",
    "agent2_dynamic",
    pytest.param("paper_dynamic", marks=pytest.mark.long),
]
INTERVALS = 40


def signals(case):
    """The steps of a case as fmpy reads them: two rows at each step of an input that jumps along a flow."""
    inputs = case.automaton.of_kind(Kind.INPUT)
    names = [name for variable in inputs for name in element_names(variable)]
    if not names:
        return None
    given, start = step_inputs(case), starts(case.automaton)

    def values(variable, t):
        if variable.name in given:
            return np.ravel(given[variable.name].value(t))
        return [start[name] for name in element_names(variable)]

    changes = {t for steps in case.steps.values() for t, _ in steps}
    times = sorted([0.0, case.t_end, *changes, *changes])
    rows, before = [], 0.0
    for t in times:
        late = t == before or t == 0.0
        at = t if late else np.nextafter(t, 0.0)
        rows.append((t, *(float(x) for v in inputs for x in values(v, at))))
        before = t
    return np.array(rows, dtype=[("time", float), *((name, float) for name in names)])


def simulate(path, case, outputs, kind, options):
    return fmpy.simulate_fmu(
        str(path),
        stop_time=case.t_end,
        output_interval=case.t_end / INTERVALS,
        fmi_type=kind,
        output=outputs,
        input=signals(case),
        **options,
    )


def outputs_of(path, case):
    described = fmpy.read_model_description(str(path)).modelVariables
    outputs = {v.name for v in described if v.causality == "output" and v.type != "Clock"}
    return [name for name in shown(case.automaton) if name in outputs]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", MODELS)
def test_fmpy_gives_the_python_run(name, way, exported):
    fmi, kind, options = WAYS[way]
    case = cases()[name]
    path = exported(case.automaton, name, fmi)
    outputs = outputs_of(path, case)
    result = simulate(path, case, outputs, kind, options)
    arc = reference(name)
    breaks = [jump.t for jump in arc.jumps] + [t for steps in case.steps.values() for t, _ in steps]
    # At an instant with a jump there is a row for each side; which row is which is fmpy's affair.
    kept = [row for row in result if not breaks or np.min(np.abs(np.array(breaks) - row["time"])) > 2 * TIMES[kind]]
    assert len(kept) >= INTERVALS - len(breaks)
    times = np.array([row["time"] for row in kept])
    for output in outputs:
        found = np.array([row[output] for row in kept])
        expected = values_of(arc, output, times)
        np.testing.assert_allclose(found, expected, rtol=0, atol=STATES, err_msg=output)


@pytest.mark.parametrize("way", ["2.0 ME, CVode", "3.0 ME, CVode", "3.0 CS, early return"])
@pytest.mark.parametrize("name", MODELS)
def test_fmpy_stops_at_each_event(name, way, exported):
    """The instants with two rows are those of the jumps, of the breakpoints in ME, and of the inputs' steps."""
    fmi, kind, options = WAYS[way]
    case = cases()[name]
    path = exported(case.automaton, name, fmi)
    result = simulate(path, case, outputs_of(path, case), kind, options)
    found = np.unique([a for a, b in itertools.pairwise(result["time"]) if a == b])
    for jump in reference(name).jumps:
        if not case.automaton.jumps[jump.index].internal and 0.0 < jump.t < case.t_end:
            assert np.min(np.abs(found - jump.t)) < TIMES[kind], jump


@pytest.mark.parametrize("way", WAYS)
def test_ball_in_closed_form(way, exported):
    """Flights between impacts at t1 = sqrt(2 h/g), then 2 e t1, 2 e^2 t1, ... long."""
    fmi, kind, options = WAYS[way]
    result = fmpy.simulate_fmu(
        str(exported(BouncingBall(), "ball", fmi)),
        stop_time=2.0,
        output_interval=0.0625,
        fmi_type=kind,
        output=["h"],
        **options,
    )
    g, e, h0 = 9.81, 0.7, 1.0
    first = np.sqrt(2 * h0 / g)
    impacts = first + np.concatenate([[0.0], np.cumsum(2 * first * e ** np.arange(1, 8))])
    for t, h in zip(result["time"], result["h"], strict=True):
        k = np.searchsorted(impacts, t)
        # h is continuous, so at an impact both flights give it.
        flown = t - impacts[k - 1]
        expected = h0 - g * t**2 / 2 if k == 0 else e**k * g * first * flown - g * flown**2 / 2
        assert h == pytest.approx(expected, abs=STATES)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_euler_is_wrong_by_the_order_of_its_step(fmi, exported):
    """fmpy's Euler looks for events at the ends of its steps, which are the output interval."""
    path = str(exported(BouncingBall(), "ball", fmi))
    g, e, first = 9.81, 0.7, np.sqrt(2 / 9.81)
    for interval in (2e-3, 1e-3, 5e-4):
        result = fmpy.simulate_fmu(
            path,
            stop_time=0.8,
            solver="Euler",
            step_size=interval,
            output_interval=interval,
            fmi_type="ModelExchange",
            output=["h"],
        )
        t, flown = result["time"], result["time"] - first
        expected = np.where(flown < 0, 1 - g * t**2 / 2, e * g * first * flown - g * flown**2 / 2)
        # Falling: g t step / 2 <= 2.2 step. The event is up to a step late: (1+e) 4.43 m/s = 7.5 step, and what is
        # wrong in the velocity then grows for 0.35 s: (1+e) g 0.35 step = 5.8 step.
        assert np.abs(result["h"] - expected).max() < 16 * interval


class Cooling(hm.HybridAutomaton):
    """A body that takes the temperature of its surroundings."""

    T = hm.State(350.0, unit="K", output=True)
    surroundings = hm.Parameter(293.15, unit="K")

    def flow_map(self, s):
        return {"T": 0.1 * (s.surroundings - s.T)}


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_temperatures_can_be_given_in_degrees_celsius(fmi, kind, exported):
    """fmpy takes a value in a unit for display as a difference where the variable has a declared type."""
    result = fmpy.simulate_fmu(
        str(exported(Cooling(), "cooling", fmi)),
        stop_time=1.0,
        fmi_type=kind,
        start_values={"T": (25.0, "degC"), "surroundings": (20.0, "degC")},
        output=["T"],
        relative_tolerance=1e-10,
    )
    assert result["T"][0] == 298.15
    # CVode's error of one step is 1e-10 of 300 K, and it makes some hundred.
    assert result["T"][-1] == pytest.approx(293.15 + 5.0 * np.exp(-0.1), abs=1e-5)


ZENO = 2.5586
"""Where the ball's impacts accumulate, to 1e-4 s: (1 + e)/(1 - e) sqrt(2 h/g)."""


@pytest.mark.parametrize(
    ("fmi", "kind", "options", "last"),
    [
        ("2.0", "ModelExchange", {}, ZENO),
        ("3.0", "ModelExchange", {}, ZENO),
        ("2.0", "CoSimulation", {}, ZENO),
        ("3.0", "CoSimulation", {"use_event_mode": True, "early_return_allowed": True}, ZENO),
        # The end of the step that it asked for, with the values of the end of the run.
        ("3.0", "CoSimulation", {}, 3.0),
    ],
)
def test_where_a_run_ends_by_itself_the_result_is_shorter(fmi, kind, options, last, exported):
    """So compare the last time with the stop time."""
    path = str(exported(BouncingBall(), "ball", fmi))
    result = fmpy.simulate_fmu(
        path, stop_time=4.0, output_interval=0.5, fmi_type=kind, output=["h"], relative_tolerance=1e-10, **options
    )
    assert result["time"][-1] == pytest.approx(last, abs=1e-4)
    assert result["h"][-1] == pytest.approx(0.0, abs=1e-9)


def test_names_that_it_does_not_record_are_left_out(exported):
    """Clocks, and names that there are not."""
    path = str(exported(BouncingBall(), "ball"))
    result = fmpy.simulate_fmu(path, stop_time=0.1, output=["h", "impact", "hight"])
    assert result.dtype.names == ("time", "h")


class Follower(hm.HybridAutomaton):
    """Adds up its input, and shows it."""

    u = hm.Input(0.0)
    x = hm.State(0.0, output=True)
    y = hm.Output()

    def flow_map(self, s):
        return {"x": s.u}

    def outputs(self, s):
        return {"y": s.u}


@pytest.mark.parametrize(("kind", "shown"), [("CoSimulation", [0.0]), ("ModelExchange", [0.0, 1.0])])
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_jump_in_a_table_of_inputs_is_shown_one_point_later_in_co_simulation(fmi, kind, shown, exported):
    """What follows from the input is right: the state begins to rise at the jump."""
    table = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 1.0), (1.0, 1.0)], dtype=[("time", float), ("u", float)])
    result = fmpy.simulate_fmu(
        str(exported(Follower(), "follower", fmi)),
        stop_time=1.0,
        output_interval=0.25,
        fmi_type=kind,
        input=table,
        output=["y", "x"],
        relative_tolerance=1e-10,
    )
    assert result["y"][result["time"] == 0.5].tolist() == shown
    assert result["y"][result["time"] == 0.75] == 1.0
    np.testing.assert_allclose(result["x"], np.maximum(result["time"] - 0.5, 0.0), atol=1e-9)
