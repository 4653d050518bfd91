"""From a scenario to automata: the agents, their wiring, and the closed loop composed of them (paper, section 4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import hybrid_model as hm
from hybrid_model.consensus.laws.agents import ContinuousIntegrator, Integrator, agent, of_size
from hybrid_model.consensus.laws.channels import LossyChannel, link_seeds
from hybrid_model.consensus.laws.event_generators import Surroundings, event_generator
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario, Weights, require_scenario
from hybrid_model.consensus.scenario.own_trigger import OwnTrigger
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind
from hybrid_model.consensus.weights.function import FunctionWeight, TimeFunction
from hybrid_model.consensus.weights.kinds import weights_block
from hybrid_model.consensus.weights.waveform import Waveform
from hybrid_model.declare.calls import explained

Recipe = tuple[object, Callable[[], Any]]
"""What decides about a part, as data that compare equal or do not, and what makes the part, or None for no part."""

_KNOW_MORE = (TriggerKind.RELATIVE, TriggerKind.GIRARD, TriggerKind.SELF_TRIGGERED, TriggerKind.OWN)
"""Laws that are told what is around them."""


def agent_name(number: int) -> str:
    """Return the name of agent `number`, counted from 1."""
    return f"agent{number}"


def scenario_agents(scenario: Scenario, motion: type[hm.HybridAutomaton] | None = None) -> dict[str, hm.Composition]:
    """Make the agents of a scenario.

    Parameters
    ----------
    scenario : Scenario
        Network, weights, switching and trigger.
    motion : type, optional
        How agents move, in place of the single integrator: a class of automata with the inputs, the parameter ``gain``,
        the state ``x`` and the length ``degree`` of `hybrid_model.consensus.Integrator`; derive it from that.

    Returns
    -------
    dict
        Agent name -> automaton with inputs ``neighbours`` (in the order of the agent's edges) and outputs ``x``,
        ``broadcast`` and ``events``.

    Raises
    ------
    ScenarioError
        If `scenario` is none, the trigger cannot be had with its weights or channel, or `motion` is no such class.
    """
    require_scenario("scenario_agents", scenario)
    if motion is not None and not (isinstance(motion, type) and issubclass(motion, Integrator)):
        raise ScenarioError(f"motion is {motion!r}; give a class derived from hybrid_model.consensus.Integrator.")
    if motion is not None and scenario.trigger.kind is TriggerKind.CONTINUOUS:
        raise ScenarioError("motion is given, but the trigger 'continuous' has a motion of its own; leave one out.")
    return {agent_name(i): scenario_agent(scenario, i, motion) for i in range(1, scenario.network.agents + 1)}


def broadcast_wires(scenario: Scenario) -> dict[str, list[str]]:
    """Return which broadcasts each agent of a `scenario` receives.

    ``"agent1.neighbours"`` -> ``["agent2.broadcast", ...]``. Over a channel that delays or loses broadcasts,
    agents also receive the senders' counts, as ``"agent1.sent"``.
    """
    wires = {}
    for i in range(1, scenario.network.agents + 1):
        others = [other_end(scenario, edge, i) for edge in edges_of(scenario, i)]
        wires[f"{agent_name(i)}.neighbours"] = [f"{agent_name(j)}.broadcast" for j in others]
        if others and not scenario.channel.ideal:
            wires[f"{agent_name(i)}.sent"] = [f"{agent_name(j)}.events" for j in others]
    return wires


@explained(ScenarioError)
def closed_loop(
    scenario: Scenario,
    *,
    trigger: type[hm.HybridAutomaton] | Trigger | None = None,
    weights: Waveform | Sequence[Waveform] | TimeFunction | None = None,
    motion: type[hm.HybridAutomaton] | None = None,
) -> hm.Composition:
    """Compose the agents of a scenario to one automaton, with laws of one's own where they are given.

    Parameters
    ----------
    scenario : Scenario
        Network, weights, switching and trigger.
    trigger : type or Trigger, optional
        A trigger law in place of the scenario's: a class of automata, see `OwnTrigger`, which also takes its numbers.
    weights : Waveform, sequence of Waveform or callable, optional
        Weights in place of the scenario's: one for all edges or one for each; a function of time in numpy style is a
        `FunctionWeight`.
    motion : type, optional
        How agents move, see `scenario_agents`.

    Raises
    ------
    ScenarioError
        If `scenario` is no scenario, such as the name of one, or one of the others is not what it must be.
    """
    require_scenario("closed_loop", scenario)
    if trigger is not None:
        own = trigger if isinstance(trigger, Trigger) else OwnTrigger(law=trigger)
        scenario = replace(scenario, trigger=own)
    if weights is not None:
        scenario = replace(scenario, weights=_own_weights(weights, len(scenario.network.edges)))
    return hm.Composition(scenario.name, scenario_agents(scenario, motion), broadcast_wires(scenario))


def _own_weights(given: Waveform | Sequence[Waveform] | TimeFunction, edges: int) -> Weights:
    one = FunctionWeight(given) if callable(given) else given
    waveforms = (one,) * edges if isinstance(one, Waveform) else tuple(one)
    if not all(isinstance(waveform, Waveform) for waveform in waveforms):
        raise ScenarioError(f"weights is {given!r}; give waveforms, such as SineWeight(...), or a function of time.")
    return Weights(waveforms)


def edges_of(scenario: Scenario, number: int) -> list[int]:
    """Return the edges of agent `number`, as indices from 0 into the network's list."""
    return scenario.network.edges_at[number - 1]


def other_end(scenario: Scenario, edge: int, number: int) -> int:
    """Return the agent at the other end of an edge of agent `number`."""
    first, second = scenario.network.edges[edge]
    return second if first == number else first


def agent_recipes(scenario: Scenario, number: int, motion: type[hm.HybridAutomaton] | None = None) -> dict[str, Recipe]:
    """What agent `number` is composed of: argument of `agent` -> what decides about that part, and what makes it."""
    edges, channel = edges_of(scenario, number), scenario.channel
    initial, gain = scenario.network.initial[number - 1], scenario.network.gain
    waveforms = tuple(scenario.weights.waveforms[k] for k in edges)
    trigger, switching = scenario.trigger, scenario.switching
    moves = motion or _motion(scenario)
    around = Surroundings(edges, waveforms, switching, gain)
    # Thresholds on the error alone know nothing of what is around.
    known = (edges, waveforms, switching, gain) if trigger.kind in _KNOW_MORE else ()
    return {
        "integrator": (
            (moves, len(edges), initial, gain),
            lambda: moves(degree=len(edges), x=initial, gain=gain),
        ),
        "weights": (waveforms, lambda: weights_block(waveforms)),
        "trigger": ((trigger, known), lambda: event_generator(trigger, around)),
        "switching": ((switching, edges), lambda: switching.automaton(edges)),
        "channel": ((channel, edges), lambda: _channel(scenario, number, edges)),
    }


def _motion(scenario: Scenario) -> type[hm.HybridAutomaton]:
    kind = ContinuousIntegrator if scenario.trigger.kind is TriggerKind.CONTINUOUS else Integrator
    size = scenario.network.size_beside_zeros
    return kind if size is None else of_size(kind, size)


def scenario_agent(scenario: Scenario, number: int, motion: type[hm.HybridAutomaton] | None = None) -> hm.Composition:
    """Make agent `number`, counted from 1; see `scenario_agents`."""
    recipes = agent_recipes(scenario, number, motion)
    return agent(agent_name(number), **{part: make() for part, (_, make) in recipes.items()})


def _channel(scenario: Scenario, number: int, edges: list[int]) -> hm.HybridAutomaton | None:
    channel = scenario.channel
    if channel.ideal or not edges:
        return None
    senders = [other_end(scenario, edge, number) for edge in edges]
    return LossyChannel(
        degree=len(edges),
        slots=channel.slots,
        delay=channel.delay,
        loss=channel.loss,
        random=link_seeds(channel.seed, number, senders),
    )
