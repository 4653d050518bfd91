"""pathsim: an ODE block with zero-crossing events and a schedule of the breakpoints, solver RKDP87."""

import math

import numpy as np
from pathsim import Simulation
from pathsim.blocks import ODE
from pathsim.events import ScheduleList, ZeroCrossingDown, ZeroCrossingUp
from pathsim.exceptions import StopSimulation
from pathsim.solvers import RKDP87

from .problems import Consensus, Outcome
from .with_scipy import GAVE_UP, MOST_EVENTS


def prepare(problem, tolerance):
    return (consensus if isinstance(problem, Consensus) else ball)(problem, tolerance)


def consensus(problem, tolerance):
    scenario = problem.scenario
    gain, threshold, decay = scenario.network.gain, scenario.trigger.threshold, scenario.trigger.decay
    incidence, rates = problem.incidence, problem.rates

    def run():
        broadcast = problem.x0
        held = {"piece": 0, "amplitudes": problem.pieces[0].amplitudes, "differences": incidence.T @ broadcast}

        def flow(x, u, t):
            weights = held["amplitudes"] * (2.0 * np.sin(rates * t)) ** 2
            return -gain * (incidence @ (weights * held["differences"]))

        network = ODE(flow, problem.x0)

        def crossing_of(agent):
            def guard(t):
                return abs(broadcast[agent] - network.engine.state[agent]) - threshold * math.exp(-decay * t)

            def fire(t):
                broadcast[agent] = network.engine.state[agent]
                held["differences"] = incidence.T @ broadcast

            return ZeroCrossingUp(guard, fire, tolerance)

        def next_piece(t):
            held["piece"] += 1
            held["amplitudes"] = problem.pieces[held["piece"]].amplitudes

        crossings = [crossing_of(agent) for agent in range(len(broadcast))]
        breakpoints = ScheduleList([piece.start for piece in problem.pieces[1:]], next_piece)
        return _run(network, [*crossings, breakpoints], crossings, problem.t_end, tolerance)

    return run


def ball(problem, tolerance):
    gravity, restitution = problem.gravity, problem.restitution

    def run():
        body = ODE(lambda x, u, t: np.array([x[1], -gravity]), problem.x0)

        def bounce(t):
            # The state lies up to the tolerance below the floor; its absolute value is above, as in pathsim's example.
            if len(impact) > MOST_EVENTS:
                raise StopSimulation(GAVE_UP)
            h, v = body.engine.state
            body.engine.state = np.array([abs(h), -restitution * v])

        impact = ZeroCrossingDown(lambda t: body.engine.state[0], bounce, tolerance)
        return _run(body, [impact], [impact], problem.t_end, tolerance)

    return run


def _run(block, events, counted, t_end, tolerance):
    simulation = Simulation(
        [block],
        events=events,
        Solver=RKDP87,
        tolerance_lte_rel=tolerance,
        tolerance_lte_abs=tolerance / 100,
        log=False,
    )
    simulation.run(t_end)
    ended = "end time" if simulation.time >= t_end else GAVE_UP
    return Outcome([list(event) for event in counted], block.engine.state.copy(), float(simulation.time), ended)
