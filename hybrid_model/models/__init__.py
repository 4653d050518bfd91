"""Model library: small automata with known answers."""

from hybrid_model.models.bouncing_ball import BouncingBall
from hybrid_model.models.thermostat import Thermostat

__all__ = ["BouncingBall", "Thermostat"]
