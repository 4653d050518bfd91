"""Triggers that compare the error with the disagreement which the agent sees in the broadcast values.

With ``V = |x - mean(x)|**2/2``, ``e = xhat - x``, ``l_ii = sum_j w_ij`` and
``q_i = 1/2 sum_j w_ij (xhat_j - xhat_i)**2`` the consensus protocol gives, for undirected weights that may vary in
time, ``V' <= -k sum_i (q_i/2 - l_ii e_i**2)`` (audit, section 11.4). Both laws keep ``l_ii e_i**2`` below a share
of ``q_i/2``. They hear the neighbours' broadcasts and know the weights of their own edges at the present time; nothing
is measured at the neighbours between events.

An agent may fire at the very instant of a neighbour's broadcast, which lowers its ``q_i``. It fires at most once at an
instant: its error is then zero, and both conditions are false with room to spare.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.laws.threshold_triggers import EventGenerator
from hybrid_model.consensus.scenario.trigger import Threshold
from hybrid_model.declare.variables import Value


class NeighbourhoodTrigger(EventGenerator):
    """What the relative laws have in common: the neighbours' broadcasts, the weights, and the two terms of ``V'``."""

    degree = hm.Dimension("number of neighbours")
    neighbours = hm.Input(0.0, shape="degree", discrete=True, description="broadcast values of the neighbours")
    weights = hm.Input(0.0, shape="degree", unit="1/s", description="weights of the edges to the neighbours")
    sigma = hm.Parameter(0.5, description="share of the disagreement that the error may use up, below 1")

    def excess(self, s: hm.Values) -> Value:
        """``l_ii e_i**2 - sigma q_i/2``: by how much the error uses up more than its share."""
        disagreement = 0.5 * np.sum(s.weights * (s.neighbours - s.broadcast) ** 2)
        return np.sum(s.weights) * (s.broadcast - s.x) ** 2 - 0.5 * s.sigma * disagreement

    @abstractmethod
    def error_too_large(self, s: hm.Values) -> Value:
        """The trigger function."""


class RelativeTrigger(NeighbourhoodTrigger):
    """Broadcasts when ``l_ii e_i**2 >= sigma q_i/2 + floor exp(-decay t)``.

    The law is ``e_i**2 > sigma/(2 l_ii) q_i`` of X. Yi, K. Liu, D. V. Dimarogonas, K. H. Johansson (arXiv:1704.05434),
    which carries over to time-varying weights verbatim (audit, section 11.4). Multiplied by ``l_ii`` it is defined
    while no edge carries weight. At consensus, and while no edge carries weight, it reads ``0 > 0``; the positive floor
    keeps the closed jump set, which contains the equality, away from there: ``0 >= floor`` is false.

    With the floor ``V' <= -k (1 - sigma)/2 sum_i q_i + k n floor exp(-decay t)``: with a decay the disturbance has the
    finite integral ``k n floor/decay``, and consensus is reached; without, a ball whose radius goes with the floor's
    square root.
    """

    floor = hm.Parameter(1e-6, unit="1/s", description="what the threshold never falls below, in the state's unit^2/s")
    decay = hm.Parameter(0.0, unit="1/s", description="rate at which the floor decays")

    def error_too_large(self, s: hm.Values) -> Value:
        """The trigger function."""
        return self.excess(s) - Threshold(s.floor, s.decay).at(s.t)

    transitions = (hm.Jump("broadcast", error_too_large, EventGenerator.send),)


class GirardTrigger(NeighbourhoodTrigger):
    """Dynamic triggering: an internal variable saves what the error leaves unused, and the error may draw on it.

    ``eta' = -leak eta + k (sigma q_i/2 - l_ii e_i**2)``, a broadcast when ``theta (l_ii e_i**2 - sigma q_i/2) >= eta``.

    A. Girard, "Dynamic triggering mechanisms for event-triggered control", IEEE Trans. Automatic Control 60 (2015)
    (arXiv:1301.2182), in the form for persistently exciting weights (audit, section 11.5): ``U = V + sum eta_i`` obeys
    ``U' <= -k (1 - sigma)/2 sum q_i - leak sum eta_i``, so that consensus is exponential if the weights are
    persistently exciting. Between events ``eta' >= -(leak + k/theta) eta``, so eta stays positive and ``0 >= eta`` is
    false at consensus.
    """

    eta = hm.State(0.25, output=True, description="internal variable, what the error has left unused")
    theta = hm.Parameter(1.0, unit="s", description="weight of the condition on the present instant")
    leak = hm.Parameter(0.1, unit="1/s", description="rate delta at which the internal variable decays")
    gain = hm.Parameter(1.0, description="control gain k")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """What is unused is saved, and leaks."""
        return {"eta": -s.leak * s.eta - s.gain * self.excess(s)}

    def error_too_large(self, s: hm.Values) -> Value:
        """The trigger function."""
        return s.theta * self.excess(s) - s.eta

    transitions = (hm.Jump("broadcast", error_too_large, EventGenerator.send),)
