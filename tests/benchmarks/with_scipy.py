"""SciPy: `solve_ivp` with terminal events, restarted at every event and every breakpoint."""

import math

import numpy as np
from scipy.integrate import solve_ivp

from .problems import Consensus, Outcome

MOST_EVENTS = 10_000
"""A loop that has restarted so often is given up: it no longer advances."""
GAVE_UP = f"given up after {MOST_EVENTS} restarts or a failed step"


def prepare(problem, tolerance, method):
    return (consensus if isinstance(problem, Consensus) else ball)(problem, tolerance, method)


def consensus(problem, tolerance, method):
    scenario = problem.scenario
    gain, threshold, decay = scenario.network.gain, scenario.trigger.threshold, scenario.trigger.decay
    incidence, rates = problem.incidence, problem.rates
    options = {"method": method, "rtol": tolerance, "atol": tolerance / 100}

    def run():
        x = problem.x0
        broadcast = x.copy()
        events = [[] for _ in x]

        def guard_of(agent):
            def guard(t, x):
                return abs(broadcast[agent] - x[agent]) - threshold * math.exp(-decay * t)

            guard.terminal, guard.direction = True, 1
            return guard

        guards = [guard_of(agent) for agent in range(len(x))]
        for piece in problem.pieces:
            t = piece.start
            while t < piece.end:
                differences = incidence.T @ broadcast

                def flow(t, x, amplitudes=piece.amplitudes, differences=differences):
                    weights = amplitudes * (2.0 * np.sin(rates * t)) ** 2
                    return -gain * (incidence @ (weights * differences))

                try:
                    solution = solve_ivp(flow, (t, piece.end), x, events=guards, **options)
                except ValueError as error:
                    # A guard that is zero at the restart: the root finder is given ends of one sign.
                    return Outcome(events, x, t, f"ValueError: {error}")
                t, x = float(solution.t[-1]), solution.y[:, -1]
                for agent, times in enumerate(solution.t_events):
                    if times.size:
                        events[agent].append(float(times[-1]))
                        broadcast[agent] = x[agent]
                if solution.status == -1 or sum(map(len, events)) > MOST_EVENTS:
                    return Outcome(events, x, t, GAVE_UP)
        return Outcome(events, x, t)

    return run


def ball(problem, tolerance, method):
    gravity, restitution = problem.gravity, problem.restitution
    options = {"method": method, "rtol": tolerance, "atol": tolerance / 100}

    def fall(t, x):
        return [x[1], -gravity]

    def floor(t, x):
        return x[0]

    floor.terminal, floor.direction = True, -1

    def run():
        t, x, impacts = 0.0, problem.x0, []
        while t < problem.t_end:
            try:
                solution = solve_ivp(fall, (t, problem.t_end), x, events=floor, **options)
            except ValueError as error:
                # As above, once the flights last a few ulp.
                return Outcome([impacts], x, t, f"ValueError: {error}")
            t, x = float(solution.t[-1]), solution.y[:, -1]
            if solution.status == -1 or len(impacts) > MOST_EVENTS:
                return Outcome([impacts], x, t, GAVE_UP)
            if solution.status == 1:
                impacts.append(t)
                x = np.array([0.0, -restitution * x[1]])
        return Outcome([impacts], x, t)

    return run
