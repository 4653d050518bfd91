"""A ball and a platform on a damped spring that push each other: two automata that each need the other's signals."""

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class BallOverPlatform(hm.HybridAutomaton):
    """A ball that rebounds from a platform, whose height and velocity are inputs, with ``v+ = e |v|``."""

    h = hm.State(1.0, unit="m", description="height of the ball", output=True)
    v = hm.State(0.0, unit="m/s", description="velocity of the ball, upward", output=True)
    impacts = hm.DiscreteState(0, integer=True, description="number of impacts", output=True)
    platform = hm.Input(0.0, unit="m", description="height of the platform")
    platform_velocity = hm.Input(0.0, unit="m/s", description="velocity of the platform, upward")
    g = hm.Parameter(0.8, unit="m/s2", description="gravity")
    e = hm.Parameter(0.8, description="coefficient of restitution")
    impact = hm.Clock("jump", description="ticks with each impact")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Free fall."""
        return {"h": s.v, "v": -s.g}

    def flow_set(self, s: hm.Values) -> Value:
        """Above the platform."""
        return s.h - s.platform

    def jump_set(self, s: hm.Values) -> Value:
        """On the platform, and not moving away from it."""
        return hm.least(s.platform - s.h, s.platform_velocity - s.v)

    def jump_map(self, s: hm.Values) -> dict[str, Value]:
        """Rebound."""
        return {"v": s.e * abs(s.v), "impacts": s.impacts + 1}


class SpringPlatform(hm.HybridAutomaton):
    """A platform on a critically damped spring, ``y'' = -y - 2 y' + drive sin(rate t)``; an impact: ``w+ = -e |w|``.

    It hears of an impact by the ball's count, and jumps at the same instant.
    """

    y = hm.State(0.0, unit="m", description="height of the platform", output=True)
    w = hm.State(0.0, unit="m/s", description="velocity of the platform, upward", output=True)
    heard = hm.DiscreteState(0, integer=True, description="number of impacts heard of")
    impacts = hm.Input(0.0, discrete=True, description="number of impacts")
    drive = hm.Parameter(0.5, unit="m/s2", description="amplitude of the driving acceleration")
    rate = hm.Parameter(1.0, unit="rad/s", description="angular frequency of the drive")
    e = hm.Parameter(0.8, description="coefficient of restitution")
    pushed = hm.Clock("jump", description="ticks with each push")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Driven, damped spring."""
        return {"y": s.w, "w": -s.y - 2 * s.w + s.drive * np.sin(s.rate * s.t)}

    def jump_set(self, s: hm.Values) -> Value:
        """An impact not heard of yet."""
        return s.impacts - s.heard - 0.5

    def jump_map(self, s: hm.Values) -> dict[str, Value]:
        """Be pushed down."""
        return {"w": -s.e * abs(s.w), "heard": s.impacts}


class BallAndPlatform(hm.Composition):
    """The ball and the platform wired both ways, after the HyEQ Toolbox's composition of a ball and a moving platform.

    The platform stands first, so that it moves away before the ball's guard is tested again (rule 6). Between impacts
    the whole is linear, with the drive as an oscillator, so impacts are exact by matrix exponentials. The toolbox also
    keeps the platform at or above zero, which pushed down it does not keep; here it may dip below.

    Parameters
    ----------
    name : str
        Name of the composition.
    drive : float
        Amplitude in m/s2 of the acceleration that drives the platform.
    height : float
        Height in m from which the ball is dropped.
    """

    def __init__(self, name: str = "BallAndPlatform", *, drive: float = 0.5, height: float = 1.0) -> None:
        parts = {"platform": SpringPlatform(drive=drive), "ball": BallOverPlatform(h=height)}
        wires = {
            "ball.platform": "platform.y",
            "ball.platform_velocity": "platform.w",
            "platform.impacts": "ball.impacts",
        }
        super().__init__(name, parts, wires)
