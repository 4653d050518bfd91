"""A linear plant under sampled state feedback."""

from __future__ import annotations

import numpy.typing as npt

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class LtiPlant(hm.HybridAutomaton):
    """A linear time-invariant plant, ``x' = A x + B u``, whose state is measured."""

    order = hm.Dimension("order of the plant")
    channels = hm.Dimension("number of inputs")
    x = hm.State(0.0, shape="order", output=True, description="state")
    u = hm.Input(0.0, shape="channels", description="control input")
    A = hm.Parameter(0.0, shape=("order", "order"), description="system matrix")
    B = hm.Parameter(0.0, shape=("order", "channels"), description="input matrix")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Linear dynamics."""
        return {"x": s.A @ s.x + s.B @ s.u}


class SampledFeedback(hm.HybridAutomaton):
    """Samples the state every `period` and holds ``u = K x`` in between.

    Samples are taken at ``k period``, computed from the index k, the first at time 0.
    """

    order = hm.Dimension("order of the plant")
    channels = hm.Dimension("number of inputs of the plant")
    x = hm.Input(0.0, shape="order", description="state of the plant")
    u = hm.DiscreteState(0.0, shape="channels", output=True, description="feedback held")
    k = hm.DiscreteState(0, integer=True, output=True, description="number of samples taken")
    K = hm.Parameter(0.0, shape=("channels", "order"), description="gain matrix")
    period = hm.Parameter(0.1, unit="s", description="time between samples")
    sampled = hm.Clock("sample", description="ticks with each sample")

    def next_time(self, s: hm.Values) -> Value:
        """Time of the next sample."""
        return s.k * s.period

    def take(self, s: hm.Values) -> dict[str, Value]:
        """Sample the state and hold the feedback."""
        return {"u": s.K @ s.x, "k": s.k + 1}

    transitions = (hm.TimeEvent("sample", next_time, take),)


class SampledLtiLoop(hm.Composition):
    """Sample-and-hold state feedback of a linear plant: ``x' = A x + B u``, ``u = K x`` at the last sample.

    The zero-order hold between a continuous plant and a static controller. At the samples the loop is the
    discrete-time system ``x[k+1] = (Ad + Bd K) x[k]`` with ``Ad = exp(A period)`` and
    ``Bd = integral of exp(A s) B over s from 0 to period`` (Astrom and Wittenmark, Computer-Controlled Systems,
    3rd ed., section 2.3). The values below are a double integrator with poles of the sampled loop in the unit circle.

    Parameters
    ----------
    name : str
        Name of the composition.
    A, B, K : array_like
        Shapes (n, n), (n, m) and (m, n).
    period : float
        Time between samples in s.
    start : array_like
        State at the start, shape (n,).
    """

    def __init__(
        self,
        name: str = "SampledLtiLoop",
        *,
        A: npt.ArrayLike = ((0.0, 1.0), (0.0, 0.0)),
        B: npt.ArrayLike = ((0.0,), (1.0,)),
        K: npt.ArrayLike = ((-1.0, -1.5),),
        period: float = 0.5,
        start: npt.ArrayLike = (1.0, 0.0),
    ) -> None:
        parts = {"plant": LtiPlant(A=A, B=B, x=start), "feedback": SampledFeedback(K=K, period=period)}
        super().__init__(name, parts, {"feedback.x": "plant.x", "plant.u": "feedback.u"})
