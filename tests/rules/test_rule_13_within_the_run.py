"""Rule 13: maps and inputs are evaluated within the run's own time; a trial stage that fails is no failure."""

import math

import fmpy
import numpy as np
import pytest
from catalogue import cases
from rescaled import InOtherTime
from scipy.interpolate import interp1d

import hybrid_model as hm
from hybrid_model.reference import progress

QUICK = ["bouncing_ball", "resting_ball", "relay_hysteresis", "two_tank", "sampled_lti_loop", "thermostat"]


class Spy(InOtherTime):
    """An automaton that notes the times at which it is asked."""

    def __init__(self, automaton):
        super().__init__(automaton, 1.0)
        self.asked = set()

    def inner(self, s):
        self.asked.add(float(s.t))
        return super().inner(s)


@pytest.mark.parametrize("name", QUICK)
@pytest.mark.parametrize("t_start", [0.0, 1e3])
def test_maps_are_evaluated_between_start_and_end_only(name, t_start):
    case = cases()[name]
    spy = Spy(case.automaton)
    t_end = t_start + case.t_end
    hm.simulate(spy, t_end, t_start=t_start)
    assert min(spy.asked) == t_start
    assert max(spy.asked) <= t_end


class Lag(hm.HybridAutomaton):
    """y' = u - y with a jump on state that is never due."""

    y = hm.State(0.0, output=True)
    u = hm.Input(0.0)

    def flow_map(self, s):
        return {"y": s.u - s.y}

    def jump_set(self, s):
        return s.y - 100.0

    def jump_map(self, s):
        return {"y": 0.0}


class PatientLag(Lag):
    """The same under flow priority, in a flow set that is never left."""

    priority = hm.Priority.FLOW

    def flow_set(self, s):
        return 100.0 - s.y


def only_in_the_run(t):
    assert 0.0 <= t <= 1.0
    return 1.0


@pytest.mark.parametrize("lag", [Lag, PatientLag])
@pytest.mark.parametrize(
    "source",
    [
        pytest.param(interp1d([0.0, 1.0], [1.0, 1.0]), id="interp1d"),
        pytest.param(lambda t: np.interp(t, [0.0, 1.0], [1.0, 1.0], left=np.nan, right=np.nan), id="nan outside"),
        pytest.param(only_in_the_run, id="assertion"),
    ],
)
def test_an_input_that_is_known_during_the_run_only_is_enough(lag, source):
    arc = hm.simulate(lag(), 1.0, inputs={"u": source})
    assert arc.end.y == pytest.approx(1.0 - math.exp(-1.0), abs=1e-14)


class Fading(hm.HybridAutomaton):
    """y' = sqrt(1 - t) is not defined after t = 1."""

    y = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"y": np.sqrt(1.0 - s.t)}

    def jump_set(self, s):
        return s.y - 100.0

    def jump_map(self, s):
        return {"y": 0.0}


def test_a_flow_map_that_is_known_up_to_the_end_only_is_enough():
    assert hm.simulate(Fading(), 1.0).end.y == pytest.approx(2.0 / 3.0, abs=1e-12)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("points", [1, 10])
def test_an_fmu_needs_its_flow_map_up_to_the_end_only(fmi, points, exported):
    path = str(exported(Fading(), "fading", fmi=fmi))
    found = fmpy.simulate_fmu(path, stop_time=1.0, step_size=1.0 / points, output_interval=1.0 / points)
    assert found["time"][-1] == 1.0
    assert found["y"][-1] == pytest.approx(2.0 / 3.0, abs=1e-12)


class Emptying(hm.HybridAutomaton):
    """h' = -sqrt(h) - 1/2 is defined down to the guard only; each time it is empty it is filled anew.

    From 1 to 0 it takes 2 (1 - ln(3) / 2) = 2 - ln 3.
    """

    h = hm.State(1.0, output=True)
    n = hm.DiscreteState(0, integer=True, output=True)
    root = staticmethod(np.sqrt)

    def flow_map(self, s):
        return {"h": -self.root(s.h) - 0.5}

    def flow_set(self, s):
        return s.h

    def jump_set(self, s):
        return -s.h

    def jump_map(self, s):
        return {"h": 1.0, "n": s.n + 1}


class EmptyingByMath(Emptying):
    """The same with a root that raises an exception."""

    root = staticmethod(math.sqrt)


EMPTY = 2.0 - math.log(3.0)
LEFT = 0.356466736


@pytest.mark.parametrize("emptying", [Emptying, EmptyingByMath])
@pytest.mark.parametrize("method", ["DOP853", "RK45", "Radau", "BDF"])
def test_a_flow_map_that_is_defined_up_to_the_guard_only_reaches_it(emptying, method):
    exact = method in ("DOP853", "RK45")
    solver = hm.Solver(method=method) if exact else hm.Solver(method=method, rtol=1e-7, atol=1e-9)
    arc = hm.simulate(emptying(), 5.0 if exact else 1.0, solver=solver)
    assert arc.stop is hm.Stop.HORIZON
    times = EMPTY * np.arange(1, 6 if exact else 2)
    assert arc.event_times("jump") == pytest.approx(times, abs=1e-11 if exact else 1e-5)
    if exact:
        assert arc.end.h == pytest.approx(LEFT, abs=1e-9)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_fmu_reaches_a_guard_behind_which_its_flow_map_is_not_defined(fmi, exported):
    path = str(exported(Emptying(), "emptying", fmi=fmi))
    found = fmpy.simulate_fmu(path, stop_time=5.0, step_size=0.1, output_interval=0.1)
    assert found["n"][-1] == 5
    assert found["h"][-1] == pytest.approx(LEFT, abs=1e-9)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_importer_that_integrates_may_look_behind_the_guard(fmi, exported):
    """Rates of the last point inside stand for those that the flow map does not have outside its flow set."""
    path = str(exported(Emptying(), "emptying", fmi=fmi))
    found = fmpy.simulate_fmu(
        path, fmi_type="ModelExchange", stop_time=5.0, step_size=1e-3, output_interval=0.1, relative_tolerance=1e-9
    )
    assert found["n"][-1] == 5
    # CVode's own error over five flows.
    assert found["h"][-1] == pytest.approx(LEFT, abs=1e-5)


def test_where_no_guard_is_near_the_message_names_the_remedy():
    class Leak(hm.HybridAutomaton):
        h = hm.State(1.0)

        def flow_map(self, s):
            return {"h": -np.sqrt(s.h - 0.5) - 0.1}

        def flow_set(self, s):
            return s.h

        def jump_set(self, s):
            return -s.h

        def jump_map(self, s):
            return {"h": 1.0}

    with pytest.raises(
        hm.SimulationError,
        match=r"(derivative of h = nan|'h' = .* does not stay finite) .*trial steps .*np\.maximum\(h, 0\)",
    ):
        hm.simulate(Leak(), 10.0)


@pytest.mark.parametrize("window", [200, pytest.param(progress.PACE_STEPS, marks=pytest.mark.long)])
def test_a_flow_that_creeps_is_given_up_with_the_time_and_the_remedy(window, monkeypatch):
    """Two tanks joined by an orifice: past their equilibrium an implicit method makes steps of nothing.

    The pace is measured over a window of steps; a step takes milliseconds there.
    """
    monkeypatch.setattr(progress, "PACE_STEPS", window)

    class Tanks(hm.HybridAutomaton):
        a = hm.State(1.0)
        b = hm.State(0.0)

        def flow_map(self, s):
            flow = np.sign(s.a - s.b) * np.sqrt(abs(s.a - s.b))
            return {"a": -flow, "b": flow}

    with pytest.raises(hm.SimulationError, match=rf"creeps: its last {window} steps .* t = 1.*modes with a switch"):
        hm.simulate(Tanks(), 10.0, solver=hm.Solver(method="Radau"), engine="python")
