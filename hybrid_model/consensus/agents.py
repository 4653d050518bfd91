"""The agent: an integrator that moves on broadcast values, and an event generator that decides when to broadcast."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.thresholds import exponential_threshold
from hybrid_model.variables import Value


class Integrator(hm.HybridAutomaton):
    """A single integrator under the consensus protocol on broadcast values.

    ``x' = -k sum_j w_j(t) (xhat - xhat_j)`` over the neighbours j, with the broadcast values xhat in place of the
    states (paper, section 4: control law of the event-triggered agent).
    """

    degree = hm.Dimension("number of neighbours")
    x = hm.State(0.0, description="state of the agent", output=True)
    broadcast = hm.Input(0.0, discrete=True, description="broadcast value of the agent itself")
    neighbours = hm.Input(0.0, shape="degree", discrete=True, description="broadcast values of the neighbours")
    weights = hm.Input(0.0, shape="degree", unit="1/s", description="weights of the edges to the neighbours")
    gain = hm.Parameter(1.0, description="control gain k")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """The consensus protocol."""
        return {"x": -s.gain * np.sum(s.weights * (s.broadcast - s.neighbours))}


class EventGenerator(hm.HybridAutomaton):
    """Holds the value last broadcast and broadcasts anew when the error reaches a threshold.

    The error is ``e = xhat - x``, the trigger function ``f = |e| - threshold(t)`` (paper, section 4). The broadcast at
    the start, ``xhat(t0) = x(t0)``, is not counted as an event. The threshold is positive, so that the margin is
    negative after each broadcast, at consensus as well.
    """

    x = hm.Input(0.0, description="state of the agent")
    broadcast = hm.DiscreteState(computed=True, output=True, description="value last broadcast")
    events = hm.DiscreteState(0, integer=True, output=True, description="number of broadcasts since the start")
    threshold = hm.Parameter(0.5, description="trigger threshold c")
    broadcast_clock = hm.Clock("broadcast", description="ticks with each broadcast")

    @abstractmethod
    def threshold_now(self, s: hm.Values) -> Value:
        """The threshold that the error is compared with."""

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The first broadcast."""
        return {"broadcast": s.x}

    def error_too_large(self, s: hm.Values) -> Value:
        """The trigger function."""
        return np.abs(s.broadcast - s.x) - self.threshold_now(s)

    def send(self, s: hm.Values) -> dict[str, Value]:
        """Broadcast the present state."""
        return {"broadcast": s.x, "events": s.events + 1}

    transitions = (hm.Jump("broadcast", error_too_large, send),)


class StaticTrigger(EventGenerator):
    """Event generator with a constant threshold c (paper, equation of the static trigger function)."""

    def threshold_now(self, s: hm.Values) -> Value:
        """``c``."""
        return s.threshold


class DynamicTrigger(EventGenerator):
    """Event generator with the threshold ``c exp(-beta t)`` (paper, equation of the dynamic trigger function)."""

    decay = hm.Parameter(0.06, unit="1/s", description="decay rate beta of the threshold")

    def threshold_now(self, s: hm.Values) -> Value:
        """``c exp(-beta t)``."""
        return exponential_threshold(s.threshold, s.decay, s.t)


def agent(
    name: str,
    integrator: Integrator,
    weights: hm.Automaton,
    trigger: EventGenerator,
    switching: hm.Automaton | None = None,
) -> hm.Composition:
    """Compose an agent: its inputs are the neighbours' broadcast values, its outputs x and its own broadcast value.

    Parameters
    ----------
    name : str
        Name of the agent.
    integrator : Integrator
        The agent's motion.
    weights : Automaton
        With an output ``weights``, one element a neighbour.
    trigger : EventGenerator
        When the agent broadcasts.
    switching : Automaton, optional
        With an input ``raw`` and an output ``weights``: which edges are active.
    """
    parts: dict[str, hm.Automaton] = {"weights": weights}
    connections = {"integrator.weights": "weights.weights"}
    if switching is not None:
        parts["switching"] = switching
        connections = {"switching.raw": "weights.weights", "integrator.weights": "switching.weights"}
    names = {
        "integrator.x": "x",
        "integrator.gain": "gain",
        "integrator.neighbours": "neighbours",
        **{f"trigger.{item}": item for item in ("broadcast", "events", "threshold", "broadcast_clock")},
    }
    if any(variable.name == "decay" for variable in trigger.variables):
        names["trigger.decay"] = "decay"
    return hm.Composition(
        name,
        {**parts, "integrator": integrator, "trigger": trigger},
        {**connections, "integrator.broadcast": "trigger.broadcast", "trigger.x": "integrator.x"},
        names,
    )
