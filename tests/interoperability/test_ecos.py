"""Ecos, a co-simulation engine on fmi4c, through the ecospy wheel: FMI 2.0 and 3.0, fixed steps, no event mode.

The FMUs are exported without clocks, as docs/interoperability.md tells users of Ecos to do.
"""

import ctypes
import sys
from pathlib import Path

import numpy as np
import pytest
from catalogue import cases
from executions import reference, shown, values_of

import hybrid_model as hm
from cosim.consensus import fmu_system
from cosim.masters.fixed_step import run_fixed_step
from hybrid_model.consensus.laws.closed_loop import broadcast_wires, scenario_agents
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.models import BouncingBall

# The wheel does not say that it needs oneTBB: the package tbb puts it beside the interpreter, where nobody looks.
for library in Path(sys.prefix, "lib").glob("libtbb.so.*"):
    ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    break
try:
    ecospy = pytest.importorskip("ecospy", reason="ecospy is not installed: pip install -e .[interop]")
except OSError as error:  # pragma: no cover
    pytest.skip(f"ecospy does not load: {error}", allow_module_level=True)

STATE_TOLERANCE = 1e-8


class Simulation:
    """An Ecos simulation with FMUs by name."""

    def __init__(self, fmus, step, wires=None, parameters=None, hints=None):
        ecospy.EcosLib.set_log_level("off")
        self.structure = ecospy.EcosSimulationStructure()
        for name, path in fmus.items():
            self.structure.add_model(name, str(path), (hints or {}).get(name))
        for port, source in (wires or {}).items():
            self.structure.make_real_connection(source.replace(".", "::", 1), port.replace(".", "::", 1))
        self.structure.add_parameter_set("given", parameters or {})
        self.engine = ecospy.EcosSimulation(step, structure=self.structure)
        self.start()

    def start(self):
        assert self.engine.init(parameter_set="given")

    def get(self, name, integer=False):
        return (self.engine.get_integer if integer else self.engine.get_real)(name.replace(".", "::", 1))

    def close(self):
        self.engine.terminate()
        self.engine.free()


@pytest.fixture
def simulate():
    made = []

    def make(*args, **options):
        made.append(Simulation(*args, **options))
        return made[-1]

    yield make
    for simulation in made:
        simulation.close()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("name", ["bouncing_ball", "thermostat", "newtons_cradle", "boost_converter"])
def test_models_without_inputs_are_the_python_run(name, fmi, exported, simulate):
    case = cases()[name]
    step = case.t_end / 50
    simulation = simulate({"block": exported(case.automaton, name, fmi, clocks=False)}, step)
    arc = reference(name)
    jumps = np.array([jump.t for jump in arc.jumps])
    integers = {v.name for v in case.automaton.variables if v.integer}
    for _ in range(50):
        t = simulation.engine.step()
        if np.min(np.abs(jumps - t)) < 1e-9 * max(t, 1.0):
            continue
        for output in shown(case.automaton):
            found = simulation.get(f"block.{output}", output.partition("[")[0] in integers)
            assert abs(found - values_of(arc, output, t)) < STATE_TOLERANCE, (output, t)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_start_values_and_a_second_run(fmi, exported, simulate):
    given = {"ball::h": 1.2, "ball::e": 0.5, "ball::g": 5.0}
    simulation = simulate({"ball": exported(BouncingBall(), "ball", fmi, clocks=False)}, 0.01, parameters=given)
    arc = hm.simulate(BouncingBall(h=1.2, e=0.5, g=5.0), 1.5)
    for _ in range(2):
        assert [simulation.get(f"ball.{name}") for name in ("h", "v", "e", "g")] == [1.2, 0.0, 0.5, 5.0]
        for _ in range(149):
            t = simulation.engine.step()
            assert abs(simulation.get("ball.h") - arc.at("h", t)) < STATE_TOLERANCE
        simulation.engine.reset()
        simulation.start()
    assert len(arc.jumps) >= 2


def test_four_agents_are_the_run_of_our_fixed_step_master(exported, simulate):
    """Bit for bit: the step is a power of two, so that Ecos, which adds steps up, has the same times."""
    scenario = load_scenario("paper-a")
    fmus = {name: exported(agent, name, clocks=False) for name, agent in scenario_agents(scenario).items()}
    states = [f"{name}.x" for name in fmus]
    result = run_fixed_step(fmu_system(scenario, fmus), 10.0, 1 / 64, record=states)
    wires = {f"{port}[{k}]": one for port, sent in broadcast_wires(scenario).items() for k, one in enumerate(sent, 1)}
    simulation = simulate(fmus, 1 / 64, wires)
    for k in range(1, 641):
        assert simulation.engine.step() == result.times[k]
        assert [simulation.get(name) for name in states] == [result.signals[name][k] for name in states]


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_ecos_goes_on_where_an_fmu_has_ended_its_run(fmi, exported, simulate):
    """Zeno: Ecos does not look at the answer of doStep; the FMU stays where its run ended, and so does its time."""
    simulation = simulate({"ball": exported(BouncingBall(), "ball", fmi, clocks=False)}, 0.5)
    arc = hm.simulate(BouncingBall(), 4.0)
    assert arc.stop is hm.Stop.ZENO
    times = [simulation.engine.step() for _ in range(8)]
    assert times == [0.5 * k for k in range(1, 9)]
    assert simulation.get("ball.time") == pytest.approx(arc.t[-1], abs=1e-7)
    assert simulation.get("ball.h") == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_step_size_hint_lets_an_fmu_run_ahead(fmi, exported, simulate):
    """It gives the FMU steps of that length, the first one at once: leave it out."""
    ball = exported(BouncingBall(), "ball", fmi, clocks=False)
    simulation = simulate({"one": ball, "ahead": ball}, 0.1, hints={"ahead": 0.3})
    times = []
    for _ in range(4):
        simulation.engine.step()
        times.append([simulation.get(f"{name}.time") for name in ("one", "ahead")])
    np.testing.assert_allclose(times, [[0.1, 0.3], [0.2, 0.3], [0.3, 0.3], [0.4, 0.6]], atol=1e-12)
