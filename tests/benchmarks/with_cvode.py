"""scikit-sundae: SUNDIALS' CVODE (Adams) with root functions, restarted at every event and every breakpoint."""

import math

import numpy as np
from sksundae.cvode import CVODE

from .problems import Consensus, Outcome
from .with_scipy import GAVE_UP, MOST_EVENTS

ROOT = 2
"""Status of a run that a root ended, SUNDIALS' CV_ROOT_RETURN: ``t_events`` also holds what earlier runs found."""


def prepare(problem, tolerance):
    return (consensus if isinstance(problem, Consensus) else ball)(problem, tolerance)


def consensus(problem, tolerance):
    scenario = problem.scenario
    gain, threshold, decay = scenario.network.gain, scenario.trigger.threshold, scenario.trigger.decay
    incidence, rates = problem.incidence, problem.rates
    agents = scenario.network.agents
    held = {}

    def flow(t, x, rate):
        weights = held["amplitudes"] * (2.0 * np.sin(rates * t)) ** 2
        rate[:] = -gain * (incidence @ (weights * held["differences"]))

    def guards(t, x, margins):
        margins[:] = np.abs(held["broadcast"] - x) - threshold * math.exp(-decay * t)

    guards.terminal, guards.direction = [True] * agents, [1] * agents
    solver = CVODE(flow, method="Adams", rtol=tolerance, atol=tolerance / 100, eventsfn=guards, num_events=agents)

    def run():
        x = problem.x0
        broadcast = held["broadcast"] = x.copy()
        events = [[] for _ in x]
        for piece in problem.pieces:
            held["amplitudes"] = piece.amplitudes
            t = piece.start
            while t < piece.end:
                held["differences"] = incidence.T @ broadcast
                solution = solver.solve([t, piece.end], x)
                t, x = float(solution.t[-1]), solution.y[-1]
                if not solution.success or sum(map(len, events)) > MOST_EVENTS:
                    return Outcome(events, x, t, GAVE_UP)
                if solution.status == ROOT:
                    for agent in np.flatnonzero(solution.i_events[-1]):
                        events[agent].append(t)
                        broadcast[agent] = x[agent]
        return Outcome(events, x, t)

    return run


def ball(problem, tolerance):
    gravity, restitution = problem.gravity, problem.restitution

    def fall(t, x, rate):
        rate[0], rate[1] = x[1], -gravity

    def floor(t, x, margins):
        margins[0] = x[0]

    floor.terminal, floor.direction = [True], [-1]
    solver = CVODE(fall, method="Adams", rtol=tolerance, atol=tolerance / 100, eventsfn=floor, num_events=1)

    def run():
        t, x, impacts = 0.0, problem.x0, []
        while t < problem.t_end:
            solution = solver.solve([t, problem.t_end], x)
            t, x = float(solution.t[-1]), solution.y[-1]
            if not solution.success or len(impacts) > MOST_EVENTS:
                return Outcome([impacts], x, t, GAVE_UP)
            if solution.status == ROOT:
                impacts.append(t)
                x = np.array([0.0, -restitution * x[1]])
        return Outcome([impacts], x, t)

    return run
