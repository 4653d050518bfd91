"""One jump, as a run leaves it."""

from __future__ import annotations

from dataclasses import dataclass

from hybrid_model.declare.variables import FloatArray


@dataclass(frozen=True, eq=False)
class JumpRecord:
    """One jump of a run.

    Attributes
    ----------
    t : float
        Time in s.
    j : int
        Jump count before the jump.
    index : int
        Number of the jump among the automaton's jumps.
    name : str
        Its name.
    x_before, z_before, x_after, z_after : ndarray, of shape (number of scalar states,)
        Continuous and discrete states on both sides.
    """

    t: float
    j: int
    index: int
    name: str
    x_before: FloatArray
    z_before: FloatArray
    x_after: FloatArray
    z_after: FloatArray
