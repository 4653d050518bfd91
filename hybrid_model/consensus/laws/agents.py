"""The agent (paper, section 4): its motion on broadcast values, its event generator, and what it hears."""

from __future__ import annotations

from functools import cache

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.laws.channels import Receiver
from hybrid_model.declare.variables import Kind, Value

__all__ = ["ContinuousBroadcast", "ContinuousIntegrator", "Integrator", "agent"]

SHOWN = ("broadcast", "events", "broadcast_clock")
"""What an agent shows of its event generator under its own name, beside the law's numbers."""
_COPIES = ("gain", "dwell")
"""Numbers that a law is told of what is around it; what they are copies of has the name."""


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


class ContinuousIntegrator(Integrator):
    """The single integrator under the consensus protocol on states (paper, section 3).

    ``x' = -k sum_j w_j(t) (x - x_j)`` over the neighbours j. Their values change along flows, so agents of this kind
    are composed to one automaton; they do not meet at events only.
    """

    broadcast = hm.Input(0.0, description="state of the agent itself")
    neighbours = hm.Input(0.0, shape="degree", description="states of the neighbours")


@cache
def of_size(motion: type[Integrator], size: float) -> type[Integrator]:
    """Return the motion with `size` as the nominal value of the state.

    An agent that starts at zero, or at what rounding has left of it, among neighbours on both sides, has rates that are
    rounding as well; by itself it would take them for the sizes that there are.
    """
    state = hm.State(0.0, description="state of the agent", output=True, nominal=size)
    return type(motion.__name__, (motion,), {"__doc__": motion.__doc__, "__module__": motion.__module__, "x": state})


class ContinuousBroadcast(hm.HybridAutomaton):
    """Stands in an event generator's place: the broadcast value is the state, and there are no events."""

    x = hm.Input(0.0, description="state of the agent")
    events = hm.DiscreteState(0, integer=True, output=True, description="number of broadcasts: none")
    broadcast = hm.Output(description="the state")

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """No error."""
        return {"broadcast": 1.0 * s.x}


def agent(
    name: str,
    integrator: hm.HybridAutomaton,
    weights: hm.Automaton,
    trigger: hm.HybridAutomaton,
    switching: hm.Automaton | None = None,
    channel: hm.HybridAutomaton | None = None,
) -> hm.Composition:
    """Compose an agent: its inputs are the neighbours' broadcast values, its outputs x and its own broadcast value.

    Parameters
    ----------
    name : str
        Name of the agent.
    integrator : HybridAutomaton
        The agent's motion: an `Integrator`, or one with the same inputs and the output ``x``.
    weights : Automaton
        With an output ``weights``, one element a neighbour.
    trigger : HybridAutomaton
        When the agent broadcasts; it is given the neighbours' values and the weights if it has inputs of these names.
    switching : Automaton, optional
        With an input ``raw`` and an output ``weights``: which edges are active.
    channel : HybridAutomaton, optional
        With an input ``neighbours`` and an output ``received``: what becomes of the neighbours' broadcasts on their
        way. If it has an input ``sent``, that is an input of the agent: the neighbours' numbers of broadcasts.
    """
    parts: dict[str, hm.Automaton] = {"weights": weights}
    connections = {"integrator.broadcast": "trigger.broadcast", "trigger.x": "integrator.x"}
    source = "weights.weights"
    if switching is not None:
        parts["switching"] = switching
        connections["switching.raw"] = source
        source = "switching.weights"
    connections["integrator.weights"] = source
    wanted = {variable.name for variable in trigger.of_kind(Kind.INPUT)}
    if "weights" in wanted:
        connections["trigger.weights"] = source
    names = {"integrator.x": "x", "integrator.gain": "gain"}
    if channel is None and "neighbours" in wanted:
        channel = Receiver(degree=_degree(integrator))
    if channel is None:
        names["integrator.neighbours"] = "neighbours"
    else:
        parts["channel"] = channel
        connections["integrator.neighbours"] = "channel.received"
        names |= {f"channel.{item.name}": item.name for item in channel.of_kind(Kind.INPUT)}
        if "neighbours" in wanted:
            connections["trigger.neighbours"] = "channel.received"
    shown = {variable.name for variable in trigger.variables} | {clock.name for clock in trigger.clocks}
    numbers = [each.name for each in trigger.of_kind(Kind.PARAMETER) if each.shape == () and each.name not in _COPIES]
    names |= {f"trigger.{item}": item for item in (*SHOWN, *numbers) if item in shown and item not in names.values()}
    return hm.Composition(name, {**parts, "integrator": integrator, "trigger": trigger}, connections, names)


def _degree(integrator: hm.HybridAutomaton) -> int:
    return next(variable.shape[0] for variable in integrator.variables if variable.name == "neighbours")
