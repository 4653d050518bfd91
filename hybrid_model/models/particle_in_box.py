"""A point in a rectangle with elastic walls: billiards."""

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class ParticleInBox(hm.HybridAutomaton):
    """A point that moves freely in a rectangle and is reflected by its walls without loss.

    Reflections unfold: ``x(t)`` is the triangle wave of ``x(0) + vx(0) t`` between 0 and `width`, likewise y, and the
    walls are hit where that sum is a whole multiple of the width (Tabachnikov, Geometry and Billiards, 2005,
    chapter 2). In a corner two jumps are due at one instant; they are taken one after the other in the order of
    declaration, each turns one component of the velocity, and the order has no influence on the result.

    A point that slides along a wall, with no speed across it, is on the border of the jump set for ever and is refused
    by the Zeno guard: start it off the walls.
    """

    x = hm.State(0.5, unit="m", description="position along the width", output=True)
    y = hm.State(0.5, unit="m", description="position along the height", output=True)
    vx = hm.State(1.0, unit="m/s", description="velocity along the width", output=True)
    vy = hm.State(0.7, unit="m/s", description="velocity along the height", output=True)
    width = hm.Parameter(2.0, unit="m", description="width of the box")
    height = hm.Parameter(1.0, unit="m", description="height of the box")
    hit_left = hm.Clock("left", description="ticks with each hit on the wall x = 0")
    hit_right = hm.Clock("right", description="ticks with each hit on the wall x = width")
    hit_bottom = hm.Clock("bottom", description="ticks with each hit on the wall y = 0")
    hit_top = hm.Clock("top", description="ticks with each hit on the wall y = height")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Straight motion."""
        return {"x": s.vx, "y": s.vy, "vx": 0.0, "vy": 0.0}

    def flow_set(self, s: hm.Values) -> Value:
        """Inside the box."""
        return hm.least(s.x, s.width - s.x, s.y, s.height - s.y)

    def at_left(self, s: hm.Values) -> Value:
        """On the left wall, moving into it."""
        return hm.least(-s.x, -s.vx)

    def at_right(self, s: hm.Values) -> Value:
        """On the right wall, moving into it."""
        return hm.least(s.x - s.width, s.vx)

    def at_bottom(self, s: hm.Values) -> Value:
        """On the lower wall, moving into it."""
        return hm.least(-s.y, -s.vy)

    def at_top(self, s: hm.Values) -> Value:
        """On the upper wall, moving into it."""
        return hm.least(s.y - s.height, s.vy)

    # The position is put on the wall, so that rounding at one hit does not shift the next.

    def turn_at_left(self, s: hm.Values) -> dict[str, Value]:
        """Turn the velocity along the width."""
        return {"x": 0.0, "vx": -s.vx}

    def turn_at_right(self, s: hm.Values) -> dict[str, Value]:
        """Turn the velocity along the width."""
        return {"x": s.width, "vx": -s.vx}

    def turn_at_bottom(self, s: hm.Values) -> dict[str, Value]:
        """Turn the velocity along the height."""
        return {"y": 0.0, "vy": -s.vy}

    def turn_at_top(self, s: hm.Values) -> dict[str, Value]:
        """Turn the velocity along the height."""
        return {"y": s.height, "vy": -s.vy}

    transitions = (
        hm.Jump("left", at_left, turn_at_left),
        hm.Jump("right", at_right, turn_at_right),
        hm.Jump("bottom", at_bottom, turn_at_bottom),
        hm.Jump("top", at_top, turn_at_top),
    )
