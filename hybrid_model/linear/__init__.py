"""Flows of automata as linear systems of python-control and back, at operating points.

It imports `declare` and `reference`; `control_systems` is the one file that imports python-control, which is slow to
import, so nothing that `import hybrid_model` loads may import this room.
"""

from hybrid_model.linear.control_systems import (
    StateSpace,
    flow_system,
    h_infinity_norm,
    linearise,
    lti,
    named_system,
)

__all__ = ["StateSpace", "flow_system", "h_infinity_norm", "linearise", "lti", "named_system"]
