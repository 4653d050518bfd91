"""Exact runs under every kind of weight, with states at chosen times: the solver of `exact_consensus` on other pieces.

Between its breakpoints each weight is ``level + slope (t - start) + swing sin(rate t - phase)``; the solver asks for
its value, its integral and a bound on its slope. Levels come from the package, integrals are written out here.
Sampled checks have a loop of their own: at each check the errors are compared with the threshold of that time.
"""

import numpy as np

from hybrid_model.consensus.scenario.trigger import TriggerKind
from hybrid_model.consensus.weights.carriers import UnitCarrier
from hybrid_model.consensus.weights.gated_sine import SineCarrier, WeightMap
from hybrid_model.consensus.weights.sine import RippleCarrier
from oracles.exact_consensus import ClosedLoop

MET = 1e-12
"""A margin so little below zero, relative to the threshold, is met: what rounding leaves of a tie."""


class WavePiece:
    """The weights of all edges between two breakpoints."""

    def __init__(self, piece):
        count = len(piece.carriers)
        self.start = piece.start
        self.level, self.slope, self.swing, self.phase = (np.zeros(count) for _ in range(4))
        self.rate = np.ones(count)
        middle, quarter = (piece.start + piece.end) / 2, (piece.end - piece.start) / 4
        for e in np.flatnonzero(piece.amplitudes):
            a, carrier = piece.amplitudes[e], piece.carriers[e]
            if isinstance(carrier, UnitCarrier):
                self.level[e] = a
            elif isinstance(carrier, RippleCarrier):
                self.level[e], self.swing[e] = a, a * carrier.depth
                self.rate[e], self.phase[e] = carrier.rate, carrier.phase
            elif isinstance(carrier, SineCarrier) and carrier.map is WeightMap.SQUARE:
                # 4 sin^2 = 2 + 2 sin(2 angle - pi/2)
                self.level[e], self.swing[e] = 2 * a, 2 * a
                self.rate[e], self.phase[e] = 2 * carrier.rate, np.pi / 2
            elif isinstance(carrier, SineCarrier):
                self.swing[e], self.rate[e] = 2 * a * np.sign(np.sin(carrier.rate * middle)), carrier.rate
            else:
                early, late = (a * float(carrier.value(middle + side * quarter)) for side in (-1, 1))
                self.slope[e] = (late - early) / (2 * quarter)
                self.level[e] = early - self.slope[e] * quarter

    def value(self, t):
        return self.level + self.slope * (t - self.start) + self.swing * np.sin(self.rate * t - self.phase)

    def integral(self, a, b):
        straight = (b - a) * (self.level + self.slope * ((a + b) / 2 - self.start))
        wave = np.sin(self.rate * (a + b) / 2 - self.phase) * np.sin(self.rate * (b - a) / 2)
        return straight + 2 * self.swing / self.rate * wave

    def slope_bound(self):
        return np.abs(self.slope) + np.abs(self.swing) * self.rate


def smooth_run(scenario, times, *, max_events=100_000):
    """Event times of each agent, and the states at `times`, shape (times, n); these end with the stop time."""
    sampled = scenario.trigger.kind is TriggerKind.SAMPLED
    loop = SampledChecks(scenario) if sampled else ClosedLoop(scenario)
    states, due = [], list(times)
    for piece in scenario.edge_weights.pieces(0.0, scenario.stop_time):
        wave = WavePiece(piece)
        while due and due[0] <= piece.end:
            loop.run_piece(wave, due.pop(0), max_events)
            states.append(loop.x.copy())
        loop.run_piece(wave, piece.end, max_events)
    return [np.array(events) for events in loop.events], np.array(states)


class SampledChecks(ClosedLoop):
    """The threshold is looked at every `period` only."""

    def __init__(self, scenario):
        network, trigger = scenario.network, scenario.trigger
        self.gain, self.trigger = network.gain, trigger
        self.t, self.checks = 0.0, 1
        self.x = np.array(network.initial, dtype=float)
        self.broadcast = self.x.copy()
        self.events = [[] for _ in self.x]
        self.tails, self.heads = (np.array(network.edges) - 1).T

    def run_piece(self, piece, end, max_events):
        while self.t < end:
            check = self.checks * self.trigger.period
            t = min(check, end)
            self.x, self.t = self.states(piece, t), t
            if t < check:
                return
            self.checks += 1
            level = self.trigger.threshold * np.exp(-self.trigger.decay * t)
            for agent in np.flatnonzero(np.abs(self.broadcast - self.x) >= level * (1 - MET)):
                self.events[agent].append(t)
                self.broadcast[agent] = self.x[agent]
