"""One plant, two feedback laws, and a switch between them."""

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value
from hybrid_model.models.network_estimation import LinearProcess


class StaticFeedback(hm.HybridAutomaton):
    """A feedback law without memory: ``u = gain x``."""

    order = hm.Dimension("order of the plant")
    x = hm.Input(0.0, shape="order", description="state of the plant")
    u = hm.Output(description="feedback")
    gain = hm.Parameter(0.0, shape="order", description="gain row")

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """Evaluate the law."""
        return {"u": s.gain @ s.x}


class NormSwitch(hm.HybridAutomaton):
    """Passes on `u0` or `u1`: changes to 0 where ``|x| >= outer`` and to 1 where ``|x| <= inner``."""

    order = hm.Dimension("order of the plant")
    x = hm.Input(0.0, shape="order", description="state of the plant")
    u0 = hm.Input(0.0, description="feedback in state 0")
    u1 = hm.Input(0.0, description="feedback in state 1")
    u = hm.Output(description="feedback passed on")
    q = hm.DiscreteState(1, integer=True, output=True, description="number of the feedback in use, 0 or 1")
    inner = hm.Parameter(1.0, description="norm at which feedback 1 takes over")
    outer = hm.Parameter(3.0, description="norm at which feedback 0 takes over")
    to_0 = hm.Clock("use_0", description="ticks when feedback 0 takes over")
    to_1 = hm.Clock("use_1", description="ticks when feedback 1 takes over")

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """Choose."""
        return {"u": np.where(s.q > 0.5, s.u1, s.u0)}

    def far(self, s: hm.Values) -> Value:
        """Outside the outer circle with feedback 1."""
        return hm.least(s.x @ s.x - s.outer**2, s.q - 0.5)

    def near(self, s: hm.Values) -> Value:
        """Inside the inner circle with feedback 0."""
        return hm.least(s.inner**2 - s.x @ s.x, 0.5 - s.q)

    def use_0(self, s: hm.Values) -> dict[str, Value]:
        """Change to feedback 0."""
        return {"q": 0}

    def use_1(self, s: hm.Values) -> dict[str, Value]:
        """Change to feedback 1."""
        return {"q": 1}

    transitions = (hm.Jump("use_0", far, use_0), hm.Jump("use_1", near, use_1))


class SwitchedFeedback(hm.Composition):
    """A double integrator between a stabilising and a destabilising feedback, with hysteresis in the norm.

    The example "composite hybrid system with switched subsystem" of the HyEQ Toolbox, with its numbers: the state
    is drawn in to the circle of radius 1, thrown out to the circle of radius 3, and so on. Both loops are linear,
    so the switching times are exact by matrix exponentials.

    Parameters
    ----------
    name : str
        Name of the composition.
    start : sequence of float
        Position and velocity at the start.
    """

    def __init__(self, name: str = "SwitchedFeedback", *, start: tuple[float, float] = (10.0, 0.0)) -> None:
        parts = {
            "plant": LinearProcess(A=((0.0, 1.0), (0.0, 0.0)), B=(0.0, 1.0), M=(1.0, 0.0), x=start),
            "draw_in": StaticFeedback(gain=(-1.0, -1.0)),
            "throw_out": StaticFeedback(gain=(2.0, -1.0)),
            "switch": NormSwitch(order=2),
        }
        wires = {
            "draw_in.x": "plant.x",
            "throw_out.x": "plant.x",
            "switch.x": "plant.x",
            "switch.u0": "draw_in.u",
            "switch.u1": "throw_out.u",
            "plant.u": "switch.u",
        }
        super().__init__(name, parts, wires)
