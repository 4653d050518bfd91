"""Block diagrams by operators: against python-control, exact answers, and with jumps."""

import pickle

import control
import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import BouncingBall

T = 1.5


class Lag(hm.HybridAutomaton):
    """a y' = u - y."""

    u = hm.Input(0.0)
    a = hm.Parameter(1.0)
    y = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"y": (s.u - s.y) / s.a}


class Integrator(hm.HybridAutomaton):
    """y' = u."""

    u = hm.Input(0.0)
    y = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"y": s.u}


class Relay(hm.HybridAutomaton):
    """Turns its output round at +-0.1."""

    u = hm.Input(0.0)
    y = hm.DiscreteState(1.0, output=True)

    def jump_set(self, s):
        return -s.u * s.y - 0.1

    def jump_map(self, s):
        return {"y": -s.y}


P, Q, R = Lag("p", a=0.5), Lag("q", a=2.0), Lag("r")
G, H, K = control.tf([1], [0.5, 1]), control.tf([1], [2, 1]), control.tf([1], [1, 1])


def step(diagram, output):
    (entry,) = [v.name for v in diagram.variables if v.kind.value == "inputs"]
    return hm.simulate(diagram, T, inputs={entry: 1.0}, engine="python")[output][-1]


@pytest.mark.parametrize(
    ("diagram", "output", "system"),
    [
        (Q * P, "q.y", H * G),
        (R * Q * P, "r.y", K * H * G),
        (P + Q, "sum.y1", G + H),
        (P - Q, "sum.y1", G - H),
        (-(3.0 * P), "gain2.y1", -(3 * G)),
        (R * (P + Q) + P.__class__("s"), "sum2.y1", K * (G + H) + K),
        (hm.feedback("loop", P, Q), "p.y", control.feedback(G, H)),
        (hm.feedback("loop", P, Q, sign=0.5), "p.y", control.feedback(G, H, 0.5)),
        (hm.feedback("loop", Q * P, R), "q.y", control.feedback(H * G, K)),
        (hm.parallel("both", P, Q), "sum.y1", G + H),
        (hm.series("chain", P, Q), "q.y", H * G),
    ],
)
def test_step_responses_are_those_of_python_control(diagram, output, system):
    expected = control.step_response(control.ss(system), np.linspace(0.0, T, 7)).outputs[-1]
    # python-control steps with matrix exponentials; both are exact to rounding of values of size 1.
    assert step(diagram, output) == pytest.approx(expected, abs=1e-10)


def test_a_relay_keeps_its_events_in_a_diagram():
    """y' = -relay(y) turns at +-0.1: a triangle wave of slope 1, first turned at 0.1 s, then each 0.2 s."""
    loop = hm.feedback("loop", Integrator("plant"), Relay("relay"))
    arc = hm.simulate(loop, 1.0)
    assert arc.engine.startswith("native")
    assert arc.event_times("relay.jump") == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.9], abs=1e-12)
    assert repr(pickle.loads(pickle.dumps(loop))) == repr(loop)


def test_discrete_signals_stay_discrete():
    (out,) = [v for v in (Relay("a") + Relay("b")).variables if v.name == "sum.y1"]
    assert out.discrete
    (out,) = [v for v in (Relay("a") + Lag("b")).variables if v.name == "sum.y1"]
    assert not out.discrete


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Lag() * Lag(), r"^Lag\*Lag: two parts are called 'Lag': give each a name .* Lag\('left'\)"),
        (lambda: (Q * P) + P, r"two parts are called 'p'"),
        (lambda: BouncingBall() * P, r"p has the outputs p\.y and BouncingBall the inputs none.* hm\.series\('Bounc"),
        (lambda: hm.feedback("loop", P, Q, {"u": "y"}), r"^loop: name the wires both ways, measured and actuated"),
    ],
)
def test_what_cannot_be_joined(make, sentence):
    with pytest.raises(hm.WiringError, match=sentence):
        make()


def test_other_operands_are_left_to_python():
    for wrong in (lambda: P * 2, lambda: P + 1.0, lambda: [] - P):
        with pytest.raises(TypeError, match="unsupported operand"):
            wrong()
