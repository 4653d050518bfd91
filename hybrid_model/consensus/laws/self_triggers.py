"""Self-triggered broadcasting: the time of the next broadcast is computed ahead, from what the agent knows.

With known weights the error between two messages is known too,

    e(t) = e(t0) + k sum_j (xhat - xhat_j) integral of w_j from t0 to t,

so the agent needs no measurement until it broadcasts: it computes the time at which ``|e| = c exp(-beta t)`` and sets
an alarm. It computes anew with each message of a neighbour and where a weight has a breakpoint. The broadcasts are
those of the dynamic trigger (D. V. Dimarogonas, E. Frazzoli, K. H. Johansson, IEEE Trans. Automatic Control 57 (2012)
1291-1297, section on self-triggered control; audit, section 11.6).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.clocks.intervals import dwell_boundary, dwell_index, in_turn
from hybrid_model.consensus.laws.forecast import Forecast
from hybrid_model.consensus.laws.threshold_triggers import EventGenerator
from hybrid_model.consensus.scenario.trigger import Threshold
from hybrid_model.consensus.weights.constant import ConstantWeights
from hybrid_model.consensus.weights.edge_automata import EdgeAutomaton, ForeseenWeights
from hybrid_model.consensus.weights.gated_sine import GatedAbsoluteSineWeights, GatedSineWeights
from hybrid_model.consensus.weights.sine import SineWeights
from hybrid_model.declare.variables import Value
from hybrid_model.scales import INSTANT

NONE = -1.0
"""A time that means never: a discrete state holds finite numbers only, and no run begins before zero."""


class SelfTrigger(EventGenerator, ForeseenWeights):
    """A self-triggered event generator for weights that can be computed ahead; subclasses say which.

    Its discrete states are a plan: the predicted error and the time that it holds for, the values heard from the
    neighbours, and either the time of the next broadcast, or a time up to which there is none and at which planning
    goes on, or neither, if the present piece of the weights ends before.
    """

    phases = hm.Dimension("number of graphs in the cycle")
    neighbours = hm.Input(0.0, shape="degree", discrete=True, description="broadcast values of the neighbours")
    heard = hm.DiscreteState(shape="degree", computed=True, internal=True, description="what the plan takes them for")
    error = hm.DiscreteState(computed=True, internal=True, description="predicted error")
    planned = hm.DiscreteState(computed=True, internal=True, unit="s", description="time of the prediction")
    due = hm.DiscreteState(computed=True, unit="s", description="time of the next broadcast; negative for none")
    resume = hm.DiscreteState(
        computed=True, internal=True, unit="s", description="time at which planning goes on; negative for none"
    )
    interval = hm.DiscreteState(0, integer=True, internal=True, computed=True, description="dwell interval")
    threshold = hm.Parameter(0.5, description="trigger threshold c")
    decay = hm.Parameter(0.0, unit="1/s", description="decay rate beta of the threshold")
    gain = hm.Parameter(1.0, description="control gain k")
    dwell = hm.Parameter(1e9, unit="s", description="time that each graph stays")
    active = hm.Parameter(1.0, shape=("phases", "degree"), description="1 where an edge is active in a graph, else 0")

    def present(self, s: hm.Values) -> dict[str, Value]:
        """See `ForeseenWeights.present`; the dwell interval is a piece too."""
        return {**super().present(s), "interval": s.interval}

    def pieces_at(self, s: hm.Values) -> dict[str, Value]:
        """See `ForeseenWeights.pieces_at`."""
        return {**super().pieces_at(s), "interval": dwell_index(s.t, s.dwell)}

    def piece_end(self, s: hm.Values, pieces: Mapping[str, Value]) -> Value:
        """See `ForeseenWeights.piece_end`."""
        return np.minimum(super().piece_end(s, pieces), dwell_boundary(pieces["interval"], s.dwell))

    # The plan.

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The first broadcast, and the first plan."""
        pieces = self.pieces_at(s)
        return {
            **EventGenerator.start_map(self, s),
            "heard": s.neighbours,
            **pieces,
            **self._plan(s, pieces, 0.0, s.x, s.neighbours),
        }

    def predicted(self, s: hm.Values) -> Value:
        """The error now, from the last plan."""
        ahead = self._forecast(s, self.present(s), s.error, s.planned, s.broadcast, s.heard)
        return ahead.error(s.t)

    def replan(self, s: hm.Values) -> dict[str, Value]:
        """Plan from where the last plan has led."""
        return self._plan(s, self.present(s), self.predicted(s), s.broadcast, s.heard)

    def enter_piece(self, s: hm.Values) -> dict[str, Value]:
        """Move on to the pieces of the weights that begin now, and plan."""
        over = super().enter_piece(s)
        return {**over, **self._plan(s, over, self.predicted(s), s.broadcast, s.heard)}

    def resumption(self, s: hm.Values) -> Value:
        """Time at which planning goes on."""
        return np.where(s.resume < 0.0, np.inf, s.resume)

    def news(self, s: hm.Values) -> Value:
        """A neighbour has broadcast another value."""
        return np.sum(np.abs(np.sign(s.neighbours - s.heard))) - 0.5

    def hear(self, s: hm.Values) -> dict[str, Value]:
        """Take the neighbours' values over, and plan.

        An alarm that is set for this very instant stays set, as a crossing within the event tolerance belongs to the
        instant of another (rule 6): rounding must not decide which of two symmetric agents broadcasts.
        """
        plan = self._plan(s, self.present(s), self.predicted(s), s.broadcast, s.neighbours)
        is_now = np.logical_and(s.due >= 0.0, s.due <= s.t * (1.0 + INSTANT))
        return {
            "heard": s.neighbours,
            **plan,
            "due": np.where(is_now, s.t, plan["due"]),
            "resume": np.where(is_now, NONE, plan["resume"]),
        }

    def alarm(self, s: hm.Values) -> Value:
        """Time of the next broadcast."""
        return np.where(s.due < 0.0, np.inf, s.due)

    def send(self, s: hm.Values) -> dict[str, Value]:
        """Broadcast the present state, and plan."""
        return {**super().send(s), **self._plan(s, self.present(s), 0.0, s.x, s.heard)}

    transitions: ClassVar[tuple[hm.Jump | hm.TimeEvent, ...]] = (
        hm.TimeEvent("piece", ForeseenWeights.next_piece, enter_piece, internal=True),
        hm.TimeEvent("resume", resumption, replan, internal=True),
        hm.Jump("hear", news, hear),
        hm.TimeEvent("broadcast", alarm, send),
    )

    def _plan(
        self, s: hm.Values, pieces: Mapping[str, Value], error: Value, broadcast: Value, heard: Value
    ) -> dict[str, Value]:
        plan = self._forecast(s, pieces, error, s.t, broadcast, heard).first_meeting(self.piece_end(s, pieces))
        return {
            "error": error,
            "planned": s.t,
            "due": np.where(plan.met, plan.t, NONE),
            "resume": np.where(plan.open, plan.t, NONE),
        }

    def _forecast(
        self, s: hm.Values, pieces: Mapping[str, Value], error: Value, since: Value, broadcast: Value, heard: Value
    ) -> Forecast:
        active = in_turn(pieces["interval"], s.active.shape[0]) @ s.active
        pull = s.gain * self.amplitude(s, pieces) * active * (broadcast - heard)
        scale = np.maximum(1.0, np.abs(broadcast))
        return Forecast(self.carrier(s), pull, error, since, Threshold(s.threshold, s.decay), scale)


class ConstantSelfTrigger(SelfTrigger, ConstantWeights):
    """Self-triggered broadcasting over edges of constant weight, switched on and off by the table of active graphs."""


class SineSelfTrigger(SelfTrigger, SineWeights):
    """Self-triggered broadcasting over edges with the weights ``mean (1 + depth sin(rate t - phase))``."""


class GatedSineSelfTrigger(SelfTrigger, GatedSineWeights):
    """Self-triggered broadcasting over edges with the paper's gated sine weights ``g**2``."""


class GatedAbsoluteSineSelfTrigger(SelfTrigger, GatedAbsoluteSineWeights):
    """Self-triggered broadcasting over edges with the gated sine weights in the reading ``|g|``."""


SELF_TRIGGERS: dict[type[EdgeAutomaton], type[SelfTrigger]] = {
    ConstantWeights: ConstantSelfTrigger,
    SineWeights: SineSelfTrigger,
    GatedSineWeights: GatedSineSelfTrigger,
    GatedAbsoluteSineWeights: GatedAbsoluteSineSelfTrigger,
}
"""Automaton of the edges -> what broadcasts over them."""
