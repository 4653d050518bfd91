"""libcosim, the engine of the Open Simulation Platform, through the libcosimpy wheel: FMI 2.0, fixed steps."""

import numpy as np
import pytest
from catalogue import cases
from executions import reference
from small_automata import Blinking, Listening

import hybrid_model as hm
from hybrid_model.models import BouncingBall

reason = "libcosimpy is not installed: pip install -e .[interop]"
execution = pytest.importorskip("libcosimpy.CosimExecution", reason=reason)
observers = pytest.importorskip("libcosimpy.CosimObserver", reason=reason)
slaves = pytest.importorskip("libcosimpy.CosimSlave", reason=reason)
logs = pytest.importorskip("libcosimpy.CosimLogging", reason=reason)
enums = pytest.importorskip("libcosimpy.CosimEnums", reason=reason)

REAL, INTEGER = 0, 1
STEP = 0.01
# Outside of the instants at which it jumps, whose side is decided by rounding.
STATE_TOLERANCE = 1e-8


@pytest.fixture(autouse=True)
def quiet():
    logs.log_output_level(logs.CosimLogLevel.FATAL)


class Simulation:
    """A libcosim execution with slaves by name."""

    def __init__(self, fmus, step=STEP):
        self.execution = execution.CosimExecution.from_step_size(round(step * 1e9))
        self.observer = observers.CosimObserver.create_last_value()
        self.execution.add_observer(self.observer)
        self.slaves, self.variables = {}, {}
        for name, path in fmus.items():
            local = slaves.CosimLocalSlave(str(path), name)
            self.slaves[name] = self.execution.add_local_slave(local)
            found = self.execution.slave_variables(self.slaves[name])
            self.variables[name] = {v.name.decode(): (v.reference, int(v.type)) for v in found}

    def start(self, name, variable, value):
        assert self.execution.real_initial_value(self.slaves[name], self.variables[name][variable][0], value)

    def connect(self, source, output, target, port):
        out, into = self.variables[source][output][0], self.variables[target][port][0]
        # Its answer is the status of C: 0 is success.
        assert not self.execution.connect_real_variables(self.slaves[source], out, self.slaves[target], into)

    def get(self, name, variable):
        reference, kind = self.variables[name][variable]
        last = self.observer.last_integer_values if kind == INTEGER else self.observer.last_real_values
        return last(self.slaves[name], [reference])[0]


def test_ball_is_the_python_run(exported):
    simulation = Simulation({"ball": exported(BouncingBall(), "ball", "2.0")})
    simulation.start("ball", "h", 1.2)
    arc = hm.simulate(BouncingBall(h=1.2), 2.0)
    for k in range(1, 201):
        assert simulation.execution.step()
        for name in ("h", "v"):
            assert abs(simulation.get("ball", name) - arc.at(name, k * STEP)) < STATE_TOLERANCE
    assert len(arc.jumps) >= 3


@pytest.mark.parametrize("name", ["thermostat", "sampled_lti_loop", "boost_converter"])
def test_models_without_inputs_are_the_python_run(name, exported):
    case = cases()[name]
    step = case.t_end / 50
    simulation = Simulation({"block": exported(case.automaton, name, "2.0")}, step)
    arc = reference(name)
    outputs = [v.name for v in case.automaton.variables if v.output and v.shape == ()]
    assert outputs
    jumps = np.array([jump.t for jump in arc.jumps])
    taken = round(step * 1e9) * 1e-9  # libcosim counts nanoseconds
    for k in range(1, 50):
        assert simulation.execution.step()
        t = k * taken
        if np.min(np.abs(jumps - t)) > 1e-9 * max(t, 1.0):
            for output in outputs:
                assert abs(simulation.get("block", output) - arc.at(output, t)) < STATE_TOLERANCE, (output, t)


def test_signals_travel_between_our_fmus_one_step_late(exported):
    """libcosim hands outputs over at the end of a step; the receiver's state then follows in closed form."""
    simulation = Simulation(
        {"sender": exported(Blinking(), "blinking", "2.0"), "receiver": exported(Listening(), "listening", "2.0")}
    )
    simulation.connect("sender", "sent", "receiver", "heard")
    x, heard = 0.0, 1.0
    for k in range(1, 101):
        assert simulation.execution.step()
        x = heard + (x - heard) * np.exp(-STEP)
        heard = 1.0 if (k // 25) % 2 == 0 else -1.0
        assert simulation.get("sender", "sent") == heard
        assert simulation.get("receiver", "x") == pytest.approx(x, abs=STATE_TOLERANCE)


def test_an_fmu_that_ends_its_run_stops_libcosim(exported):
    """Zeno: fmi2Discard and fmi2Terminated; libcosim reports a failed step, and the process lives on."""
    simulation = Simulation({"ball": exported(BouncingBall(), "ball", "2.0")}, 0.5)
    results = []
    for _ in range(8):
        results.append(bool(simulation.execution.step()))
        if not results[-1]:
            break
    # The impacts accumulate at 2.5587 s: in the sixth step.
    assert results == [True] * 5 + [False]


def test_it_makes_a_step_whenever_it_is_asked_to_run_until_a_time(exported):
    """So ask for times that rise; and its time series lacks the last sample."""
    simulation = Simulation({"ball": exported(BouncingBall(), "ball", "2.0")}, 0.1)
    reference, _ = simulation.variables["ball"]["h"]
    series = observers.CosimObserver.create_time_series()
    simulation.execution.add_observer(series)
    series.start_time_series(simulation.slaves["ball"], reference, enums.CosimVariableType.REAL)
    reached = []
    for target in (200_000_000, 200_000_000, 100_000_000):
        assert simulation.execution.simulate_until(target)
        reached.append(simulation.execution.status().current_time)
    assert reached == [200_000_000, 300_000_000, 400_000_000]
    times, _, values = series.time_series_real_samples(simulation.slaves["ball"], reference, 0, 50)
    assert times == [0, 100_000_000, 200_000_000, 300_000_000]
    expected = [1.0 - 9.81 * (t * 1e-9) ** 2 / 2 for t in times]
    assert values == pytest.approx(expected, abs=STATE_TOLERANCE)
    assert simulation.get("ball", "h") == pytest.approx(1.0 - 9.81 * 0.4**2 / 2, abs=STATE_TOLERANCE)
