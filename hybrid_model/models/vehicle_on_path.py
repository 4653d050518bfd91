"""A vehicle that zigzags along a lane."""

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class VehicleOnPath(hm.HybridAutomaton):
    """A Dubins vehicle steered back into a lane: it turns left at the right edge and right at the left edge.

    The example "vehicle on path with boundaries" of the HyEQ Toolbox, with its numbers. The heading relaxes to the
    target r of the mode, ``heading = r + c exp(-t)``, so the position is given by the sine and cosine integrals: across
    the lane ``x = x0 + speed (cos(r) (Ci|c| - Ci|c e^-t|) - sin(r) (Si(c) - Si(c e^-t)))``. From the values below the
    first turn comes after a straight line, at ``sqrt(2) half_width/speed``.
    """

    x = hm.State(0.0, unit="m", description="position across the lane, from its middle to the right", output=True)
    y = hm.State(0.0, unit="m", description="position along the lane", output=True)
    heading = hm.State(np.pi / 4, unit="rad", description="direction of travel, from the x axis", output=True)
    leftward = hm.DiscreteState(0, integer=True, description="1 while it is to travel to the left", output=True)
    speed = hm.Input(1.0, unit="m/s", description="tangential velocity")
    half_width = hm.Parameter(1.0, unit="m", description="half the width of the lane")
    relaxation = hm.Parameter(1.0, unit="1/s", description="rate at which the heading approaches its target")
    rightward_heading = hm.Parameter(np.pi / 4, unit="rad", description="target of the heading, to the right")
    leftward_heading = hm.Parameter(3 * np.pi / 4, unit="rad", description="target of the heading, to the left")
    at_right_edge = hm.Clock("turn_left", description="ticks at the right edge")
    at_left_edge = hm.Clock("turn_right", description="ticks at the left edge")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Travel along the heading, and steer."""
        target = np.where(s.leftward > 0.5, s.leftward_heading, s.rightward_heading)
        return {
            "x": s.speed * np.cos(s.heading),
            "y": s.speed * np.sin(s.heading),
            "heading": s.relaxation * (target - s.heading),
        }

    def flow_set(self, s: hm.Values) -> Value:
        """Not beyond the edge to which it is to travel."""
        return s.half_width - np.where(s.leftward > 0.5, -s.x, s.x)

    def at_right(self, s: hm.Values) -> Value:
        """At or beyond the right edge and travelling to the right."""
        return hm.least(s.x - s.half_width, 0.5 - s.leftward)

    def at_left(self, s: hm.Values) -> Value:
        """At or beyond the left edge and travelling to the left."""
        return hm.least(-s.half_width - s.x, s.leftward - 0.5)

    def turn_left(self, s: hm.Values) -> dict[str, Value]:
        """Steer to the left."""
        return {"leftward": 1}

    def turn_right(self, s: hm.Values) -> dict[str, Value]:
        """Steer to the right."""
        return {"leftward": 0}

    transitions = (hm.Jump("turn_left", at_right, turn_left), hm.Jump("turn_right", at_left, turn_right))
