"""What may drive an input of a slave, as those write it who wire a system; imports nothing that takes long."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Linear:
    """An output of which ``factor * value + offset`` arrives, in the unit of the input, or as the number that it is.

    Attributes
    ----------
    source : str
        ``"slave.output"``.
    factor, offset : float
    converted : bool
        Whether the value is converted to the unit of the input before; else units are not looked at.
    """

    source: str
    factor: float = 1.0
    offset: float = 0.0
    converted: bool = True


Source = str | Sequence[str] | Linear
"""What drives an input: an output, outputs for the elements of an array, or a scaled output."""
