"""What a unit is in SI base units; imports nothing that takes long."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Measure:
    """A unit in SI base units: a value in them is ``factor * value + offset``.

    Attributes
    ----------
    exponents : tuple of int
        Of kg, m, s, A, K, mol, cd and rad.
    factor, offset : float
    """

    exponents: tuple[int, ...]
    factor: float = 1.0
    offset: float = 0.0

    def converted_to(self, other: Measure) -> tuple[float, float] | None:
        """Return factor and offset from this unit to another; None if they measure differently."""
        if self.exponents != other.exponents or other.factor == 0.0:
            return None
        return self.factor / other.factor, (self.offset - other.offset) / other.factor
