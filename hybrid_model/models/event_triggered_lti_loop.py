"""A linear plant under state feedback that is updated by events only, and how far apart these are at least."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

import hybrid_model as hm
from hybrid_model.declare.variables import Value
from hybrid_model.models.sampled_lti_loop import LtiPlant


class EventTriggeredFeedback(hm.HybridAutomaton):
    """Holds ``u = K xhat`` and takes over a new state xhat when ``|xhat - x| >= sigma |x|``.

    The trigger of Tabuada (2007) for linear plants. The threshold is ``sigma |x|`` or `floor`, whichever is larger:
    without a floor the trigger would be ``0 >= 0`` at the origin and fire for ever (semantics: rule 8). With it the
    state ends in a ball whose radius is of the order of ``floor/sigma``. A larger threshold only puts events off, so
    `minimum_inter_event_time` holds with the floor too. The update at the start, ``xhat = x``, is not counted as an
    event.
    """

    order = hm.Dimension("order of the plant")
    channels = hm.Dimension("number of inputs of the plant")
    x = hm.Input(0.0, shape="order", description="state of the plant")
    xhat = hm.DiscreteState(0.0, shape="order", computed=True, output=True, description="state last taken over")
    events = hm.DiscreteState(0, integer=True, output=True, description="number of updates since the start")
    u = hm.Output(shape="channels", discrete=True, description="feedback held")
    K = hm.Parameter(0.0, shape=("channels", "order"), description="gain matrix")
    sigma = hm.Parameter(0.05, description="relative threshold")
    floor = hm.Parameter(1e-9, description="smallest threshold")
    updated = hm.Clock("update", description="ticks with each update")

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The first update."""
        return {"xhat": s.x}

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """The feedback law at the state last taken over."""
        return {"u": s.K @ s.xhat}

    def error_too_large(self, s: hm.Values) -> Value:
        """The trigger function."""
        threshold = np.maximum(s.sigma * np.linalg.norm(s.x), s.floor)
        return np.linalg.norm(s.xhat - s.x) - threshold

    def update(self, s: hm.Values) -> dict[str, Value]:
        """Take over the present state."""
        return {"xhat": s.x, "events": s.events + 1}

    transitions = (hm.Jump("update", error_too_large, update),)


class EventTriggeredLtiLoop(hm.Composition):
    """Event-triggered state feedback of a linear plant, with a guaranteed minimum inter-event time.

    P. Tabuada, "Event-triggered real-time scheduling of stabilizing control tasks", IEEE Trans. Automatic Control
    52(9), 2007: the plant, the gain and sigma of its example are the values below. Between two events the
    loop is affine, so the event times are exact by matrix exponentials.

    Parameters
    ----------
    name : str
        Name of the composition.
    A, B, K : array_like
        Shapes (n, n), (n, m) and (m, n); ``u = K xhat``.
    sigma : float
        Relative threshold.
    floor : float
        Smallest threshold, see `EventTriggeredFeedback`.
    start : array_like
        State at the start, shape (n,).
    """

    def __init__(
        self,
        name: str = "EventTriggeredLtiLoop",
        *,
        A: npt.ArrayLike = ((0.0, 1.0), (-2.0, 3.0)),
        B: npt.ArrayLike = ((0.0,), (1.0,)),
        K: npt.ArrayLike = ((1.0, -4.0),),
        sigma: float = 0.05,
        floor: float = 1e-9,
        start: npt.ArrayLike = (1.0, 0.0),
    ) -> None:
        parts = {
            "plant": LtiPlant(A=A, B=B, x=start),
            "feedback": EventTriggeredFeedback(K=K, sigma=sigma, floor=floor),
        }
        super().__init__(name, parts, {"feedback.x": "plant.x", "plant.u": "feedback.u"})


def minimum_inter_event_time(A: npt.ArrayLike, B: npt.ArrayLike, K: npt.ArrayLike, sigma: float) -> float:
    """Return Tabuada's lower bound on the time between two events of `EventTriggeredLtiLoop`.

    With ``e = xhat - x`` the loop is ``x' = (A + B K) x + B K e`` and ``e' = -x'``, so that ``|e|/|x|`` grows no faster
    than the solution of ``phi' = a + (a + b) phi + b phi^2``, ``phi(0) = 0``, with the spectral norms
    ``a = |A + B K|`` and ``b = |B K|`` (Tabuada 2007, the bound on inter-execution times of linear systems). The bound
    is the time at which phi reaches sigma: ``integral of dphi / ((1 + phi)(a + b phi)) over phi from 0 to sigma``.

    Parameters
    ----------
    A, B, K : array_like
        Shapes (n, n), (n, m) and (m, n).
    sigma : float
        Relative threshold, above zero.

    Returns
    -------
    float
        In s; infinite if neither the loop nor the error moves the plant.

    Raises
    ------
    DeclarationError
        If sigma is not above zero.
    """
    if not sigma > 0.0:
        raise hm.DeclarationError(f"the relative threshold sigma is {sigma}: give a number above zero.")
    feedback = np.asarray(B, dtype=np.float64) @ np.asarray(K, dtype=np.float64)
    loop, error = (float(np.linalg.norm(matrix, 2)) for matrix in (np.asarray(A) + feedback, feedback))
    if loop == 0.0:
        # phi = 0 is then a solution: without a push an error never begins.
        return float("inf")
    # By partial fractions log(1 + (a - b) q)/(a - b), here written so that a = b is no special difficulty.
    quotient = sigma / (loop + error * sigma)
    difference = loop - error
    return float(np.log1p(difference * quotient) / difference) if difference else quotient
