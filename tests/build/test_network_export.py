"""Networks as FMUs: the run, the size, and derivatives of a thousand agents in closed form."""

import zipfile

import fmpy
import networkx as nx
import numpy as np
import pytest
from fmpy.fmi3 import FMU3Slave

import hybrid_model as hm
from fmu.export import export_fmu
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.scenario.files import read_scenario
from hybrid_model.native.networks.network import worth_looping


def network(agents, weights="constant", seed=1):
    """Agents on a random graph of degree 4, with weights of their own; the scenario."""
    graph = nx.random_regular_graph(4, agents, seed=seed)
    edges = [[a + 1, b + 1] for a, b in graph.edges]
    rng = np.random.default_rng(seed)
    numbers = rng.uniform(0.1, 1.5, len(edges)).tolist()
    entries = {
        "name": f"network_{agents}_{weights}",
        "stop_time": 1.0,
        "network": {"agents": agents, "edges": edges, "initial": rng.uniform(-1.0, 1.0, agents).tolist()},
        "weights": {"kind": "constant", "value": numbers},
        "trigger": {"kind": "dynamic", "threshold": 0.1, "decay": 0.1},
    }
    if weights == "gated":
        duty = rng.uniform(20.0, 60.0, len(edges)).tolist()
        entries["weights"] = {"kind": "gated-sine", "gate_rate": 4.0, "sine_rate": 5.0, "duty_percent": duty}
        half = len(edges) // 2
        rows = [list(range(1, half + 1)), list(range(half + 1, len(edges) + 1))]
        entries["switching"] = {"dwell": 0.3, "active": rows}
    return read_scenario(entries)


class Listener(hm.HybridAutomaton):
    """Moves to what it hears, and sends its state where that has moved by a threshold."""

    heard = hm.Input(0.0, discrete=True)
    x = hm.State(0.0, output=True)
    sent = hm.DiscreteState(0.0, output=True, computed=True)

    def start_map(self, s):
        return {"sent": s.x}

    def flow_map(self, s):
        return {"x": s.heard - s.sent}

    transitions = (hm.Jump("send", lambda self, s: abs(s.x - s.sent) - 0.05, lambda self, s: {"sent": s.x}),)


@pytest.mark.parametrize(("weights", "fmi"), [("constant", "3.0"), ("gated", "2.0")])
def test_a_network_runs_like_the_whole(exported, weights, fmi):
    composition = closed_loop(network(14, weights))
    assert worth_looping(composition)
    end = 0.8
    arc = hm.simulate(composition, end)
    names = [f"agent{k}.{item}" for k in range(1, 15) for item in ("x", "broadcast", "events")]
    path = exported(composition, fmi=fmi)
    run = fmpy.simulate_fmu(
        str(path), stop_time=end, output_interval=end / 4, output=names, fmi_type="CoSimulation", validate=False
    )
    expected = [float(arc.at(name, end)) for name in names]
    assert sum(expected[2::3]) > 14
    # The limit of the repository for states in different executions; counts of broadcasts are equal.
    np.testing.assert_allclose([run[-1][name] for name in names], expected, rtol=0, atol=1e-8)
    assert [run[-1][name] for name in names[2::3]] == expected[2::3]


def test_copies_as_arrays_run_like_the_network_in_this_process(tmp_path):
    """A ring of 13 agents, each of which hears the one before it, and one that nobody hears."""
    start = np.random.default_rng(3).uniform(-1.0, 1.0, 14)
    links = np.arange(13), (np.arange(13) + 12) % 13
    copies = hm.Network("copies", Listener("listener"), links, {"heard": "sent"}, values={"x": start}, count=14)
    run = hm.simulate_network(copies, 2.0)
    path = export_fmu(copies, tmp_path / "copies.fmu", sources=False)
    names = [f"part{k}.x" for k in range(1, 15)]
    result = fmpy.simulate_fmu(str(path), stop_time=2.0, output=names, fmi_type="CoSimulation", validate=False)
    assert len(run.events) > 50
    np.testing.assert_allclose([result[-1][name] for name in names], run.final("x"), rtol=0, atol=1e-12)


def binary_size(path):
    with zipfile.ZipFile(path) as archive:
        return max(item.file_size for item in archive.infolist() if item.filename.startswith("binaries/"))


@pytest.mark.long
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_thousand_agents_in_less_than_two_megabytes(tmp_path, fmi):
    path = export_fmu(closed_loop(network(1000)), tmp_path / "network.fmu", fmi=fmi)
    assert binary_size(path) < 2_000_000


@pytest.mark.long
def test_rates_and_derivatives_of_a_thousand_agents(tmp_path):
    """x' = -k L x at the start, where all values have just been broadcast; its derivative by k is -L x."""
    scenario = network(1000)
    path = export_fmu(closed_loop(scenario), tmp_path / "network.fmu")
    description = fmpy.read_model_description(str(path))
    reference = {variable.name: variable.valueReference for variable in description.modelVariables}
    x = np.array(scenario.network.initial)
    expected = np.zeros(1000)
    for (a, b), waveform in zip(scenario.network.edges, scenario.weights.waveforms, strict=True):
        flow = waveform.level * (x[b - 1] - x[a - 1])
        expected[a - 1] += flow
        expected[b - 1] -= flow
    slave = FMU3Slave(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(path), str(tmp_path / "network")),
        modelIdentifier=description.coSimulation.modelIdentifier,
    )
    slave.instantiate(eventModeUsed=True)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    rates = [reference[f"der(agent{k}.x)"] for k in range(1, 1001)]
    # Sums of four products in another order.
    np.testing.assert_allclose(slave.getFloat64(rates), expected, rtol=0, atol=1e-14)
    gains = [reference[f"agent{k}.gain"] for k in range(1, 1001)]
    forward = slave.getDirectionalDerivative(rates, gains, np.ones(1000), 1000)
    np.testing.assert_allclose(forward, expected, rtol=0, atol=1e-14)
    adjoint = slave.getAdjointDerivative(rates, gains, np.ones(1000), 1000)
    np.testing.assert_allclose(adjoint, expected, rtol=0, atol=1e-14)
    slave.terminate()
    slave.freeInstance()
