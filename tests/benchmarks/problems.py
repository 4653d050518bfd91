"""The two problems, as plain data that every tool can use, with their exact events."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from oracles.exact_consensus import exact_run

from hybrid_model.consensus.graphs.undirected import incidence
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario


@dataclass(frozen=True)
class Outcome:
    """What a run gives.

    Attributes
    ----------
    events : list of ndarray
        Event times in s, one array an agent (one array for the ball).
    x_end : ndarray
        States at the end.
    t_end : float
        Where the run ended, in s.
    ended : str
        How it ended, in the tool's words.
    """

    events: list[Any]
    x_end: Any
    t_end: float
    ended: str = "end time"


@dataclass(frozen=True)
class Piece:
    """An interval in s without breakpoints: on it the weight of edge e is ``amplitudes[e]*(2 sin(rates[e] t))**2``."""

    start: float
    end: float
    amplitudes: Any


@dataclass(frozen=True)
class Consensus:
    """An event-triggered network whose weights are gated squares of sines, run to its scenario's stop time."""

    title: str
    scenario: Scenario
    targets: tuple[float, ...] = (1e-8, 1e-10)

    @property
    def t_end(self):
        return self.scenario.stop_time

    @cached_property
    def exact(self):
        run = exact_run(self.scenario)
        return Outcome(run.event_times, run.x_end, self.t_end)

    @cached_property
    def pieces(self):
        pieces = self.scenario.edge_weights.pieces(0.0, self.t_end)
        return [Piece(p.start, p.end, p.amplitudes) for p in pieces]

    @cached_property
    def rates(self):
        return np.array([waveform.sine_rate for waveform in self.scenario.weights.waveforms])

    @cached_property
    def incidence(self):
        network = self.scenario.network
        return incidence(network.agents, network.edges)

    @property
    def x0(self):
        return np.array(self.scenario.network.initial)


@dataclass(frozen=True)
class Ball:
    """A ball dropped from 1 m; its impacts accumulate at ``sqrt(2 h/g) (1 + e)/(1 - e)``."""

    impacts: int = 30
    t_stop: float | None = None
    height: float = 1.0
    gravity: float = 9.81
    restitution: float = 0.7
    targets: tuple[float, ...] = (1e-8, 1e-10)

    @property
    def title(self):
        if self.t_stop is not None:
            return f"Bouncing ball past its Zeno time ({self.zeno_time:.6f} s), to t = {self.t_end:g} s"
        return f"Bouncing ball to the middle of the flight after impact {self.impacts}, t = {self.t_end:.6f} s"

    @property
    def zeno_time(self):
        e = self.restitution
        return np.sqrt(2.0 * self.height / self.gravity) * (1.0 + e) / (1.0 - e)

    @cached_property
    def rebounds(self):
        """Upward speeds in m/s after each impact."""
        return np.sqrt(2.0 * self.gravity * self.height) * self.restitution ** np.arange(1, self.impacts + 1)

    @cached_property
    def times(self):
        first = np.sqrt(2.0 * self.height / self.gravity)
        return np.cumsum(np.concatenate([[first], 2.0 * self.rebounds[:-1] / self.gravity]))

    @property
    def t_end(self):
        middle = self.times[-1] + self.rebounds[-1] / self.gravity
        return float(middle) if self.t_stop is None else self.t_stop

    @cached_property
    def exact(self):
        top = np.array([self.rebounds[-1] ** 2 / (2.0 * self.gravity), 0.0])
        return Outcome([self.times], top, self.t_end)

    @property
    def x0(self):
        return np.array([self.height, 0.0])


# With the dynamic trigger the event at 49.2 s meets its threshold with a slope of 0.0016/s: 1e-10 s there are 1.6e-13
# in the state, which is rounding.
PAPER_STATIC = Consensus("Paper's example, static trigger, to t = 50 s", load_scenario("paper-a-static"))
PAPER_DYNAMIC = Consensus(
    "Paper's example, dynamic trigger, to t = 50 s", load_scenario("paper-a-dynamic"), targets=(1e-8, 1e-9)
)
MIRRORED = Consensus(
    "Two agents that mirror each other and broadcast together, to t = 20 s",
    read_scenario(
        {
            "name": "mirrored",
            "stop_time": 20.0,
            "network": {"agents": 2, "edges": [[1, 2]], "initial": [-0.5, 0.5]},
            "weights": {"kind": "gated-sine", "gate_rate": 4.0, "sine_rate": 5.0, "duty_percent": 20.0},
            "trigger": {"kind": "dynamic", "threshold": 0.3, "decay": 0.2},
        }
    ),
)
PROBLEMS = (PAPER_STATIC, PAPER_DYNAMIC, MIRRORED, Ball())
ZENO_PROBLEM = Ball(t_stop=4.0)
