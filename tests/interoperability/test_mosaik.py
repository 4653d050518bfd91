"""Our systems in scenarios of mosaik: in its process, and over TCP on loopback."""

import sys

import numpy as np
import pytest

import hybrid_model as hm
from cosim.consensus import in_process_system
from cosim.masters import run_event_exact
from hybrid_model.consensus.scenario.files import load_scenario

mosaik = pytest.importorskip("mosaik", reason="mosaik is not installed: pip install -e .[interop]")
api = pytest.importorskip("mosaik_api_v3")

COMMAND = {"cmd": f"{sys.executable} -m cosim.distributed %(addr)s"}
OURS = {"python": "cosim.distributed.mosaik_simulator:SystemSimulator"}


class Fills(hm.HybridAutomaton):
    """A tank that is filled at a given rate, and emptied when it is full."""

    rate = hm.Input(0.0, discrete=True)
    level = hm.State(0.0, output=True)
    emptied = hm.DiscreteState(0, output=True)
    full = hm.Parameter(1.0, tunable=True)

    def flow_map(self, s):
        return {"level": s.rate}

    def jump_set(self, s):
        return s.level - s.full

    def jump_map(self, s):
        return {"level": 0.0, "emptied": s.emptied + 1}


class Other(api.Simulator):
    """Somebody else's simulator: it gives a rate, 0.5 until 4 s and 1.0 from then on, and hears all it is told."""

    def __init__(self):
        models = {"Valve": {"public": True, "params": [], "attrs": ["rate"]}}
        models["Log"] = {"public": True, "params": [], "attrs": [], "any_inputs": True}
        super().__init__({"api_version": "3.0", "type": "time-based", "models": models})
        self.heard, self.time = [], 0

    def init(self, sid, time_resolution=1.0):
        self.resolution = time_resolution
        return self.meta

    def create(self, num, model):
        return [{"eid": model, "type": model}]

    def step(self, time, inputs, max_advance):
        self.time = time * self.resolution
        given = {n: next(iter(s.values())) for n, s in inputs.get("Log", {}).items()}
        type(self).rows.append((self.time, given))
        return time + round(0.5 / self.resolution)

    def get_data(self, outputs):
        return {"Valve": {"rate": 0.5 if self.time < 4.0 else 1.0}}


def run(world, connect, until):
    Other.rows = []
    try:
        connect(world.start("Other"))
        world.run(until=until, print_progress=False)
    finally:
        world.shutdown()
    return Other.rows


@pytest.mark.parametrize("how", [OURS, COMMAND])
def test_an_fmu_in_a_scenario_is_filled_by_somebody_else(how, exported):
    """Level and number of times that it was emptied, by hand; the events at 2, 4, 5, 6 ... s are on the way."""
    path = str(exported(Fills(), "fills"))
    world = mosaik.World({"Ours": how, "Other": {"python": f"{__name__}:Other"}}, time_resolution=0.25)

    def connect(other):
        tank = world.start("Ours", source=path, step=0.5, stop_time=20.0).System(start={"fills.level": 0.1}).children[0]
        world.connect(other.Valve(), tank, "rate")
        world.connect(
            tank, other.Log(), "level", "emptied", time_shifted=True, initial_data={"level": 0.1, "emptied": 0}
        )

    rows = run(world, connect, 33)
    for t, given in rows[2:]:
        before = t - 0.5  # what was heard is of the step before
        filled = 0.1 + 0.5 * min(before, 4.0) + max(before - 4.0, 0.0)
        assert given["emptied"] == int(filled + 1e-9)
        assert given["level"] == pytest.approx(filled - int(filled + 1e-9), abs=1e-9)


def test_the_agents_of_a_scenario_are_entities():
    """Their broadcasts reach each other event-exactly, whatever mosaik's steps are."""
    scenario = load_scenario("paper-a-static")
    expected = run_event_exact(in_process_system(scenario), 10.0, output_interval=0.5)
    world = mosaik.World({"Ours": OURS, "Other": {"python": f"{__name__}:Other"}}, time_resolution=0.5)

    def connect(other):
        agents = world.start("Ours", source="paper-a-static").System().children
        assert [agent.type for agent in agents] == ["agent1", "agent2", "agent3", "agent4"]
        world.connect(agents[0], other.Log(), "x", "events")

    rows = run(world, connect, 21)
    np.testing.assert_allclose([given["x"] for _, given in rows], expected.signals["agent1.x"], atol=1e-12)
    assert [given["events"] for _, given in rows] == expected.signals["agent1.events"]
