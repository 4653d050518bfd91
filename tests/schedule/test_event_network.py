"""Networks run part by part: the run of all parts together, at a cost per event that does not grow with the parts."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model import consensus
from hybrid_model.declare.transitions import Trigger
from hybrid_model.models import BouncingBall, FireflyNetwork

ENGINES = pytest.mark.parametrize("engine", ["native", "python"])


def compare(network, t_end, *, engine="native", atol=1e-9, **options):
    """Run a network in both ways and compare all jumps of all parts, and the states at many times."""
    apart = hm.simulate_network(network, t_end, engine=engine, **options)
    together = hm.simulate(network, t_end, **options)
    assert apart.engine.startswith(engine)
    assert apart.stop is together.stop
    for part, automaton in network.parts.items():
        own = [(info.name, f"{part}.{info.name}") for info in automaton.jumps]
        for name, scoped in own:
            assert apart.event_times(part, name) == pytest.approx(together.event_times(scoped), abs=atol)
        grid = np.linspace(0.0, together.t[-1], 97)
        for variable in automaton.variables:
            scoped = network.scoped_name(part, variable.name)
            if scoped not in [v.name for v in network.variables]:
                continue
            near_a_jump = np.min(np.abs(grid[:, None] - together.t[np.newaxis, together.t > 0]), axis=1) < 1e-7
            there = grid[~near_a_jump]
            assert apart.arcs[part].at(variable.name, there) == pytest.approx(together.at(scoped, there), abs=atol)
    return apart, together


@ENGINES
@pytest.mark.parametrize("kind", ["static", "dynamic"])
def test_the_papers_network(kind, engine):
    scenario = consensus.replace_trigger(consensus.load_scenario("paper-a"), kind)
    # Events near zero weight are ill conditioned: times to 1e-9 s there, states far better.
    compare(consensus.closed_loop(scenario), 3.0, engine=engine)


@ENGINES
def test_pulses_and_cascades_at_one_instant(engine):
    apart, together = compare(FireflyNetwork([0.13, 0.95, 0.62, 0.95]), 6.4, engine=engine)
    assert [jump.t for _, jump in apart.jumps] == pytest.approx([jump.t for jump in together.jumps], abs=1e-9)


def ring(count, **trigger):
    """A ring of agents with constant weights from reproducible starts."""
    rng = np.random.default_rng(7)
    return consensus.closed_loop(
        consensus.read_scenario(
            {
                "name": f"ring-{count}",
                "stop_time": 10.0,
                "network": {
                    "agents": count,
                    "edges": [[k, k % count + 1] for k in range(1, count + 1)],
                    "initial": list(rng.uniform(-1.0, 1.0, count)),
                },
                "weights": {"kind": "constant", "value": 1.0},
                "trigger": {"kind": "static", "threshold": 0.1, **trigger},
            }
        )
    )


@ENGINES
def test_a_ring_of_agents(engine):
    apart, _ = compare(ring(8), 5.0, engine=engine)
    assert len(apart.jumps) > 30


@ENGINES
def test_symmetric_agents_fire_together_in_the_order_of_the_parts(engine):
    network = consensus.closed_loop(
        consensus.read_scenario(
            {
                "name": "pair",
                "stop_time": 5.0,
                "network": {"agents": 2, "edges": [[1, 2]], "initial": [1.0, -1.0]},
                "weights": {"kind": "constant", "value": 1.0},
                "trigger": {"kind": "static", "threshold": 0.25},
            }
        )
    )
    apart, _ = compare(network, 3.0, engine=engine)
    parts = [part for part, jump in apart.jumps if jump.name == "trigger.broadcast"]
    assert parts == ["agent1", "agent2"] * (len(parts) // 2)


def cost_per_event(network, t_end, monkeypatch):
    evaluations = [0]
    rates = hm.declare.vector_form.VectorForm.rates

    def counted(self, *arguments):
        evaluations[0] += 1
        return rates(self, *arguments)

    monkeypatch.setattr(hm.declare.vector_form.VectorForm, "rates", counted)
    run = hm.simulate_network(network, t_end, engine="python")
    monkeypatch.undo()
    return evaluations[0] / len(run.jumps)


def test_cost_per_event_does_not_grow_with_the_number_of_parts(monkeypatch):
    """Derivatives of single agents for each event; the limit of the issue is twice, for 1000 agents against 10."""
    small = cost_per_event(ring(10), 1.0, monkeypatch)
    large = cost_per_event(ring(40), 1.0, monkeypatch)
    assert large <= 2.0 * small


@ENGINES
def test_a_part_whose_jumps_accumulate_ends_the_run_by_name(engine):
    network = hm.product("two", BouncingBall("slow", e=0.95), BouncingBall("fast"))
    run = hm.simulate_network(network, 9.0, engine=engine)
    assert run.stop is hm.Stop.ZENO
    assert "part fast" in run.message
    assert run.t == pytest.approx(2.558634, abs=1e-5)
    assert len(run.arcs["slow"].jumps) > 0


@ENGINES
def test_internal_breakpoints_are_in_the_arcs(engine):
    scenario = consensus.load_scenario("paper-a")
    network = consensus.closed_loop(scenario)
    run = hm.simulate_network(network, 4.0, engine=engine)
    for arc in run.arcs.values():
        times = [jump.t for jump in arc.jumps if jump.name == "weights.piece"]
        assert len(times) > 5
        assert all(info.trigger is Trigger.TIME for info in arc.automaton.jumps if info.internal)


@ENGINES
def test_each_part_has_a_hybrid_arc_that_verifies(engine):
    network = ring(5)
    run = hm.simulate_network(network, 4.0, engine=engine)
    for arc in run.arcs.values():
        report = hm.verify(arc.automaton, arc)
        assert report.ok, str(report)


def test_a_signal_that_flows_is_refused_with_its_wire():
    class Lag(hm.HybridAutomaton):
        u = hm.Input(0.0)
        y = hm.State(0.0, output=True)

        def flow_map(self, s):
            return {"y": s.u - s.y}

    network = hm.Composition("loop", {"a": Lag(), "b": Lag()}, {"a.u": "b.y"})
    with pytest.raises(hm.WiringError, match=r"b\.y -> a\.u carries a signal that changes along flows"):
        hm.simulate_network(network, 1.0)


@pytest.mark.parametrize(("start", "end"), [(0.0, np.nan), (1.0, 0.0), (np.inf, np.inf)])
def test_times_that_make_no_run_are_refused(start, end):
    with pytest.raises(hm.SimulationError, match="give finite times"):
        hm.simulate_network(ring(3), end, t_start=start)


def test_an_unknown_part_is_named():
    with pytest.raises(hm.WiringError, match="agent9"):
        hm.simulate_network(ring(3), 0.1).event_times("agent9", "trigger.broadcast")


@ENGINES
def test_what_a_jump_saw_is_what_had_arrived_before_it(tmp_path, engine):
    """At t = 1 the asker takes its input over and sends, and gets the answer at the same instant, after its jump."""

    class Asker(hm.HybridAutomaton):
        u = hm.Input(5.0, discrete=True)
        x = hm.State(0.0)
        sent = hm.DiscreteState(0.0, output=True)
        seen = hm.Output(discrete=True)

        def flow_map(self, s):
            return {"x": 1.0}

        def outputs(self, s):
            return {"seen": s.u}

        transitions = (hm.Jump("ask", lambda self, s: s.x - 1.0, lambda self, s: {"x": -s.u, "sent": s.sent + 1.0}),)

    class Answerer(hm.HybridAutomaton):
        u = hm.Input(0.0, discrete=True)
        answered = hm.DiscreteState(0.0)
        answer = hm.DiscreteState(5.0, output=True)

        transitions = (
            hm.Jump(
                "answer",
                lambda self, s: s.u - s.answered - 0.5,
                lambda self, s: {"answered": s.u, "answer": s.answer + 2.0},
            ),
        )

    network = hm.Composition(
        "talk", {"asker": Asker(), "answerer": Answerer()}, {"asker.u": "answerer.answer", "answerer.u": "asker.sent"}
    )
    arc = hm.simulate_network(network, 8.0, engine=engine).arcs["asker"]
    path = tmp_path / "asker.npz"
    arc.save(path)
    for found in (arc, hm.load_arc(path)):
        first = found.jumps[0]
        assert (found.before(first).u, found.after(first).u) == (5.0, 7.0)
        assert [float(found.at("seen", first.t, j=j)) for j in (0, 1)] == [5.0, 7.0]
    # x goes to -5 at t = 1, so the second question comes six seconds later and sees 7.
    assert [jump.t for jump in arc.jumps] == pytest.approx([1.0, 7.0], abs=1e-12)
    assert arc.jumps[1].x_after == pytest.approx([-7.0])
    assert hm.verify(network.parts["asker"], arc).ok
