"""Exact solution of the event-triggered closed loop, independent of the framework: closed-form flows, certified events.

Between two broadcasts every broadcast value is constant, so

    x_i(t) = x_i(s) - k sum_j (xhat_i - xhat_j) int_s^t w_ij,

and the integrals of the weights are elementary. Windows, dwell intervals and integrals are written out here once more,
from the formulas of the paper's section 7, and share no code with the package.

An event is the first root of ``f(t) = |xhat_i - x_i(t)| - c0 - c exp(-beta t)``. It is approached from the left by
steps that cannot pass it: with ``f'' <= K`` the parabola ``f + f' h + K h^2/2`` lies above f, so f has no root before
the parabola has one. Near a root this is Newton's method. No root is skipped, however many lie in one piece.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import TriggerKind
from hybrid_model.consensus.switching.base import NoSwitching
from hybrid_model.consensus.weights.constant import ConstantWeight
from hybrid_model.consensus.weights.gated_sine import WeightMap

EPS = np.finfo(float).eps
THRESHOLDS = (TriggerKind.STATIC, TriggerKind.DYNAMIC, TriggerKind.MIXED, TriggerKind.SELF_TRIGGERED)
"""Triggers that broadcast when ``|e|`` meets ``offset + threshold exp(-decay t)``; self-triggered is the same set."""


@dataclass(frozen=True)
class ExactRun:
    """Event times [s] of each agent (the broadcast at t = 0 is not an event) and the states at the stop time."""

    event_times: list[np.ndarray]
    x_end: np.ndarray

    @property
    def counts(self):
        return [len(times) for times in self.event_times]

    @property
    def min_gap(self):
        """Smallest time between two events of one agent, or None if no agent has two."""
        gaps = [np.diff(times).min() for times in self.event_times if len(times) > 1]
        return float(min(gaps)) if gaps else None


def exact_run(scenario: Scenario, *, max_events: int = 100_000) -> ExactRun:
    """Solve the closed loop of a scenario from 0 to its stop time.

    Agents whose thresholds are met at the same instant, up to rounding, all broadcast at that instant.
    """
    loop = ClosedLoop(scenario)
    times = cut_times(scenario)
    for start, end in pairwise(times):
        piece = WeightsOnPiece(scenario, (start + end) / 2)
        loop.run_piece(piece, end, max_events)
    return ExactRun([np.array(events) for events in loop.events], loop.x)


class ClosedLoop:
    """States, broadcast values and the time they belong to."""

    def __init__(self, scenario):
        network = scenario.network
        trigger = scenario.trigger
        if trigger.kind not in THRESHOLDS:
            raise ValueError(f"the trigger {trigger.kind.value} is no threshold of |e| that is watched at all times")
        self.gain, self.offset = network.gain, trigger.offset
        self.threshold, self.decay = trigger.threshold, trigger.decay
        self.t = 0.0
        self.x = np.array(network.initial, dtype=float)
        self.broadcast = self.x.copy()
        self.events = [[] for _ in self.x]
        self.tails = np.array([edge[0] - 1 for edge in network.edges])
        self.heads = np.array([edge[1] - 1 for edge in network.edges])

    def node_sums(self, per_edge):
        """Sum over each agent's edges of (xhat_i - xhat_j) times a number per edge."""
        flow = (self.broadcast[self.tails] - self.broadcast[self.heads]) * per_edge
        sums = np.zeros_like(self.x)
        np.add.at(sums, self.tails, flow)
        np.add.at(sums, self.heads, -flow)
        return sums

    def run_piece(self, piece, end, max_events):
        """Advance to `end`, through every event on the way."""
        while self.t < end:
            t, firing = self.first_event(piece, end)
            self.x, self.t = self.states(piece, t), t
            for agent in np.flatnonzero(firing):
                self.events[agent].append(t)
                self.broadcast[agent] = self.x[agent]
            if sum(map(len, self.events)) > max_events:
                raise RuntimeError(f"more than {max_events} events before t = {t}")

    def states(self, piece, t):
        return self.x - self.gain * self.node_sums(piece.integral(self.t, t))

    def first_event(self, piece, end):
        """Time of the first event from self.t to `end`, and who fires then; `end` and nobody if there is none."""
        curvature = self.gain * self.absolute_sums(piece.slope_bound())
        t = self.t
        while True:
            decaying = self.threshold * np.exp(-self.decay * t)
            level = self.offset + decaying
            error = self.broadcast - self.states(piece, t)
            margin = np.stack((error, -error)) - level
            rate = self.gain * self.node_sums(piece.value(t))
            slope = np.stack((rate, -rate)) + self.decay * decaying
            step = safe_step(margin, slope, np.stack((curvature, curvature)))
            resolved = 4 * EPS * max(1.0, t)
            noise = 4 * EPS * max(1.0, float(np.abs(self.x).max()))
            if level < 1e4 * noise:
                raise RuntimeError(f"at t = {t} the threshold {level} is no longer above the rounding of the states")
            if (margin >= -noise).any() or (step <= resolved).any():
                # Agents whose thresholds are met at one instant differ by the rounding that their states gathered.
                meets = (margin >= -max(1e-12 * level, 64 * noise)) | (step <= resolved)
                return t, meets.any(axis=0)
            if t >= end:
                return end, np.zeros(len(self.x), dtype=bool)
            t = min(t + float(step.min()), end)

    def absolute_sums(self, per_edge):
        flow = np.abs(self.broadcast[self.tails] - self.broadcast[self.heads]) * per_edge
        sums = np.zeros_like(self.x)
        np.add.at(sums, self.tails, flow)
        np.add.at(sums, self.heads, flow)
        return sums


def safe_step(f, slope, curvature):
    """Positive root of ``f + slope*h + curvature*h^2/2``; infinite if there is none, 0 if f is not negative."""
    f = np.minimum(f, 0.0)
    root = np.sqrt(slope**2 - 2 * curvature * f)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # Each form of the root is free of cancellation for one sign of the slope.
        rising = -2 * f / (slope + root)
        falling = (root - slope) / curvature
    step = np.where(slope > 0, rising, falling)
    return np.where(np.isnan(step), np.inf, step)


class WeightsOnPiece:
    """The weights on a piece without breakpoints: per edge ``level + 4 b sin^2(w t) + 2 s sin(w t)``."""

    def __init__(self, scenario, middle):
        waveforms = scenario.weights.waveforms
        count = len(waveforms)
        self.level, self.square, self.sign = np.zeros(count), np.zeros(count), np.zeros(count)
        self.rate = np.ones(count)
        active = active_edges(scenario, middle)
        for edge, waveform in enumerate(waveforms):
            if edge + 1 not in active:
                continue
            if isinstance(waveform, ConstantWeight):
                self.level[edge] = waveform.level
            elif gate_is_open(waveform, middle):
                self.rate[edge] = waveform.sine_rate
                if waveform.map is WeightMap.SQUARE:
                    self.square[edge] = 1.0
                else:
                    self.sign[edge] = np.sign(np.sin(waveform.sine_rate * middle))

    def value(self, t):
        sine = np.sin(self.rate * t)
        return self.level + 4 * self.square * sine**2 + 2 * self.sign * sine

    def integral(self, a, b):
        span, total, rate = b - a, a + b, self.rate
        square = 2 * span - 2 / rate * np.cos(rate * total) * np.sin(rate * span)
        wave = 4 / rate * np.sin(rate * total / 2) * np.sin(rate * span / 2)
        return self.level * span + self.square * square + self.sign * wave

    def slope_bound(self):
        """Bound of |dw/dt|: 4 rate for 4 sin^2, 2 rate for 2|sin|."""
        return self.rate * (4 * self.square + 2 * np.abs(self.sign))


def gate_is_open(waveform, t):
    """Whether t lies in the first `duty` percent of its gate period."""
    angle = (waveform.gate_rate * t - waveform.phase) % (2 * np.pi)
    return angle < 2 * np.pi * waveform.duty_percent / 100


def active_edges(scenario, t):
    switching = scenario.switching
    if isinstance(switching, NoSwitching):
        return range(1, len(scenario.network.edges) + 1)
    return switching.active[int(t // switching.dwell) % len(switching.active)]


def cut_times(scenario):
    """Ascending times from 0 to the stop time that hold every jump and kink of every weight."""
    end = scenario.stop_time
    groups = [np.empty(0)]
    if not isinstance(scenario.switching, NoSwitching):
        groups.append(scenario.switching.dwell * np.arange(1, end / scenario.switching.dwell + 1))
    for waveform in scenario.weights.waveforms:
        if isinstance(waveform, ConstantWeight):
            continue
        cycles = np.arange(-waveform.phase // (2 * np.pi) - 1, (waveform.gate_rate * end - waveform.phase) / 6 + 2)
        opens = (waveform.phase + 2 * np.pi * cycles) / waveform.gate_rate
        groups += [opens, opens + 2 * np.pi * waveform.duty_percent / 100 / waveform.gate_rate]
        groups.append(np.pi / waveform.sine_rate * np.arange(1, end * waveform.sine_rate / np.pi + 1))
    # Two names of one instant may differ by rounding; a piece that short has no middle to speak of.
    apart = 16 * EPS * end
    times = np.unique(np.concatenate(groups))
    times = times[(times > apart) & (times < end - apart)]
    return np.concatenate(([0.0], times[np.diff(times, prepend=0.0) > apart], [end]))
