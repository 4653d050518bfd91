"""Numbers that are checked where data is made, and the domain of what is defined at all times."""

import math

__all__ = ["ALWAYS", "require", "require_phase"]

ALWAYS = (-math.inf, math.inf)
"""The domain of what is defined at all times."""


def require(name: str, value: float, is_valid: bool, rule: str) -> None:
    """Check a number; ValueError with its name, value and rule if it is not finite or not valid."""
    if not math.isfinite(value):
        raise ValueError(f"{name} is {value}; it must be a finite number.")
    if not is_valid:
        raise ValueError(f"{name} is {value}; it {rule}.")


def require_phase(phase: float) -> None:
    """Check a phase [rad]: with a very large one nothing is left of the time in ``rate*t - phase``."""
    require("phase", phase, abs(phase) <= 1e6, "must lie between -1e6 and 1e6")
