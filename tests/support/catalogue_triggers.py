"""Trigger laws, channels and further agents of the consensus library, for the catalogue of models."""

from dataclasses import replace

from hybrid_model.consensus.laws.closed_loop import closed_loop, scenario_agents
from hybrid_model.consensus.laws.double_integrators import double_integrator_agents, double_integrator_loop
from hybrid_model.consensus.laws.vector_agents import vector_agents, vector_loop
from hybrid_model.consensus.scenario.channel import Channel
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind
from hybrid_model.consensus.weights.gated_sine import WeightMap

LAWS = {
    "mixed": Trigger(TriggerKind.MIXED, 0.3, 0.2, offset=0.1),
    "relative": Trigger(TriggerKind.RELATIVE, sigma=0.5, floor=1e-4, decay=0.1),
    "girard": Trigger(TriggerKind.GIRARD, sigma=0.5, theta=1.0, leak=0.3, reserve=0.25),
    "self_triggered": Trigger(TriggerKind.SELF_TRIGGERED, 0.5, 0.06),
    "sampled": Trigger(TriggerKind.SAMPLED, 0.4, 0.06, period=0.11),
    "periodic": Trigger(TriggerKind.PERIODIC, period=0.37),
}
"""Every law whose agents meet at events only, but for the paper's two."""

CHANNELS = {
    "delay": Channel(delay=0.03),
    "loss": Channel(delay=0.01, loss=0.4, seed=7),
    "instant_loss": Channel(loss=0.5),
}

RING = {
    "name": "ring",
    "stop_time": 5.03,
    "network": {"agents": 3, "edges": [[1, 2], [2, 3], [3, 1]], "initial": [1.0, -0.4, 0.3], "gain": 0.7},
    "weights": {"kind": "constant", "value": [1.0, 0.6, 0.3]},
    "trigger": {"kind": "static", "threshold": 0.1},
}
VELOCITIES = [0.2, -0.1, 0.3]
STARTS = [[1.0, 0.2], [-0.4, 0.5], [0.3, -0.7]]


def law_scenario(law, **changes):
    """The paper's network under one of `LAWS`."""
    return replace(load_scenario("paper-a"), name=f"paper_{law}", trigger=LAWS[law], **changes)


def absolute_self_triggered():
    """Self-triggered over the reading ``w = |g|``, whose pieces end at the sine's zeros too."""
    paper = law_scenario("self_triggered")
    waveforms = tuple(replace(waveform, map=WeightMap.ABS) for waveform in paper.weights.waveforms)
    return replace(paper, weights=replace(paper.weights, waveforms=waveforms))


def trigger_cases(case):
    """All cases by name, made by the catalogue's class; no event lies on one of the output points."""
    found = {}
    heard = {"neighbours[1]": ((2.0, 1.3), (7.5, 0.9)), "neighbours[2]": ((3.0, 0.6), (6.0, 1.0))}
    ring = read_scenario(RING)
    for law, trigger in LAWS.items():
        found[f"ring_{law}"] = case(closed_loop(replace(ring, trigger=trigger)), 5.03)
        found[f"agent2_{law}"] = case(scenario_agents(law_scenario(law))["agent2"], 9.07, heard)
    found["ring_continuous"] = case(closed_loop(replace(ring, trigger=Trigger(TriggerKind.CONTINUOUS))), 5.03)
    found["absolute_self_triggered"] = case(scenario_agents(absolute_self_triggered())["agent2"], 9.07, heard)
    sines = {"kind": "sine", "mean": [1.0, 0.6, 0.3], "depth": 0.9, "rate": 3.0, "phase": [0.0, 1.0, 2.0]}
    swinging = replace(read_scenario({**RING, "weights": sines}), trigger=LAWS["self_triggered"])
    found["agent1_sine_self_triggered"] = case(scenario_agents(swinging)["agent1"], 5.03, heard)
    for name, channel in CHANNELS.items():
        found[f"ring_{name}"] = case(closed_loop(replace(ring, channel=channel)), 5.03)
    found["ring_agent1_loss"] = case(
        scenario_agents(replace(ring, channel=CHANNELS["loss"]))["agent1"],
        2.53,
        {
            "neighbours[1]": ((0.3, 0.1), (0.9, -0.2), (1.4, 0.3), (2.2, 0.1)),
            "sent[1]": ((0.3, 1.0), (0.9, 2.0), (1.4, 3.0), (2.2, 4.0)),
            "neighbours[2]": ((0.3, 0.0), (1.7, 0.7)),
            "sent[2]": ((0.3, 1.0), (1.7, 2.0)),
        },
    )
    found["double_integrators"] = case(double_integrator_loop(ring, VELOCITIES, 1.5), 5.03)
    found["double_integrator_agent"] = case(
        double_integrator_agents(ring, VELOCITIES, 1.5)["agent1"],
        5.03,
        {"positions[1]": ((0.7, 0.4),), "velocities[1]": ((0.7, 0.1),), "times[1]": ((0.7, 0.7),)},
    )
    found["vector_agents"] = case(vector_loop(ring, STARTS), 5.03)
    found["vector_agent"] = case(vector_agents(ring, STARTS)["agent1"], 5.03, {"neighbours[1,2]": ((0.7, 0.4),)})
    return found
