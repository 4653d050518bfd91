"""What masters cost: beside a loop over fmpy that makes the same calls, and beside libcosim's fixed steps.

``PYTHONPATH=tests python -m benchmarks.cosimulation_cost`` prints both tables: CPU time, the middle of paired rounds.
The loop and the fixed-step master step a ring of small FMUs, read one output of each and write it to the next. libcosim
runs the four agents of `paper-a-static` as FMI 2.0 with ever shorter steps; how far its events are from the composed
automaton's is seen in a run of its own, in which each step is looked at.
"""

import statistics
import tempfile
import time
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

import hybrid_model as hm
from cosim.consensus import CLOCK, fmu_system, in_process_system
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_error_controlled, run_event_exact, run_fixed_step
from cosim.system import System
from fmu.export import export_fmu
from hybrid_model.consensus.laws.closed_loop import scenario_agents
from hybrid_model.consensus.scenario.files import load_scenario

COUNT, STEP, ROUNDS = 10_000, 1e-3, 7
LIBCOSIM_STEPS = (1e-2, 1e-3, 1e-4)


class Decay(hm.HybridAutomaton):
    u = hm.Input(0.0)
    x = hm.State(1.0, output=True)

    def flow_map(self, s):
        return {"x": s.u - s.x}


def timed(run):
    began = time.process_time()
    found = run()
    return time.process_time() - began, found


def loop_over_fmpy(path, version, agents):
    description, folder = fmpy.read_model_description(str(path)), fmpy.extract(str(path))
    at = {v.name: [v.valueReference] for v in description.modelVariables}
    made = []
    for k in range(agents):
        kind, token = (FMU2Slave, "guid") if version == "2.0" else (FMU3Slave, "instantiationToken")
        named = {"modelIdentifier": description.coSimulation.modelIdentifier, "instanceName": f"a{k}"}
        fmu = kind(guid=getattr(description, token), unzipDirectory=folder, **named)
        fmu.instantiate()
        if version == "2.0":
            fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        made.append(fmu)
    get = [fmu.getReal if version == "2.0" else fmu.getFloat64 for fmu in made]
    put = [fmu.setReal if version == "2.0" else fmu.setFloat64 for fmu in made]
    rows = []

    def run():
        for k in range(COUNT):
            for fmu in made:
                fmu.doStep(k * STEP, STEP)
            values = [read(at["x"])[0] for read in get]
            rows.append(values)
            if agents > 1:
                for j, write in enumerate(put):
                    write(at["u"], [values[j - 1]])

    spent = timed(run)[0]
    for fmu in made:
        fmu.freeInstance()
    return spent


def fixed_step(path, agents):
    slaves = [FmuSlave(f"a{k}", path) for k in range(agents)]
    for slave in slaves:
        slave.load()
    wires = {f"a{k}.u": f"a{(k - 1) % agents}.x" for k in range(agents)} if agents > 1 else {}
    record = [f"a{k}.x" for k in range(agents)]
    return timed(lambda: run_fixed_step(System(slaves, wires), COUNT * STEP, STEP, record=record))[0]


def beside_fmpy(folder):
    for version in ("2.0", "3.0"):
        path = export_fmu(Decay(), folder / f"decay{version[0]}.fmu", fmi=version, kinds=("cs",))
        for agents in (1, 4):
            rounds = [(fixed_step(path, agents), loop_over_fmpy(path, version, agents)) for _ in range(ROUNDS)]
            calls = COUNT * agents * (2 if agents == 1 else 3)
            ours, theirs = (1e6 * statistics.median(times) / calls for times in zip(*rounds, strict=True))
            ratio = statistics.median(a / b for a, b in rounds)
            yield version, agents, f"{ours:.2f}", f"{theirs:.2f}", f"{ratio:.2f}"


def libcosim(scenario, fmus, step, *, watched):
    """CPU time, or the times at which each agent was seen to have sent."""
    from libcosimpy import CosimExecution, CosimLogging, CosimObserver, CosimSlave

    CosimLogging.log_output_level(CosimLogging.CosimLogLevel.FATAL)
    run = CosimExecution.CosimExecution.from_step_size(round(step * 1e9))
    places, variables = {}, {}
    for name, path in fmus.items():
        places[name] = run.add_local_slave(CosimSlave.CosimLocalSlave(str(path), name))
        variables[name] = {v.name.decode(): v.reference for v in run.slave_variables(places[name])}
    for wire in in_process_system(scenario).connections:
        source = places[wire.source], variables[wire.source][wire.output]
        assert not run.connect_real_variables(*source, places[wire.target], variables[wire.target][wire.input])
    if not watched:
        return timed(lambda: run.simulate_until(round(scenario.stop_time * 1e9)))[0]
    observer, seen, counts = (
        CosimObserver.CosimObserver.create_last_value(),
        {n: [] for n in fmus},
        dict.fromkeys(fmus, 0),
    )
    run.add_observer(observer)
    for k in range(round(scenario.stop_time / step)):
        run.step(1)
        for name, place in places.items():
            now = observer.last_integer_values(place, [variables[name]["events"]])[0]
            seen[name] += [(k + 1) * step] * (now - counts[name])
            counts[name] = now
    return seen


def furthest(seen, wanted):
    """The largest error of an event's time, where as many were seen as there are."""
    if any(len(seen[name]) != len(times) for name, times in wanted.items()):
        return "other numbers of events"
    return f"{max(float(np.max(np.abs(np.array(seen[n]) - t), initial=0.0)) for n, t in wanted.items()):.1e} s"


def beside_libcosim(folder):
    scenario = load_scenario("paper-a-static")
    fmus = {
        version: {
            name: export_fmu(agent, folder / f"{name}-{version[0]}.fmu", fmi=version, kinds=("cs",))
            for name, agent in scenario_agents(scenario).items()
        }
        for version in ("2.0", "3.0")
    }
    exact = run_event_exact(in_process_system(scenario), scenario.stop_time)
    wanted = {name: exact.tick_times(name, CLOCK) for name in fmus["2.0"]}
    for version, master in (("3.0", run_event_exact), ("2.0", run_error_controlled)):
        rounds = []
        for _ in range(ROUNDS):
            system = fmu_system(scenario, fmus[version])
            for slave in system.slaves.values():
                slave.load()
            rounds.append(timed(lambda s=system, m=master: m(s, scenario.stop_time)))
        found = rounds[0][1]
        seen = {n: found.tick_times(n, CLOCK) if found.ticks else found.event_times(n) for n in wanted}
        yield (
            f"{master.__name__}, FMI {version}",
            f"{statistics.median(r[0] for r in rounds):.4f}",
            furthest(seen, wanted),
        )
    for step in LIBCOSIM_STEPS:
        spent = libcosim(scenario, fmus["2.0"], step, watched=False)
        seen = libcosim(scenario, fmus["2.0"], step, watched=True)
        yield f"libcosim, {step:g} s", f"{spent:.3f}", furthest(seen, wanted)


def main():
    with tempfile.TemporaryDirectory() as folder:
        print("FMI, FMUs, master in us a call, loop over fmpy in us a call, ratio")
        for row in beside_fmpy(Path(folder)):
            print(*row, sep=", ")
        print("run, CPU time in s, largest error of an event's time")
        for row in beside_libcosim(Path(folder)):
            print(*row, sep=", ")


if __name__ == "__main__":
    main()
