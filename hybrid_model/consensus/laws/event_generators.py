"""The event generator of each trigger law, made for one agent."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import hybrid_model as hm
from hybrid_model.consensus.laws.agents import ContinuousBroadcast
from hybrid_model.consensus.laws.relative_triggers import GirardTrigger, RelativeTrigger
from hybrid_model.consensus.laws.self_triggers import SELF_TRIGGERS
from hybrid_model.consensus.laws.threshold_triggers import DynamicTrigger, MixedTrigger, StaticTrigger
from hybrid_model.consensus.laws.timed_triggers import PeriodicBroadcast, SampledTrigger
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.own_trigger import OwnTrigger
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind
from hybrid_model.consensus.switching.base import NoSwitching, Switching, masks
from hybrid_model.consensus.switching.cycle import SwitchingCycle
from hybrid_model.consensus.weights.waveform import Waveform

__all__ = ["Surroundings", "event_generator"]


@dataclass(frozen=True)
class Surroundings:
    """What an event generator may know of the agent that it belongs to.

    Attributes
    ----------
    edges : sequence of int
        The agent's edges, as indices from 0 into the network's list.
    waveforms : sequence of Waveform
        Their weights.
    switching : Switching
        When which edges of the network are active.
    gain : float
        Control gain k.
    """

    edges: Sequence[int]
    waveforms: Sequence[Waveform]
    switching: Switching
    gain: float


def event_generator(trigger: Trigger, around: Surroundings) -> hm.HybridAutomaton:
    """Make the event generator of one agent.

    Parameters
    ----------
    trigger : Trigger
        The law and its numbers.
    around : Surroundings
        The agent's edges, for the laws that know them.

    Returns
    -------
    Automaton
        With an input ``x``, outputs ``broadcast`` and ``events``, and inputs ``neighbours`` and ``weights`` where the
        law needs them.

    Raises
    ------
    ScenarioError
        If a self-triggered agent has weights whose future it cannot compute.
    """
    if isinstance(trigger, OwnTrigger):
        return trigger.make(len(around.edges), around.gain)
    return _MAKERS[trigger.kind](trigger, around)


def _relative(trigger: Trigger, around: Surroundings) -> hm.HybridAutomaton:
    return RelativeTrigger(degree=len(around.edges), **trigger.numbers)


def _girard(trigger: Trigger, around: Surroundings) -> hm.HybridAutomaton:
    numbers = trigger.numbers
    return GirardTrigger(degree=len(around.edges), gain=around.gain, eta=numbers.pop("reserve"), **numbers)


def _self_triggered(trigger: Trigger, around: Surroundings) -> hm.HybridAutomaton:
    edges, switching = around.edges, around.switching
    if not edges:
        # Nobody to hear and nothing that moves the state: the dynamic trigger never fires either.
        return DynamicTrigger(**trigger.numbers)
    graphs: dict[str, Any] = {"active": [[1.0] * len(edges)]}
    if isinstance(switching, SwitchingCycle):
        graphs = {"active": masks(switching.active, edges), "dwell": switching.dwell}
    elif not isinstance(switching, NoSwitching):
        raise ScenarioError(_unknown_future(f"switching {type(switching).__name__}"))
    law = SELF_TRIGGERS.get(around.waveforms[0].automaton)
    if law is None or len({waveform.automaton for waveform in around.waveforms}) > 1:
        raise ScenarioError(_unknown_future(f"weights {type(around.waveforms[0]).__name__}"))
    return law(gain=around.gain, **trigger.numbers, **graphs, **law.columns(around.waveforms))


_MAKERS: dict[TriggerKind, Callable[[Trigger, Surroundings], hm.HybridAutomaton]] = {
    TriggerKind.STATIC: lambda trigger, _: StaticTrigger(threshold=trigger.threshold),
    TriggerKind.DYNAMIC: lambda trigger, _: DynamicTrigger(**trigger.numbers),
    TriggerKind.MIXED: lambda trigger, _: MixedTrigger(**trigger.numbers),
    TriggerKind.RELATIVE: _relative,
    TriggerKind.GIRARD: _girard,
    TriggerKind.SELF_TRIGGERED: _self_triggered,
    TriggerKind.SAMPLED: lambda trigger, _: SampledTrigger(**trigger.numbers),
    TriggerKind.PERIODIC: lambda trigger, _: PeriodicBroadcast(**trigger.numbers),
    TriggerKind.CONTINUOUS: lambda trigger, _: ContinuousBroadcast(),
}


def _unknown_future(what: str) -> str:
    return (
        f"[trigger] kind is 'self-triggered', but no self-triggered agent can compute ahead over {what}; it knows "
        "constant, sine and gated-sine weights, switched periodically or not at all. Take kind = 'dynamic', which "
        "gives the same broadcasts."
    )
