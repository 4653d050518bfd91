"""The error of slips in sweeps."""

from hybrid_model.errors import HybridModelError

__all__ = ["SweepError"]


class SweepError(HybridModelError, ValueError):
    """A sweep that cannot be run or read; the message names the thing, the value, the rule and the remedy."""
