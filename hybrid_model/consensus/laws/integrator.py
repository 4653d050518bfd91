"""The paper's agent: a single integrator that moves on broadcast values."""

from __future__ import annotations

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class Integrator(hm.HybridAutomaton):
    """A single integrator under the consensus protocol on broadcast values.

    ``x' = -k sum_j w_j(t) (xhat - xhat_j)`` over the neighbours j, with the broadcast values xhat in place of the
    states (paper, section 4: control law of the event-triggered agent).
    """

    degree = hm.Dimension("number of neighbours")
    x = hm.State(0.0, description="state of the agent", output=True)
    broadcast = hm.Input(0.0, discrete=True, description="broadcast value of the agent itself")
    neighbours = hm.Input(0.0, shape="degree", discrete=True, description="broadcast values of the neighbours")
    weights = hm.Input(0.0, shape="degree", unit="1/s", description="weights of the edges to the neighbours")
    gain = hm.Parameter(1.0, description="control gain k")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """The consensus protocol."""
        return {"x": -s.gain * np.sum(s.weights * (s.broadcast - s.neighbours))}
