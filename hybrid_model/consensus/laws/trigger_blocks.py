"""From the trigger of a scenario to the automaton of one agent's event generator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import hybrid_model as hm
from hybrid_model.consensus.laws.agents import ContinuousBroadcast
from hybrid_model.consensus.laws.relative_triggers import GirardTrigger, RelativeTrigger
from hybrid_model.consensus.laws.self_trigger_weights import ConstantSelfTrigger, GatedSineSelfTrigger, SineSelfTrigger
from hybrid_model.consensus.laws.timed_triggers import PeriodicBroadcast, SampledTrigger
from hybrid_model.consensus.laws.triggers import DynamicTrigger, MixedTrigger, StaticTrigger
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind
from hybrid_model.consensus.weights.gated_sine import ConstantWeight, GatedSine, Waveform, WeightMap
from hybrid_model.consensus.weights.switching import NoSwitching, PeriodicSwitching, Switching
from hybrid_model.consensus.weights.waves import SineWeight


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


def trigger_block(trigger: Trigger, around: Surroundings) -> hm.HybridAutomaton:
    """Make the event generator of one agent.

    Parameters
    ----------
    trigger : Trigger
        The law and its trigger.
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
    degree = len(around.edges)
    match trigger.kind:
        case TriggerKind.STATIC:
            return StaticTrigger(threshold=trigger.threshold)
        case TriggerKind.DYNAMIC:
            return DynamicTrigger(threshold=trigger.threshold, decay=trigger.decay)
        case TriggerKind.MIXED:
            return MixedTrigger(threshold=trigger.threshold, decay=trigger.decay, offset=trigger.offset)
        case TriggerKind.RELATIVE:
            return RelativeTrigger(degree=degree, sigma=trigger.sigma, floor=trigger.floor, decay=trigger.decay)
        case TriggerKind.GIRARD:
            return GirardTrigger(
                degree=degree,
                sigma=trigger.sigma,
                theta=trigger.theta,
                leak=trigger.leak,
                eta=trigger.reserve,
                gain=around.gain,
            )
        case TriggerKind.SAMPLED:
            return SampledTrigger(threshold=trigger.threshold, decay=trigger.decay, period=trigger.period)
        case TriggerKind.PERIODIC:
            return PeriodicBroadcast(period=trigger.period)
        case TriggerKind.CONTINUOUS:
            return ContinuousBroadcast()
        case TriggerKind.SELF_TRIGGERED:
            return _self_trigger(trigger, around)


def _self_trigger(trigger: Trigger, around: Surroundings) -> hm.HybridAutomaton:
    edges = around.edges
    if not edges:
        # Nobody to hear and nothing that moves the state: the dynamic trigger never fires either.
        return DynamicTrigger(threshold=trigger.threshold, decay=trigger.decay)
    common: dict[str, Any] = {"threshold": trigger.threshold, "decay": trigger.decay, "gain": around.gain}
    common["active"] = [[1.0] * len(edges)]
    if isinstance(around.switching, PeriodicSwitching):
        common["active"] = [[float(k + 1 in row) for k in edges] for row in around.switching.active]
        common["dwell"] = around.switching.dwell
    elif not isinstance(around.switching, NoSwitching):
        raise ScenarioError(_unknown_future(f"switching {type(around.switching).__name__}"))
    constant = [waveform for waveform in around.waveforms if isinstance(waveform, ConstantWeight)]
    if len(constant) == len(edges):
        return ConstantSelfTrigger(level=[waveform.level for waveform in constant], **common)
    sines = [waveform for waveform in around.waveforms if isinstance(waveform, SineWeight)]
    if len(sines) == len(edges):
        return SineSelfTrigger(
            mean=[waveform.mean for waveform in sines],
            depth=[waveform.depth for waveform in sines],
            rate=[waveform.rate for waveform in sines],
            phase=[waveform.phase for waveform in sines],
            **common,
        )
    gated = [waveform for waveform in around.waveforms if isinstance(waveform, GatedSine)]
    if len(gated) < len(edges):
        raise ScenarioError(_unknown_future(f"weights {type(around.waveforms[0]).__name__}"))
    return GatedSineSelfTrigger(
        gate_rate=[waveform.gate_rate for waveform in gated],
        sine_rate=[waveform.sine_rate for waveform in gated],
        duty_percent=[waveform.duty_percent for waveform in gated],
        phase=[waveform.phase for waveform in gated],
        squared=float(gated[0].map is WeightMap.SQUARE),
        **common,
    )


def _unknown_future(what: str) -> str:
    return (
        f"[trigger] kind is 'self-triggered', but no self-triggered agent can compute ahead over {what}; it knows "
        "constant, sine and gated-sine weights, switched periodically or not at all. Take kind = 'dynamic', which "
        "gives the same broadcasts."
    )
