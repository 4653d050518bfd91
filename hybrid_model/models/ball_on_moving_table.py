"""A ball on a table that moves: alone with the table as input, and composed with a table that oscillates."""

from typing import Any

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class BallOnMovingTable(hm.HybridAutomaton):
    """A ball above a heavy table whose height and velocity are inputs.

    Newton's law of impact for the relative velocity, with table velocity w: ``v+ = w - e (v - w)``. The table does not
    feel the ball. Seen from a table that moves evenly, the ball is `BouncingBall`: impacts on it have the same times.
    A coefficient e above zero is needed: a ball that sticks to the table would stay in the jump set.
    """

    h = hm.State(1.0, unit="m", description="height of the ball", output=True)
    v = hm.State(0.0, unit="m/s", description="velocity of the ball, upward", output=True)
    table = hm.Input(0.0, unit="m", description="height of the table")
    table_velocity = hm.Input(0.0, unit="m/s", description="velocity of the table, upward: derivative of its height")
    g = hm.Parameter(9.81, unit="m/s2", description="gravity")
    e = hm.Parameter(0.7, description="coefficient of restitution")
    impact = hm.Clock("jump", description="ticks with each impact")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Free fall."""
        return {"h": s.v, "v": -s.g}

    def flow_set(self, s: hm.Values) -> Value:
        """Above the table."""
        return s.h - s.table

    def jump_set(self, s: hm.Values) -> Value:
        """On the table and approaching it."""
        return hm.least(s.table - s.h, s.table_velocity - s.v)

    def jump_map(self, s: hm.Values) -> dict[str, Value]:
        """Newton's law of impact for the relative velocity."""
        return {"h": s.table, "v": s.table_velocity - s.e * (s.v - s.table_velocity)}


class OscillatingTable(hm.HybridAutomaton):
    """A table that moves as ``amplitude sin(rate t + phase)``: an automaton of time alone, without states."""

    amplitude = hm.Parameter(0.1, unit="m", description="amplitude of the table")
    rate = hm.Parameter(10.0, unit="rad/s", description="angular frequency of the table")
    phase = hm.Parameter(0.0, unit="rad", description="phase of the table at time zero")
    height = hm.Output(unit="m", description="height of the table")
    velocity = hm.Output(unit="m/s", description="velocity of the table, upward")

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """Height, and velocity as its derivative."""
        angle = s.rate * s.t + s.phase
        return {"height": s.amplitude * np.sin(angle), "velocity": s.amplitude * s.rate * np.cos(angle)}


class BallOnOscillatingTable(hm.Composition):
    """A ball on a table that oscillates: `OscillatingTable` wired to `BallOnMovingTable`.

    With one impact in every n periods of the table the flights last ``T = 2 pi n/rate`` and the ball rebounds with
    ``g T/2``. Such a motion exists where the table's velocity at the impacts is ``w = (1 - e)/(1 + e) g T/2``, which is
    at the angle ``acos(w/(amplitude rate))``. It attracts when the table's deceleration there is positive and less
    than ``2 g (1 + e**2)/(1 + e)**2``. The start values are not on it: a ball may also lose its bounces on the way and
    settle on the table, which ends the run as Zeno. Sources: P. J. Holmes, J. Sound Vib. 84(2), 173-189 (1982), for the
    limit of high bounces; Luck and Mehta, Phys. Rev. E 48, 3988 (1993), for the impact times without that limit.

    Parameters
    ----------
    name : str
        Name of the composition.
    table : dict, optional
        Parameters of `OscillatingTable`.
    **ball
        Start values and parameters of `BallOnMovingTable`.

    Raises
    ------
    DeclarationError
        For an unknown name, a wrong shape, or a value that is not finite.
    """

    def __init__(
        self, name: str = "BallOnOscillatingTable", *, table: dict[str, Any] | None = None, **ball: Any
    ) -> None:
        names = {f"ball.{item}": item for item in ("h", "v", "g", "e", "impact")}
        super().__init__(
            name,
            {"table": OscillatingTable(**(table or {})), "ball": BallOnMovingTable(**ball)},
            {"ball.table": "table.height", "ball.table_velocity": "table.velocity"},
            names,
        )
