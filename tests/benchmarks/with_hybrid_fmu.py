"""This project: `simulate` on the engine in C and on the one in Python, and FMUs under the event-exact master."""

import tempfile
from pathlib import Path

import numpy as np

import hybrid_model as hm
from cosim.consensus import fmu_system, network_report
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.result import Ended
from cosim.system import System
from fmu.export import export_fmu
from hybrid_model.consensus.laws.closed_loop import closed_loop, scenario_agents
from hybrid_model.models import BouncingBall

from .problems import Consensus, Outcome


def automaton_of(problem):
    if isinstance(problem, Consensus):
        return closed_loop(problem.scenario)
    return BouncingBall(h=problem.height, g=problem.gravity, e=problem.restitution)


def event_names(problem):
    if isinstance(problem, Consensus):
        names = [jump.name for jump in closed_loop(problem.scenario).jumps]
        return [
            next(n for n in names if n.startswith(f"agent{i}.") and n.endswith("broadcast")) for i in _agents(problem)
        ]
    return ["jump"]


def simulate(problem, tolerance):
    return _simulated(problem, tolerance, "native")


def simulate_python(problem, tolerance):
    return _simulated(problem, tolerance, "python")


def _simulated(problem, tolerance, engine):
    automaton = automaton_of(problem)
    names = event_names(problem)
    states = [f"agent{i}.x" for i in _agents(problem)] if isinstance(problem, Consensus) else ["h", "v"]
    solver = hm.Solver(rtol=tolerance, atol=tolerance / 100)

    def run():
        arc = hm.simulate(automaton, problem.t_end, solver=solver, engine=engine)
        x_end = np.array([float(arc.end[name]) for name in states])
        ended = "end time" if arc.stop is hm.Stop.HORIZON else f"{arc.stop.name}: {arc.message}"
        return Outcome([arc.event_times(name) for name in names], x_end, float(arc.t[-1]), ended)

    return run


def co_simulate(problem, tolerance):
    """The FMUs integrate with their own tolerance, whatever is asked for."""
    folder = tempfile.TemporaryDirectory()
    if isinstance(problem, Consensus):
        agents = scenario_agents(problem.scenario)
        fmus = {name: export_fmu(agent, Path(folder.name) / f"{name}.fmu") for name, agent in agents.items()}
    else:
        fmus = {"ball": export_fmu(automaton_of(problem), Path(folder.name) / "ball.fmu")}

    consensus = isinstance(problem, Consensus)
    system = fmu_system(problem.scenario, fmus) if consensus else System([FmuSlave("ball", fmus["ball"])], {})
    for slave in system.slaves.values():
        slave.load()

    def run(_keep=folder):
        result = run_event_exact(system, problem.t_end)
        if consensus:
            report = network_report(problem.scenario, result)
            events, x_end = report.event_times, report.x_end
        else:
            events = [result.tick_times("ball", "impact")]
            x_end = np.array([result.final["ball.h"], result.final["ball.v"]])
        ended = "end time" if result.ended is Ended.HORIZON else f"{result.ended.name}: {result.message}"
        return Outcome(events, x_end, result.t, ended)

    return run


def _agents(problem):
    return range(1, problem.scenario.network.agents + 1)
