"""Exact runs of laws that are no plain threshold, and of channels with delay and loss; independent of the framework.

States between events are in closed form, as in `exact_consensus`. The margin of each agent is then a smooth function of
time on every piece of the weights; it is tabulated finely, and each change of sign is refined by bracketing. Values
that need an integral of products (Girard's internal variable) have it by Gauss-Legendre quadrature, which is exact to
rounding on pieces that short. Who receives what is held as a matrix, one copy a receiver.

Events of one instant are taken in the order of the agents, and everybody is looked at again after each.
"""

import heapq
from dataclasses import dataclass, field
from itertools import count, pairwise

import numpy as np
from scipy.optimize import brentq

from hybrid_model.consensus.scenario.trigger import TriggerKind
from oracles.exact_consensus import WeightsOnPiece, cut_times

POINTS = 300
"""Points of a table: the fastest of the weights turns by three radians on a piece, so two roots between neighbouring
points would have to be a hundredth of that apart."""
MET = 1e-12
"""A margin so little below zero, relative to its size, is met: what rounding leaves of a tie."""
NODES, FACTORS = np.polynomial.legendre.leggauss(24)


@dataclass
class LawRun:
    """Event times [s] of each agent, final states, largest drift of the mean at events, and what was lost.

    `slopes` holds how fast the margin of each event grew just before it: an error in the states moves the event by its
    quotient with that.
    """

    event_times: list
    slopes: list
    x_end: np.ndarray
    drift: float
    lost: int
    eta: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def counts(self):
        return [len(times) for times in self.event_times]


def law_run(scenario):
    """Solve the closed loop of a scenario under any of its laws but the continuous one."""
    loop = {
        TriggerKind.RELATIVE: RelativeLoop,
        TriggerKind.GIRARD: GirardLoop,
        TriggerKind.SAMPLED: SampledLoop,
        TriggerKind.PERIODIC: PeriodicLoop,
    }.get(scenario.trigger.kind, ThresholdLoop)(scenario)
    for start, end in pairwise(cut_times(scenario)):
        loop.run_piece(WeightsOnPiece(scenario, (start + end) / 2), end)
    times, slopes = ([np.array(row) for row in rows] for rows in (loop.events, loop.slopes))
    return LawRun(times, slopes, loop.x, loop.drift, loop.lost, loop.eta)


class ThresholdLoop:
    """``|e_i| >= c0 + c exp(-beta t)``, and what all laws have in common."""

    def __init__(self, scenario):
        network, self.trigger, self.channel = scenario.network, scenario.trigger, scenario.channel
        self.gain, self.t = network.gain, 0.0
        self.x = np.array(network.initial, dtype=float)
        self.mean = self.x.mean()
        self.sent = self.x.copy()
        # One row for each direction of each edge: the receiver's copy of the sender's value.
        self.edge = np.repeat(np.arange(len(network.edges)), 2)
        ends = np.array(network.edges) - 1
        self.receiver, self.sender = ends.ravel(), ends[:, ::-1].ravel()
        self.copy = self.x[self.sender]
        self.random = [self.first_random(scenario, r, s) for r, s in zip(self.receiver, self.sender, strict=True)]
        self.under_way, self.order = [], count()
        self.events, self.slopes = [[] for _ in self.x], [[] for _ in self.x]
        self.slope = np.zeros(len(self.x))
        self.eta = np.full(len(self.x), self.trigger.reserve)
        self.drift, self.lost = 0.0, 0

    def first_random(self, scenario, receiver, sender):
        """The seed of a link, as whole numbers: the formula of the package's documentation written out again."""
        sequence = np.random.SeedSequence((scenario.channel.seed, int(receiver) + 1, int(sender) + 1))
        return 1 + int(sequence.generate_state(1, np.uint64)[0]) % (2**31 - 2)

    # Closed forms on a piece, for times of shape (T,): results of shape (T, agents).

    def sums(self, per_link):
        total = np.zeros((*per_link.shape[:-1], len(self.x)))
        for link, receiver in enumerate(self.receiver):
            total[..., receiver] += per_link[..., link]
        return total

    def states(self, piece, times):
        integrals = piece.integral(self.t, np.asarray(times)[..., None])[..., self.edge]
        return self.x - self.gain * self.sums((self.sent[self.receiver] - self.copy) * integrals)

    def margins(self, piece, times):
        error = np.abs(self.sent - self.states(piece, times))
        trigger = self.trigger
        return error - (trigger.offset + trigger.threshold * np.exp(-trigger.decay * np.asarray(times)))[..., None]

    # The run.

    def run_piece(self, piece, end):
        self.settle(piece)
        while self.t < end:
            limit = min([end, *self.planned(), *(arrival for arrival, *_ in self.under_way[:1])])
            self.move(piece, self.first_root(piece, limit))
            self.settle(piece)

    def planned(self):
        """Times known in advance at which the law acts."""
        return []

    def first_root(self, piece, limit):
        times = np.linspace(self.t, limit, POINTS)
        table = self.margins(piece, times)
        found = [limit]
        for agent in range(len(self.x)):
            for k in np.flatnonzero((table[:-1, agent] < 0) & (table[1:, agent] >= 0))[:1]:

                def margin(t, agent=agent):
                    return float(self.margins(piece, np.array([t]))[0, agent])

                found.append(brentq(margin, times[k], times[k + 1], xtol=1e-15, rtol=4 * np.finfo(float).eps))
        return min(found)

    def move(self, piece, t):
        before = max(self.t, t - 1e-6)
        if t > before:
            self.slope = np.diff(self.margins(piece, np.array([before, t])), axis=0)[0] / (t - before)
        self.x, self.t = self.states(piece, np.array([t]))[0], t
        self.drift = max(self.drift, abs(self.x.mean() - self.mean))

    def settle(self, piece):
        """Take all events of the present instant."""
        while self.under_way and self.under_way[0][0] <= self.t:
            _, _, link, value = heapq.heappop(self.under_way)
            self.copy[link] = value
        fired = set()
        while True:
            due = [i for i in np.flatnonzero(self.due(piece)) if i not in fired]
            if not due:
                return
            fired.add(due[0])
            self.broadcast(due[0])

    def due(self, piece):
        return self.margins(piece, np.array([self.t]))[0] >= -MET * self.scale()

    def scale(self):
        return max(1.0, float(np.abs(self.x).max()))

    def broadcast(self, agent):
        self.events[agent].append(self.t)
        self.slopes[agent].append(self.slope[agent])
        self.sent[agent] = self.x[agent]
        for link in np.flatnonzero(self.sender == agent):
            if self.channel.loss or self.channel.delay:
                self.random[link] = 48271 * self.random[link] % (2**31 - 1)
                if self.random[link] < self.channel.loss * (2**31 - 1):
                    self.lost += 1
                    continue
            if self.channel.delay:
                entry = (self.t + self.channel.delay, next(self.order), link, self.x[agent])
                heapq.heappush(self.under_way, entry)
            else:
                self.copy[link] = self.x[agent]


class RelativeLoop(ThresholdLoop):
    """``l_ii e_i^2 >= sigma q_i/2 + floor exp(-beta t)``."""

    def excess(self, piece, times):
        weights = piece.value(np.asarray(times)[..., None])[..., self.edge]
        disagreement = self.sums(0.5 * weights * (self.copy - self.sent[self.receiver]) ** 2)
        error = self.sent - self.states(piece, times)
        return self.sums(weights) * error**2 - 0.5 * self.trigger.sigma * disagreement

    def margins(self, piece, times):
        floor = self.trigger.floor * np.exp(-self.trigger.decay * np.asarray(times))
        return self.excess(piece, times) - floor[..., None]


class GirardLoop(RelativeLoop):
    """``theta (l_ii e_i^2 - sigma q_i/2) >= eta_i`` with ``eta' = -leak eta - k excess``."""

    def reserve(self, piece, times):
        """eta at `times`: the linear equation's solution, its integral by quadrature from the last event on."""
        spans = np.asarray(times) - self.t
        nodes = self.t + spans[..., None] * (NODES + 1) / 2
        fading = np.exp(-self.trigger.leak * (np.asarray(times)[..., None] - nodes))
        inflow = -self.gain * self.excess(piece, nodes)
        integral = 0.5 * spans[..., None] * np.einsum("tn,tna,n->ta", fading, inflow, FACTORS)
        return self.eta * np.exp(-self.trigger.leak * spans)[..., None] + integral

    def margins(self, piece, times):
        return self.trigger.theta * self.excess(piece, times) - self.reserve(piece, times)

    def move(self, piece, t):
        eta = self.reserve(piece, np.array([t]))[0]
        super().move(piece, t)
        self.eta = eta


class SampledLoop(ThresholdLoop):
    """The threshold looked at at multiples of the period only."""

    def planned(self):
        return [(self.checks_done() + 1) * self.trigger.period]

    def checks_done(self):
        index = round(self.t / self.trigger.period)
        return index if abs(index * self.trigger.period - self.t) < 1e-12 else int(self.t // self.trigger.period)

    def first_root(self, piece, limit):
        return limit

    def due(self, piece):
        index = round(self.t / self.trigger.period)
        is_check = index > 0 and abs(index * self.trigger.period - self.t) < 1e-12
        return super().due(piece) if is_check else np.zeros(len(self.x), dtype=bool)


class PeriodicLoop(SampledLoop):
    """A broadcast at each multiple of the period."""

    def margins(self, piece, times):
        return np.ones((len(times), len(self.x)))
