"""The baseline without events: agents that know each other's states at all times."""

from __future__ import annotations

import hybrid_model as hm
from hybrid_model.consensus.laws.integrator import Integrator
from hybrid_model.declare.variables import Value


class ContinuousIntegrator(Integrator):
    """The single integrator under the consensus protocol on states (paper, section 3).

    ``x' = -k sum_j w_j(t) (x - x_j)`` over the neighbours j. Their values change along flows, so agents of this kind
    are composed to one automaton; they do not meet at events only.
    """

    broadcast = hm.Input(0.0, description="state of the agent itself")
    neighbours = hm.Input(0.0, shape="degree", description="states of the neighbours")


class ContinuousBroadcast(hm.HybridAutomaton):
    """Stands in an event generator's place: the broadcast value is the state, and there are no events."""

    x = hm.Input(0.0, description="state of the agent")
    events = hm.DiscreteState(0, integer=True, output=True, description="number of broadcasts: none")
    broadcast = hm.Output(description="the state")

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """No error."""
        return {"broadcast": 1.0 * s.x}
