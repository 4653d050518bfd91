"""Small networks, their runs and their certificates, for the tests of bounds."""

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.certificates.certify import certify
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.scenario.files import read_scenario

CONSTANT = {"kind": "constant", "value": 1.0}


def network(edges, weights, *, agents=None, trigger=None, initial=None, stop_time=5.0, gain=1.0, **more):
    """A scenario; states from 1 down to -1 and a constant threshold of 0.3 unless given."""
    agents = agents or max(map(max, edges))
    return read_scenario(
        {
            "name": "test",
            "stop_time": stop_time,
            "network": {
                "agents": agents,
                "edges": edges,
                "initial": initial or np.linspace(1.0, -1.0, agents).tolist(),
                "gain": gain,
            },
            "weights": weights,
            "trigger": trigger or {"kind": "static", "threshold": 0.3},
            **more,
        }
    )


def path(agents):
    """Edges of the path."""
    return [[k, k + 1] for k in range(1, agents)]


def run_of(scenario):
    """The run of the closed loop."""
    return hm.simulate(closed_loop(scenario), scenario.stop_time)


def coarse(scenario, arc=None):
    """Certificates whose exact radius has four digits: quicker, for tests that need no more."""
    return certify(scenario, arc, resolution=0.05)


def failed(found):
    """Name -> detail of the hypotheses that do not hold."""
    return {checked.name: checked.detail for checked in found.hypotheses if not checked.holds}
