"""Parts whose rates are affine in what they hear: events against closed forms, over many receptions on one piece."""

import numpy as np
import pytest

import hybrid_model as hm


class Speaker(hm.HybridAutomaton):
    """Says another number at the times first + k period."""

    first = hm.Parameter(0.1)
    period = hm.Parameter(0.37)
    k = hm.DiscreteState(0.0)
    said = hm.DiscreteState(0.8, output=True)

    transitions = (
        hm.TimeEvent(
            "say",
            lambda self, s: s.first + s.k * s.period,
            lambda self, s: {"k": s.k + 1.0, "said": np.cos(2.0 * s.k + s.first)},
        ),
    )


class Walker(hm.HybridAutomaton):
    """x' = cos(w t) u + side v, where v changes sides at breakpoints; marks x wherever it has gone far enough."""

    x = hm.State(0.0, output=True)
    u = hm.Input(0.0, discrete=True)
    w = hm.Parameter(3.0)
    far = hm.Parameter(0.05)
    mark = hm.DiscreteState(0.0, output=True)
    side = hm.DiscreteState(1.0)
    turns = hm.DiscreteState(1.0)

    def flow_map(self, s):
        return {"x": np.cos(s.w * s.t) * (s.u - s.mark) + 0.1 * s.side}

    transitions = (
        hm.Jump("mark", lambda self, s: np.abs(s.x - s.mark) - s.far, lambda self, s: {"mark": s.x}),
        hm.TimeEvent(
            "turn",
            lambda self, s: 1.5 * s.turns,
            lambda self, s: {"side": -s.side, "turns": s.turns + 1.0},
            internal=True,
        ),
    )


def walked(w, heard, mark, x, a, b):
    """x at b, with nothing but breakpoints on the way from a."""
    turns = 1.5 * np.arange(1, 40)
    edges = np.concatenate([[a], turns[(turns > a) & (turns < b)], [b]])
    sides = (-1.0) ** np.floor(0.5 * (edges[1:] + edges[:-1]) / 1.5)
    return x + (heard - mark) * (np.sin(w * b) - np.sin(w * a)) / w + 0.1 * float(np.sum(sides * np.diff(edges)))


@pytest.mark.parametrize("w", [0.3, 3.0, 11.0])
def test_events_are_where_the_closed_form_has_them(w):
    """Each reception changes the rate; x is that of the integral, to some roundings, at each event."""
    end = 12.0
    parts = {"speaker": Speaker(), "walker": Walker(w=w)}
    network = hm.Composition("walk", parts, {"walker.u": "speaker.said"})
    run = hm.simulate_network(network, end, engine="native")
    t, x, mark, heard, marks = 0.0, 0.0, 0.0, 0.8, 0
    for part, jump in run.jumps:
        if jump.name == "turn":
            continue
        x, before = walked(w, heard, mark, x, t, jump.t), (t, x)
        if part == "speaker":
            heard = np.cos(2.0 * jump.z_before[0] + 0.1)
        else:
            assert abs(abs(x - mark) - 0.05) < 1e-12, jump.t
            between = np.linspace(before[0], jump.t, 50)[1:-1]
            assert all(abs(walked(w, heard, mark, before[1], before[0], s) - mark) < 0.05 for s in between)
            mark, marks = x, marks + 1
        t = jump.t
    assert marks > 10
    assert run.arcs["walker"].at("x", end) == pytest.approx(walked(w, heard, mark, x, t, end), abs=1e-12)


class Gated(hm.HybridAutomaton):
    """x' = side cos(w t) cos(tilt) (u - mark): what is in front of u changes with breakpoints and receptions."""

    x = hm.State(0.0, output=True)
    u = hm.Input(0.0, discrete=True)
    tilt = hm.Input(0.0, discrete=True)
    w = hm.Parameter(2.0)
    far = hm.Parameter(0.05)
    mark = hm.DiscreteState(0.0, output=True)
    side = hm.DiscreteState(1.0)
    turns = hm.DiscreteState(1.0)

    def flow_map(self, s):
        return {"x": s.side * np.cos(s.w * s.t) * np.cos(s.tilt) * (s.u - s.mark)}

    transitions = Walker.transitions


def test_functions_change_with_what_they_depend_on():
    """Three walkers share series as long as what these depend on is the same; x is that of the closed form."""
    end, names = 9.0, ("a", "b", "c")
    parts = {"speaker": Speaker(), "tilter": Speaker(first=0.25, period=0.81), **{name: Gated() for name in names}}
    wires = {**{f"{name}.u": "speaker.said" for name in names}, "b.tilt": "tilter.said", "c.tilt": "tilter.said"}
    run = hm.simulate_network(hm.Composition("gates", parts, wires), end, engine="native")
    said, since, x, mark = {"speaker": 0.8, "tilter": 0.8}, dict.fromkeys(names, 0.0), dict.fromkeys(names, 0.0), {}

    def go_on(name, t):
        tilt = 0.0 if name == "a" else said["tilter"]
        edges = np.concatenate([[since[name]], [s for s in 1.5 * np.arange(1, 7) if since[name] < s < t], [t]])
        sides = (-1.0) ** np.floor(0.5 * (edges[1:] + edges[:-1]) / 1.5)
        turned = float(np.sum(sides * np.diff(np.sin(2.0 * edges)))) / 2.0
        x[name] += np.cos(tilt) * (said["speaker"] - mark.get(name, 0.0)) * turned
        since[name] = t

    for part, jump in run.jumps:
        for name in names:
            go_on(name, jump.t)
        if jump.name == "say":
            said[part] = np.cos(2.0 * jump.z_before[0] + (0.1 if part == "speaker" else 0.25))
        elif jump.name == "mark":
            assert abs(abs(x[part] - mark.get(part, 0.0)) - 0.05) < 1e-12, jump.t
            mark[part] = x[part]
    assert len(mark) == 3
    for name in names:
        go_on(name, end)
        assert run.arcs[name].at("x", end) == pytest.approx(x[name], abs=1e-12)


class Pulsed(hm.HybridAutomaton):
    """Goes in one pulse, and hardly so before and after; marks x wherever it has gone far enough."""

    x = hm.State(0.0)
    u = hm.Input(0.0, discrete=True)
    mark = hm.DiscreteState(0.0)

    def flow_map(self, s):
        return {"x": s.u * np.where(np.abs(s.t - 41.0) < 2.0, 1.0, 1e-3)}

    transitions = (hm.Jump("mark", lambda self, s: np.abs(s.x - s.mark) - 0.05, lambda self, s: {"mark": s.x}),)


def test_a_pulse_between_the_coarse_nodes_of_a_piece_is_seen():
    """Functions are looked at on the fine nodes too before a series through the coarse ones is taken."""
    parts = {"speaker": Speaker(first=17.3, period=17.3), "walker": Pulsed()}
    network = hm.Composition("walk", parts, {"walker.u": "speaker.said"})
    found = hm.simulate_network(network, 100.0, engine="native").event_times("walker", "mark")
    together = hm.simulate(network, 100.0).event_times("walker.mark")
    assert len(found) > 20
    np.testing.assert_allclose(found, together, rtol=0, atol=1e-8)
