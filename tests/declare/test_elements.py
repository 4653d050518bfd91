"""``v[1]`` names one scalar of an array wherever an array has a name."""

import numpy as np
import pytest

import hybrid_model as hm


class Pair(hm.HybridAutomaton):
    """v' = -v + u, and m grows by m[1,2]."""

    u = hm.Input([0.0, 0.0])
    v = hm.State([1.0, 2.0], output=True)
    m = hm.State([[1.0, 2.0], [3.0, 4.0]])
    y = hm.Output(shape=2)

    def flow_map(self, s):
        return {"v": -s.v + s.u, "m": 0.0 * s.m + s["m[1,2]"]}

    def outputs(self, s):
        return {"y": 2.0 * s.v}


ENGINES = pytest.mark.parametrize("engine", ["native", "python"])


@ENGINES
def test_starts_inputs_and_ends(engine):
    wave = hm.Signal(lambda t: 0.0 if t < 0.5 else 1.0, [0.5])
    arc = hm.simulate(Pair(**{"v[2]": 5.0}), 1.0, starts={"v[1]": 3.0}, inputs={"u[2]": wave}, engine=engine)
    assert arc.end["v[1]"] == pytest.approx(3.0 * np.exp(-1.0), abs=1e-12)
    assert arc.end["v[2]"] == pytest.approx(5.0 * np.exp(-1.0) + 1.0 - np.exp(-0.5), abs=1e-12)
    # m[1,2] grows e-fold, and all others grow by as much as it does.
    np.testing.assert_allclose(arc.end["m"], np.array([[1, 2], [3, 4]]) + 2.0 * np.expm1(1.0), atol=1e-11)


@ENGINES
def test_an_element_that_follows_time(engine):
    arc = hm.simulate(Pair(), 1.0, inputs={"u[1]": np.cos, "u[2]": 2.0}, engine=engine)
    # v' = -v + cos t: v = (cos t + sin t)/2 + c exp(-t), c = 1/2; the other stays at 2.
    assert arc.end["v"] == pytest.approx([(np.cos(1.0) + np.sin(1.0) + np.exp(-1.0)) / 2.0, 2.0], abs=1e-11)


@ENGINES
@pytest.mark.parametrize("wires", [{"b.u": ["a.y[2]", "a.v[1]"]}, {"b.u[2]": "a.v[1]", "b.u[1]": "a.y[2]"}])
def test_wires(wires, engine):
    both = hm.Composition("both", {"a": Pair(), "b": Pair()}, wires)
    assert [str(wire) for wire in both.wires] == ["a.y[2] -> b.u[1]", "a.v[1] -> b.u[2]"]
    # v' = -v + k exp(-t), k = 4 and 1: (v0 + k t) exp(-t).
    arc = hm.simulate(both, 1.0, engine=engine)
    assert arc.end["b.v"] == pytest.approx([5.0 * np.exp(-1.0), 3.0 * np.exp(-1.0)], abs=1e-12)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (lambda: Pair(**{"v[3]": 1.0}), r"^Pair has no v\[3\]: v is an array of v\[1\] to v\[2\]\.$"),
        (lambda: Pair(**{"v[0]": 1.0}), r"^Pair has no v\[0\]"),
        (lambda: Pair(**{"w[1]": 1.0}), r"^Pair has nothing named 'w' to set"),
        (lambda: Pair(**{"v[1]": [1.0, 2.0]}), r"^Pair\.v = .* is not a number or an array of numbers"),
        (lambda: Pair(v=[1.0, 2.0], **{"v[1]": 1.0}), r"^Pair: v is given as a whole and as v\[1\]: leave one"),
        (lambda: hm.simulate(Pair(), 1.0, starts={"m[1]": 0.0}), r"^Pair has no m\[1\]: m is an array of m\[1,1\] to"),
        (lambda: hm.simulate(Pair(), 1.0, inputs={"u[4]": 0.0}), r"has no u\[4\]: u is an array of u\[1\] to u\[2\]"),
        (lambda: hm.simulate(Pair(), 1.0).end["v[3]"], r"^Pair has no v\[3\]: v is an array"),
        (lambda: hm.simulate(Pair(), 1.0).end["t[1]"], r"^Pair has no t\[1\]: t is a scalar"),
        (lambda: hm.Composition("c", {"a": Pair(), "b": Pair()}, {"b.u[1]": "a.v[1]"}), r"connect each element"),
        (
            lambda: hm.Composition("c", {"a": Pair(), "b": Pair()}, {"b.u": ["a.v[1]", "a.v[3]"]}),
            r"no a\.v\[3\]: a\.v is",
        ),
    ],
)
def test_elements_that_are_not_there(wrong, sentence):
    with pytest.raises((hm.DeclarationError, hm.WiringError), match=sentence):
        wrong()


def test_a_network_in_which_elements_are_wired():
    class Sender(hm.HybridAutomaton):
        sent = hm.DiscreteState([0.0, 0.0], output=True)
        transitions = hm.TimeEvent("tick", lambda self, s: 0.25 + s.sent[0], lambda self, s: {"sent": s.sent + 1.0})

    class Receiver(hm.HybridAutomaton):
        u = hm.Input([0.0, 0.0], discrete=True)
        x = hm.State([0.0, 0.0], output=True)

        def flow_map(self, s):
            return {"x": s.u}

    net = hm.Composition("net", {"s": Sender(sent=[0.0, 5.0]), "r": Receiver()}, {"r.u": ["s.sent[2]", "s.sent[1]"]})
    run = hm.simulate_network(net, 1.0)
    # 5 up to 0.25 s and 6 from then on; 0, then 1.
    assert run.arcs["r"].end["x"] == pytest.approx([0.25 * 5.0 + 0.75 * 6.0, 0.75], abs=1e-12)
