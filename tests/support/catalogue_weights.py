"""Cases for the agreement test: every kind of weight and switching, as a block and in a closed loop."""

import numpy as np

from hybrid_model import consensus
from hybrid_model.consensus.laws.closed_loop import closed_loop, scenario_agents
from hybrid_model.consensus.scenario.definition import Scenario, Weights
from hybrid_model.consensus.scenario.files import read_scenario
from hybrid_model.consensus.switching.base import NoSwitching
from hybrid_model.consensus.switching.random_sequences import markov_sequence
from hybrid_model.consensus.switching.sequence import SequenceSwitching
from hybrid_model.consensus.weights.distances import distance_weights
from hybrid_model.consensus.weights.function import FunctionWeights
from hybrid_model.consensus.weights.kinds import weights_block
from hybrid_model.consensus.weights.piecewise import PiecewiseWeight
from hybrid_model.consensus.weights.sampled import SampledWeight
from hybrid_model.consensus.weights.tabulated import TabulatedWeights

RING = {"agents": 4, "edges": [[1, 2], [2, 3], [3, 4], [4, 1]], "initial": [1.0, 2.0, 0.3, 0.4]}
WEIGHTS = {
    "sine": {"kind": "sine", "mean": [0.5, 1.0, 0.7, 0.3], "depth": 0.9, "rate": [1.0, 2.0, 3.0, 1.5], "phase": 0.4},
    "square": {
        "kind": "square",
        "high": [2.0, 1.0, 1.5, 0.8],
        "low": 0.1,
        "gate_rate": [3.0, 2.0, 2.5, 4.0],
        "duty_percent": [30.0, 55.0, 40.0, 20.0],
        "phase": [0.0, 1.0, -0.5, 0.2],
    },
    "piecewise": {
        "kind": "piecewise",
        "starts": [0.0, 0.6, 1.1],
        "values": [[1.0, 0.0, 0.4], [0.2, 0.9, 0.0], [0.0, 0.5, 1.3], [0.7, 0.0, 0.8]],
        "cycle": 1.7,
    },
    "sampled": {
        "kind": "sampled",
        "times": [0.0, 1.0, 2.5, 4.0, 30.0],
        "values": [[0.2, 1.0, 0.0, 0.7, 0.1], [1.0, 0.0, 0.6, 0.2, 0.3], [0.4] * 5, [0.0, 0.9, 0.9, 0.0, 0.5]],
    },
}
SWITCHING = {
    "sequence": {"kind": "sequence", "dwell": [0.7, 1.3, 0.4], "active": [[1, 2], [3, 4], [2, 3, 4]], "repeat": True},
    "random_dwell": {
        "kind": "random-dwell",
        "active": [[1, 2], [2, 3], [3, 4]],
        "shortest": 0.3,
        "longest": 1.9,
        "seed": 20240601,
        "order": "random",
    },
    "markov": {
        "kind": "markov",
        "active": [[1, 2], [3, 4], []],
        "transition": [[0.2, 0.5, 0.3], [0.6, 0.3, 0.1], [0.5, 0.5, 0.0]],
        "shortest": 0.9,
        "seed": 7,
    },
    "jointly_connected": {"kind": "jointly-connected", "window": 2.1, "graphs": 3, "seed": 11},
}


def weights_cases(make_case):
    """Cases by name; `make_case` is the catalogue's ``Case``."""
    drifting = SampledWeight((-1.0, 0.5, 2.0, 6.0), (0.0, 1.0, 0.3, 2.0))
    shorter = SampledWeight((0.0, 0.8, 1.2), (0.5, 1.5, 0.2), repeat=True)
    steps = PiecewiseWeight((0.1, 0.7, 1.5), (1.0, 0.0, 2.0), cycle=1.8)
    found = {
        "square_weights": make_case(consensus.SquareWeights(high=[2.0, 1.0], low=0.3, duty_percent=[35.0, 100.0]), 5.0),
        "sine_weights": make_case(consensus.SineWeights(mean=[1.0, 2.0], depth=[0.5, 1.0], rate=[2.0, 3.0]), 5.0),
        "sampled_weights": make_case(weights_block([drifting, SampledWeight((0.0, 3.0, 6.0), (1.0, 0.0, 4.0))]), 5.0),
        "tables_of_two_periods": make_case(weights_block([shorter, steps]), 11.0),
        "tabulated_weights": make_case(
            TabulatedWeights(starts=[0.0, 1.1], values=[[1.0], [0.3]], slopes=[[2.0], [0.0]]), 3.0
        ),
        "function_weights": make_case(moving_agents_block(), 7.03),
        "function_without_kinks": make_case(FunctionWeights([lambda t: np.exp(-t) + 0.5]), 3.0),
        "sequence_switching": make_case(
            SequenceSwitching(starts=[0.0, 0.7, 1.0], active=[[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], raw=[2.0, 3.0]), 5.0
        ),
        "markov_block": make_case(
            markov_sequence(
                [[1], [2], [1, 2]],
                2,
                transition=[[0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.3, 0.3, 0.4]],
                shortest=0.2,
                longest=0.9,
                duration=5.0,
                seed=3,
                repeat=True,
            ).automaton([0, 1]),
            12.0,
        ),
    }
    for name, weights in WEIGHTS.items():
        found[f"ring_{name}"] = make_case(closed_loop(ring(weights=weights)), 6.03)
    for name, switching in SWITCHING.items():
        scenario = ring(switching=switching)
        found[f"ring_{name}"] = make_case(closed_loop(scenario), 6.03)
    found["agent1_sampled"] = make_case(
        scenario_agents(ring(weights=WEIGHTS["sampled"], switching=SWITCHING["sequence"]))["agent1"],
        12.0,
        {"neighbours[1]": ((2.0, 1.3), (7.5, 0.9)), "neighbours[2]": ((3.0, 0.6), (11.0, 1.0))},
    )
    found["moving_agents"] = make_case(closed_loop(moving_agents()), 6.03)
    return found


def ring(weights=None, switching=None):
    """Four agents in a ring."""
    entries = {
        "name": "ring",
        "stop_time": 12.0,
        "network": RING,
        "weights": weights or {"kind": "constant", "value": 0.6},
        "trigger": {"kind": "dynamic", "threshold": 0.2, "decay": 0.1},
    }
    return read_scenario(entries | ({"switching": switching} if switching else {}))


def circling(radius, rate, start):
    """A path around the origin."""
    return lambda t: (radius * np.cos(rate * t + start), radius * np.sin(rate * t + start))


def moving_weights():
    """Three agents on circles; the radio of each reaches 1.5 and its weight falls straight to zero there."""
    positions = [circling(1.0, 0.8, 0.0), circling(1.0, -0.8, 2.0), circling(0.4, 1.6, 1.0)]
    return distance_weights(
        [(1, 2), (2, 3), (3, 1)],
        positions,
        lambda d: 2.0 * np.maximum(1.5 - d, 0.0),
        bends=[1.5],
        horizon=20.0,
        period=2.5 * np.pi,
    )


def moving_agents():
    """The closed loop of three agents whose weights follow their distances."""
    base = read_scenario(
        {
            "name": "moving",
            "stop_time": 12.0,
            "network": {"agents": 3, "edges": [[1, 2], [2, 3], [3, 1]], "initial": [1.0, -1.0, 0.4]},
            "weights": {"kind": "constant", "value": 1.0},
            "trigger": {"kind": "dynamic", "threshold": 0.2, "decay": 0.1},
        }
    )
    return Scenario("moving", 12.0, base.network, Weights(moving_weights()), NoSwitching(3), base.trigger)


def moving_agents_block():
    """The weights of the first agent's two edges."""
    first, _, third = moving_weights()
    return weights_block([first, third])
