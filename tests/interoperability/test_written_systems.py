"""Systems that we write as SSP or for libcosim run there, and give what our fixed-step master gives."""

import ctypes
import sys
from pathlib import Path

import fmpy.ssp.simulation
import pytest

import hybrid_model as hm
from cosim.masters import run_fixed_step
from cosim.systems.assembly import assemble
from cosim.systems.definition import FMU, Component, Experiment, SystemDefinition
from cosim.systems.ssp_writing import write_osp, write_ssp
from fmu.export import export_fmu

STEP, STOP = 0.1, 2.0


class Oscillates(hm.HybridAutomaton):
    """One half of an oscillator."""

    u = hm.Input(0.0)
    x = hm.State(0.0, output=True)
    rate = hm.Parameter(1.0)

    def flow_map(self, s):
        return {"x": s.rate * s.u}


@pytest.fixture(scope="module")
def system(tmp_path_factory):
    # Ecos and fmpy take no start values from an SSP: those of the FMUs count.
    folder, halves = tmp_path_factory.mktemp("fmu"), {"p": Oscillates(x=1.0, rate=2.0), "q": Oscillates(rate=-0.5)}
    components = [
        Component(name, FMU, str(export_fmu(half, folder / f"{name}.fmu", fmi="2.0", kinds=("cs",))))
        for name, half in halves.items()
    ]
    definition = SystemDefinition(
        "oscillator", components, {"p.u": "q.x", "q.u": "p.x"}, None, Experiment(stop_time=STOP)
    )
    made = assemble(definition)
    return definition, made, run_fixed_step(made, STOP, STEP).final


def test_fmpy_runs_our_ssp(system, tmp_path):
    """Its rows have the time before each step."""
    definition, made, expected = system
    path = write_ssp(definition, made, tmp_path / "system.ssp")
    # It adds up its time, so it is asked for half a step more than there are steps.
    rows = fmpy.ssp.simulation.simulate_ssp(str(path), stop_time=STOP + 0.5 * STEP, step_size=STEP)
    assert [rows["p.x"][-1], rows["q.x"][-1]] == pytest.approx([expected["p.x"], expected["q.x"]], rel=1e-9)


def test_ecos_runs_our_ssp(system, tmp_path):
    for library in Path(sys.prefix, "lib").glob("libtbb.so.*"):
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    ecospy = pytest.importorskip("ecospy", reason="ecospy is not installed: pip install -e .[interop]")
    definition, made, expected = system
    path = write_ssp(definition, made, tmp_path / "system.ssp")
    simulation = ecospy.EcosSimulation(step_size=STEP, ssp_path=str(path))
    simulation.init()
    for _ in range(round(STOP / STEP)):
        simulation.step()
    found = [simulation.get_real("p::x"), simulation.get_real("q::x")]
    simulation.terminate()
    assert found == pytest.approx([expected["p.x"], expected["q.x"]], rel=1e-9)


def test_libcosim_runs_our_folder(system, tmp_path):
    reason = "libcosimpy is not installed: pip install -e .[interop]"
    execution = pytest.importorskip("libcosimpy.CosimExecution", reason=reason)
    observers = pytest.importorskip("libcosimpy.CosimObserver", reason=reason)
    logs = pytest.importorskip("libcosimpy.CosimLogging", reason=reason)
    logs.log_output_level(logs.CosimLogLevel.FATAL)
    definition, made, expected = system
    folder = write_osp(definition, made, tmp_path / "osp", STEP)
    run = execution.CosimExecution.from_osp_config_file(osp_path=str(folder))
    observer = observers.CosimObserver.create_last_value()
    run.add_observer(observer)
    run.simulate_until(target_time=round(STOP * 1e9))
    references = {v.name: v.valueReference for v in fmpy.read_model_description(str(folder / "p.fmu")).modelVariables}
    places = [run.slave_index_from_instance_name(name) for name in "pq"]
    found = [observer.last_real_values(place, [references["x"]])[0] for place in places]
    assert found == pytest.approx([expected["p.x"], expected["q.x"]], rel=1e-9)
