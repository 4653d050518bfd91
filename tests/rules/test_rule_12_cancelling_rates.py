"""Rule 12: states at rounding level, whose rates are sums of large terms that cancel, neither creep nor chatter."""

import networkx as nx
import numpy as np
import pytest

import hybrid_model as hm


class Between(hm.HybridAutomaton):
    """A state between two neighbours on both sides of zero: the terms of its rate are of order one."""

    x = hm.State(1e-17, output=True)
    left = hm.Input(np.cos(0.25 * np.pi))
    right = hm.Input(np.cos(0.75 * np.pi))

    def flow_map(self, s):
        weight = 1.0 + 0.5 * np.sin(2.0 * s.t)
        return {"x": weight * (s.left - s.x) + weight * (s.right - s.x)}


class Held(Between):
    """The same about a value held since the last broadcast: no rate depends on the state."""

    held = hm.DiscreteState(0.3)

    def flow_map(self, s):
        weight = 1.0 + 0.5 * np.sin(2.0 * s.t)
        return {"x": weight * (s.left - s.held) + weight * (s.right + s.held)}


class Stiff(Between):
    """The same with a thousand times the weight, and declared stiff."""

    stiff = True

    def flow_map(self, s):
        weight = 1e3 * (1.0 + 0.5 * np.sin(2.0 * s.t))
        return {"x": weight * (s.left - s.x) + weight * (s.right - s.x)}


class Waves(hm.HybridAutomaton):
    """The terms of its rate depend on time alone: nothing that could be moved shows by slopes how large they are."""

    size, turn = 1000.0, 1.0
    x = hm.State(1e-17, output=True)

    def flow_map(self, s):
        double = self.size * (np.sin(2.0 * self.turn * s.t) + np.cos(s.t))
        product = 2.0 * np.sin(self.turn * s.t) * np.cos(self.turn * s.t)
        return {"x": double - self.size * product - self.size * np.cos(s.t) - 1e-3 * s.x}


class Crossing(hm.HybridAutomaton):
    """x = cos(3 t) / 1000 passes zero; its rate is a sum of terms a thousand times as large, which cancel."""

    x = hm.State(1e-3, output=True)
    big = hm.Input(1.0)
    crossed = hm.DiscreteState(0.0)

    def flow_map(self, s):
        terms = s.big * np.cos(2.0 * s.t) + s.big * np.sin(s.t)
        return {"x": terms - 3e-3 * np.sin(3.0 * s.t) - terms}

    transitions = (
        hm.Jump("down", lambda self, s: np.where(s.crossed == 0.0, -s.x, -1.0), lambda self, s: {"crossed": 1.0}),
    )


@pytest.mark.parametrize("kind", [Between, Held, Stiff])
def test_a_state_at_rounding_level_between_neighbours_on_both_sides_runs_on(kind):
    solver = hm.Solver(method="Radau") if kind is Stiff else hm.Solver()
    arc = hm.simulate(kind(), 10.0, solver=solver)
    assert arc.stop is hm.Stop.HORIZON
    # Rates are wrong by a few 1e-16, and steps by the 64 roundings of rates that they are allowed.
    assert abs(arc.at("x", 10.0)) < 2e-14


@pytest.mark.parametrize(("size", "turn"), [(0.5, 7.6), (36.0, 7.62), (56.0, 0.51), (585.0, 4.44)])
def test_terms_of_time_alone_that_cancel_let_a_state_at_rounding_level_run_on(size, turn):
    """They crept, since a few points often have one rounding."""
    kind = type("Waves", (Waves,), {"size": size, "turn": turn})
    arc = hm.simulate(kind(), 10.0, engine="native")
    assert arc.stop is hm.Stop.HORIZON
    # Each rate is wrong by some roundings of its terms, which no more than add up.
    assert abs(arc.at("x", 10.0)) < 10.0 * 4.0 * size * np.finfo(float).eps


@pytest.mark.parametrize("level", [0.0, 1e-17, 1e-16])
def test_a_state_that_passes_zero_keeps_its_digits_where_large_terms_cancel(level):
    arc = hm.simulate(Crossing(x=1e-3 + level), 2.0 * np.pi)
    (jump,) = arc.jumps
    # Rates of 3e-3 are rounded as their terms are, to some 1e-16.
    assert jump.t == pytest.approx(np.pi / 6.0, rel=0, abs=1e-12)
    times = np.linspace(0.0, 2.0 * np.pi, 50)
    np.testing.assert_allclose([arc.at("x", t) for t in times], 1e-3 * np.cos(3.0 * times), rtol=0, atol=3e-15)


class Agent(hm.HybridAutomaton):
    """Goes where its neighbours are, as far as they have said, and says where it is when that has changed."""

    degree = hm.Dimension()
    heard = hm.Input(0.0, shape="degree", discrete=True)
    x = hm.State(0.0, output=True)
    sent = hm.DiscreteState(0.0, output=True, computed=True)

    def start_map(self, s):
        return {"sent": s.x}

    def flow_map(self, s):
        weight = 1.0 + 0.5 * np.sin(2.0 * s.t)
        return {"x": np.sum(weight * (s.heard - s.sent))}

    transitions = (hm.Jump("send", lambda self, s: abs(s.x - s.sent) - 0.05, lambda self, s: {"sent": s.x}),)


@pytest.mark.parametrize(
    ("scheduler", "agents", "t_end"), [("native", 8, 5.0), ("native", 60, 5.0), ("python", 4, 0.1)]
)
def test_a_ring_that_starts_on_a_cosine_runs_on(scheduler, agents, t_end):
    initial = np.cos(2.0 * np.pi * np.arange(agents) / agents)
    ring = nx.cycle_graph(agents)

    def events(start):
        network = hm.Network("ring", lambda degree: Agent(degree=degree), ring, {"heard": "sent"}, values={"x": start})
        run = hm.simulate_network(network, t_end, engine=scheduler)
        assert run.stop is hm.Stop.HORIZON
        return np.sort(run.events.t)

    assert 0.0 < np.abs(initial).min() < 1e-15
    found = events(initial)
    assert len(found) > 4
    # The same ring about another mean has no small states; agents that are mirror images broadcast together.
    np.testing.assert_allclose(found, events(0.37 + initial), rtol=0, atol=1e-9)


class Gated(hm.HybridAutomaton):
    """A rate that jumps where sin(w t) changes sign: time and the parameter move the gate alike."""

    x = hm.State(0.0, output=True)
    w = hm.Parameter(7.3)

    def flow_map(self, s):
        return {"x": np.where(np.sin(s.w * s.t) > 0.0, 0.7, -0.4)}


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_gate_that_a_parameter_moves_is_no_rounding(engine):
    """Steps across jumps of the rates, taken for rounding, were off by 2e-8."""
    w, end = 7.3, 4.0
    arc = hm.simulate(Gated(), end, engine=engine)
    edges = np.append(np.arange(0.0, end, np.pi / w), end)
    rates = np.where(np.sin(0.5 * w * (edges[1:] + edges[:-1])) > 0.0, 0.7, -0.4)
    exact = np.concatenate([[0.0], np.cumsum(rates * np.diff(edges))])
    np.testing.assert_allclose(arc.at("x", edges), exact, rtol=0, atol=2e-11)
