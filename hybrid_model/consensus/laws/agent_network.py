"""The agents (paper, section 4) as a network that runs part by part: as arrays where they are copies of few agents."""

from __future__ import annotations

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.laws.channels import link_seeds
from hybrid_model.consensus.laws.closed_loop import closed_loop, scenario_agent
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import TriggerKind
from hybrid_model.consensus.switching.base import NoSwitching, masks
from hybrid_model.consensus.switching.cycle import SwitchingCycle
from hybrid_model.consensus.switching.sequence import SwitchingSequence
from hybrid_model.consensus.weights.edge_automata import EdgeAutomaton
from hybrid_model.declare.variables import FloatArray
from hybrid_model.schedule.links import Whole


def agent_network(scenario: Scenario) -> hm.Network | hm.Composition:
    """Return what `hm.simulate_network` runs for a scenario.

    Agents with equally many neighbours are copies where they differ in start values and in numbers of their edges
    alone, those of weights, of a switching topology and of a channel: then no object is made for any of them. With
    weights of several kinds, several functions of time, and tables whose rows do not begin together, the network is
    composed of its agents one by one.

    Parameters
    ----------
    scenario : Scenario
        Network, weights, switching and trigger.

    Raises
    ------
    ScenarioError
        As `closed_loop`, and for agents that see each other's states all the time: these do not meet at events alone.
    """
    if scenario.trigger.kind is TriggerKind.CONTINUOUS:
        raise ScenarioError(
            "[trigger] kind is 'continuous', so agents see each other's states all the time and cannot run apart: run "
            "the closed loop as one automaton."
        )
    if not _are_copies(scenario):
        return closed_loop(scenario)
    edges = np.array(scenario.network.edges, dtype=np.int64).reshape(-1, 2) - 1
    degrees = np.bincount(edges.ravel(), minlength=scenario.network.agents)

    def agent(degree: int) -> hm.Automaton:
        return scenario_agent(scenario, int(np.argmax(degrees == degree)) + 1)

    links = edges.ravel(), edges[:, ::-1].ravel()
    signals = {"neighbours": "broadcast"} | ({} if scenario.channel.ideal else {"sent": "events"})
    return hm.Network(
        scenario.name,
        agent,
        links,
        signals,
        values={"x": np.array(scenario.network.initial)},
        link_values=_numbers(scenario, *links),
        label="agent",
        count=scenario.network.agents,
    )


def _are_copies(scenario: Scenario) -> bool:
    waveforms = scenario.weights.waveforms
    return (
        isinstance(scenario.switching, (NoSwitching, SwitchingCycle, SwitchingSequence))
        and len({wave.automaton for wave in waveforms}) == 1
        and issubclass(waveforms[0].automaton, EdgeAutomaton)
        and waveforms[0].automaton.are_columns(waveforms)
    )


def _numbers(scenario: Scenario, receivers: Whole, senders: Whole) -> dict[str, FloatArray]:
    """Return the numbers of weights, switching and channel, one or one row for each link."""
    waveforms, switching, channel = scenario.weights.waveforms, scenario.switching, scenario.channel
    columns = waveforms[0].automaton.columns(waveforms).items()
    numbers = {name: np.repeat(np.moveaxis(column, -1, 0), 2, axis=0) for name, column in columns}
    found = {f"weights.{name}": column for name, column in numbers.items()}
    if isinstance(switching, (SwitchingCycle, SwitchingSequence)):
        active = np.array(masks(switching.active, range(len(waveforms))), dtype=np.float64)
        numbers["active"] = found["switching.active"] = np.repeat(active.T, 2, axis=0)
    if scenario.trigger.kind is TriggerKind.SELF_TRIGGERED:
        # The law knows the same of its edges, and in which graphs they are.
        found |= {f"trigger.{name}": column for name, column in numbers.items()}
    if not channel.ideal:
        pairs = zip((receivers + 1).tolist(), (senders + 1).tolist(), strict=True)
        seeds = [link_seeds(channel.seed, receiver, [sender])[0] for receiver, sender in pairs]
        found["channel.random"] = np.array(seeds, dtype=np.float64)
    return found
