"""Systems that we write as SSP or for libcosim run there, and give what our fixed-step master gives."""

import ctypes
import re
import sys
import zipfile
from pathlib import Path

import fmpy.ssp.simulation
import pytest

import hybrid_model as hm
from cosim.cli.system_fmus import with_fmus
from cosim.masters import run_fixed_step
from cosim.systems.assembly import assemble
from cosim.systems.definition import AUTOMATON, Component, Experiment, SystemDefinition
from cosim.systems.ssp_writing import OSP_FILE, write_osp, write_ssp

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
    """An oscillator of two automata, whose FMUs have the values that the system gives them."""
    source = f"{__file__}:Oscillates"
    components = [
        Component("p", AUTOMATON, source, {"x": 1.0}, {"rate": 2.0}),
        Component("q", AUTOMATON, source, {"rate": -0.5}),
    ]
    automata = SystemDefinition(
        "oscillator", components, {"p.u": "q.x", "q.u": "p.x"}, None, Experiment(stop_time=STOP)
    )
    in_process = assemble(automata)
    definition = with_fmus(automata, in_process, tmp_path_factory.mktemp("fmu"), "2.0")
    made, expected = assemble(definition), run_fixed_step(in_process, STOP, STEP).final
    assert run_fixed_step(made, STOP, STEP).final == pytest.approx(expected, rel=1e-9)
    return definition, made, expected


@pytest.fixture(params=["bindings", "no bindings"])
def written(request, system, tmp_path):
    """Write the system as SSP, with and without the start values that it binds to its components."""
    path = write_ssp(*system[:2], tmp_path / "system.ssp")
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    bound = b"<ssd:ParameterBindings>.*?</ssd:ParameterBindings>"
    stripped, count = re.subn(bound, b"", members["SystemStructure.ssd"], flags=re.DOTALL)
    assert count == 2
    if request.param == "no bindings":
        with zipfile.ZipFile(path, "w") as archive:
            for name, content in (members | {"SystemStructure.ssd": stripped}).items():
                archive.writestr(name, content)
    return path, system[2]


def test_fmpy_runs_our_ssp(written):
    """It applies no bindings. Its rows have the time before each step."""
    path, expected = written
    # It adds up its time, so it is asked for half a step more than there are steps.
    rows = fmpy.ssp.simulation.simulate_ssp(str(path), stop_time=STOP + 0.5 * STEP, step_size=STEP)
    assert [rows["p.x"][-1], rows["q.x"][-1]] == pytest.approx([expected["p.x"], expected["q.x"]], rel=1e-9)


def test_ecos_runs_our_ssp(written):
    for library in Path(sys.prefix, "lib").glob("libtbb.so.*"):
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    ecospy = pytest.importorskip("ecospy", reason="ecospy is not installed: pip install -e .[interop]")
    path, expected = written
    simulation = ecospy.EcosSimulation(step_size=STEP, ssp_path=str(path))
    simulation.init()
    for _ in range(round(STOP / STEP)):
        simulation.step()
    found = [simulation.get_real("p::x"), simulation.get_real("q::x")]
    simulation.terminate()
    assert found == pytest.approx([expected["p.x"], expected["q.x"]], rel=1e-9)


@pytest.mark.parametrize("initial", [True, False])
def test_libcosim_runs_our_folder(initial, system, tmp_path):
    """With the initial values of its configuration, and without them."""
    reason = "libcosimpy is not installed: pip install -e .[interop]"
    execution = pytest.importorskip("libcosimpy.CosimExecution", reason=reason)
    observers = pytest.importorskip("libcosimpy.CosimObserver", reason=reason)
    logs = pytest.importorskip("libcosimpy.CosimLogging", reason=reason)
    logs.log_output_level(logs.CosimLogLevel.FATAL)
    definition, made, expected = system
    folder = write_osp(definition, made, tmp_path / "osp", STEP)
    if not initial:
        file, told = folder / OSP_FILE, "<InitialValues>.*?</InitialValues>"
        content, count = re.subn(told, "", file.read_text(), flags=re.DOTALL)
        assert count == 2
        file.write_text(content)
    run = execution.CosimExecution.from_osp_config_file(osp_path=str(folder))
    observer = observers.CosimObserver.create_last_value()
    run.add_observer(observer)
    run.simulate_until(target_time=round(STOP * 1e9))
    references = {v.name: v.valueReference for v in fmpy.read_model_description(str(folder / "p.fmu")).modelVariables}
    places = [run.slave_index_from_instance_name(name) for name in "pq"]
    found = [observer.last_real_values(place, [references["x"]])[0] for place in places]
    assert found == pytest.approx([expected["p.x"], expected["q.x"]], rel=1e-9)
