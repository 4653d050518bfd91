"""What an event costs under the event-exact master: beside loops that know the events, and among a hundred agents.

``PYTHONPATH=tests python -m benchmarks.event_cost`` prints both: CPU time of one process, the middle of paired rounds.

- A timer sends a number to a tank at each of its events. Two loops are told the times of the events beforehand and make
  the master's calls, which `calls_of_an_event` counts: one by the functions of fmpy, one as bare calls of C, whose
  arguments are made before the run and whose status nobody looks at.
- A ring of 100 event-triggered agents, and 25 rings of 4, whose starts are drawn from one distribution.
"""

import ctypes as c
import functools
import gc
import statistics
import tempfile
import time
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.system import System
from fmu.export import export_fmu
from hybrid_model.consensus.laws.agents import Integrator, agent
from hybrid_model.consensus.laws.threshold_triggers import DynamicTrigger
from hybrid_model.consensus.weights.gated_sine import GatedSine
from hybrid_model.consensus.weights.kinds import weights_block

EVENTS, ROUNDS, FEW, MANY, RING_END = 4000, 9, 4, 100, 30.0
MODES = {"event": "EnterEventMode", "step": "EnterStepMode"}


class Timer(hm.HybridAutomaton):
    """Sends the number of its events, one a second."""

    count = hm.DiscreteState(0, integer=True)
    sent = hm.Output(discrete=True)

    def outputs(self, s):
        return {"sent": 1.0 * s.count}

    transitions = (hm.TimeEvent("turn", lambda self, s: 1.0 * (s.count + 1), lambda self, s: {"count": s.count + 1}),)


class Tank(hm.HybridAutomaton):
    """Takes it in."""

    inflow = hm.Input(0.0, discrete=True)
    level = hm.State(0.4, output=True)

    def flow_map(self, s):
        return {"level": s.inflow - s.level}


def timed(run):
    gc.collect()
    began = time.process_time()
    found = run()
    return time.process_time() - began, found


def exported(folder):
    return [export_fmu(kind(), folder / f"{kind.__name__}.fmu", fmi="3.0", kinds=("cs",)) for kind in (Timer, Tank)]


def pair(timer, tank):
    slaves = [FmuSlave("timer", timer), FmuSlave("tank", tank)]
    for slave in slaves:
        slave.load()
    return System(slaves, {"tank.inflow": "timer.sent"})


def master_run(timer, tank, events):
    """CPU time in s, and the result."""
    system = pair(timer, tank)
    return timed(lambda: run_event_exact(system, events + 0.5))


def calls_of_an_event(timer, tank):
    """Count what the master calls, by the difference of two runs."""

    def made(events):
        count, system = [0], pair(timer, tank)
        for slave in system.slaves.values():
            _count(slave.load(), count)
        run_event_exact(system, events + 0.5)
        return count[0]

    return made(3) - made(2)


def _count(instance, count):
    bind = instance._bound

    def bound(*arguments):
        call = bind(*arguments)

        def counted():
            count[0] += 1
            return call()

        return counted

    instance._bound = bound


class Loop:
    """The same run by someone who knows that there is an event at each full second."""

    def __init__(self, timer, tank):
        (self.timer, timer_at), (self.tank, tank_at) = self._made(timer), self._made(tank)
        self.sent, self.inflow = timer_at["sent"], tank_at["inflow"]

    @staticmethod
    def _made(path):
        description = fmpy.read_model_description(str(path))
        named = {"modelIdentifier": description.coSimulation.modelIdentifier, "instanceName": path.stem}
        fmu = FMU3Slave(guid=description.instantiationToken, unzipDirectory=fmpy.extract(str(path)), **named)
        return fmu, {v.name: [v.valueReference] for v in description.modelVariables}

    def run(self, calls, events):
        """CPU time in s with the instances and the calls made, and the last time."""
        fmus = self.timer, self.tank

        def whole():
            for fmu in fmus:
                fmu.instantiate(eventModeUsed=True, earlyReturnAllowed=True)
                fmu.enterInitializationMode(stopTime=events + 0.5)
                fmu.exitInitializationMode()
                fmu.updateDiscreteStates()
                fmu.enterStepMode()
            calls(events)
            for fmu in fmus:
                fmu.fmi3FreeInstance(fmu.component)  # freeInstance unloads the library too

        return timed(whole)[0]

    def by_fmpy(self, events):
        timer, tank = self.timer, self.tank
        for k in range(events):
            timer.doStep(float(k), 1.0)
            timer.enterEventMode()
            timer.updateDiscreteStates()
            value = timer.getFloat64(self.sent)
            tank.doStep(float(k), 1.0)
            tank.enterEventMode()
            tank.setFloat64(self.inflow, value)
            tank.updateDiscreteStates()
            timer.enterStepMode()
            tank.enterStepMode()

    def bare(self, events):
        at, value = c.c_double(), (c.c_double * 1)()
        timer, tank = (self._calls(at, fmu) for fmu in (self.timer, self.tank))
        get, put = (
            functools.partial(
                fmu.dll[f"fmi3{name}"], c.c_void_p(fmu.component), (c.c_uint32 * 1)(*variable), one, value, one
            )
            for one in [c.c_size_t(1)]
            for fmu, name, variable in (
                (self.timer, "GetFloat64", self.sent),
                (self.tank, "SetFloat64", self.inflow),
            )
        )
        for k in range(events):
            at.value = k
            timer["do"]()
            timer["event"]()
            timer["update"]()
            get()
            tank["do"]()
            tank["event"]()
            put()
            tank["update"]()
            timer["step"]()
            tank["step"]()

    @staticmethod
    def _calls(at, fmu):
        here, told, time_ = c.c_void_p(fmu.component), [c.byref(c.c_bool()) for _ in range(5)], c.byref(c.c_double())
        made = {mode: functools.partial(fmu.dll[f"fmi3{name}"], here) for mode, name in MODES.items()}
        made["do"] = functools.partial(
            fmu.dll["fmi3DoStep"], here, at, c.c_double(1.0), c.c_bool(True), *told[:3], time_
        )
        return made | {"update": functools.partial(fmu.dll["fmi3UpdateDiscreteStates"], here, *told, time_)}


def beside_loops(folder):
    timer, tank = exported(folder)
    loop, calls = Loop(timer, tank), calls_of_an_event(timer, tank)
    rounds = [
        (master_run(timer, tank, EVENTS)[0], loop.run(loop.by_fmpy, EVENTS), loop.run(loop.bare, EVENTS))
        for _ in range(ROUNDS)
    ]
    for k, name in enumerate(("event-exact master", "loop over fmpy", "loop over bare calls")):
        spent = 1e6 * statistics.median(r[k] for r in rounds) / EVENTS
        ratios = [r[0] / r[k] for r in rounds]
        yield name, calls, f"{spent:.1f}", f"{statistics.median(ratios):.2f}", f"{min(ratios):.2f}-{max(ratios):.2f}"


def ring_agent():
    weights = weights_block([GatedSine(4.0, 5.0, 20.0)] * 2)
    return agent("agent", Integrator(degree=2), weights, DynamicTrigger(threshold=0.05, decay=0.06))


def ring_run(path, agents):
    """CPU time of a run in s, and its broadcasts; without a path, of automata in this process."""
    names = [f"a{k}" for k in range(agents)]
    slaves = [FmuSlave(name, path) if path else AutomatonSlave(name, ring_agent()) for name in names]
    for slave, start in zip(slaves, np.random.default_rng(0).uniform(-1.0, 1.0, agents), strict=True):
        slave.set("x", float(start))
        if path:
            slave.load()
    around = {
        f"{name}.neighbours": [f"{names[k - 1]}.broadcast", f"{names[(k + 1) % agents]}.broadcast"]
        for k, name in enumerate(names)
    }
    system = System(slaves, around)
    spent, found = timed(lambda: run_event_exact(system, RING_END))
    return spent, len(found.ticks)


def beside_few(path):
    for _ in range(ROUNDS):
        few, many = [ring_run(path, FEW) for _ in range(MANY // FEW)], ring_run(path, MANY)
        yield 1e6 * many[0] / many[1], 1e6 * sum(spent for spent, _ in few) / sum(count for _, count in few)


def main():
    with tempfile.TemporaryDirectory() as folder:
        print("one event sent by one FMU to another: calls, us, master / this, its spread")
        for row in beside_loops(Path(folder)):
            print(*row, sep=", ")
        agent = export_fmu(ring_agent(), Path(folder) / "agent.fmu", fmi="3.0", kinds=("cs",))
        print(f"rings: us an event among {MANY}, among {FEW}, ratio, its spread")
        for name, path in (("FMUs", agent), ("automata", None)):
            rounds = list(beside_few(path))
            ratios = [many / few for many, few in rounds]
            many, few = (statistics.median(r[k] for r in rounds) for k in (0, 1))
            print(name, f"{many:.0f}", f"{few:.0f}", f"{statistics.median(ratios):.2f}", end=", ")
            print(f"{min(ratios):.2f}-{max(ratios):.2f}")


if __name__ == "__main__":
    main()
