"""Common periods of clocks whose periods are floating-point numbers."""

import math
from collections.abc import Iterable
from fractions import Fraction

__all__ = ["common_period"]

_LARGEST_DENOMINATOR = 1000
_ULPS = 8


def common_period(periods: Iterable[float | None]) -> float | None:
    """Smallest common multiple of the `periods` [s].

    Parameters
    ----------
    periods : iterable of float or None
        A period of 0.0 belongs to something constant in time (every number is a period of it); None means
        "not periodic".

    Returns
    -------
    float or None
        0.0 if everything is constant; None if something is not periodic or two periods are not commensurable.

    Notes
    -----
    Two periods count as commensurable if their quotient lies within a few units in the last place of a fraction with
    a denominator up to 1000. Such fractions are about 3e-6 apart on average, so a quotient meets one by accident with
    a chance of about 1e-9, while rates like 4 and 5, or dwell times like ``pi`` and ``pi/2``, always do.
    """
    common = 0.0
    for period in periods:
        if period is None:
            return None
        if period == 0.0:
            continue
        if common == 0.0:
            common = period
            continue
        quotient = _as_fraction(common / period)
        if quotient is None:
            return None
        common *= quotient.denominator
    return common


def _as_fraction(quotient: float) -> Fraction | None:
    """The simple fraction that `quotient` stands for, or None if it is not one up to rounding."""
    fraction = Fraction(quotient).limit_denominator(_LARGEST_DENOMINATOR)
    is_close = abs(fraction - Fraction(quotient)) <= _ULPS * Fraction(math.ulp(quotient))
    return fraction if is_close and fraction > 0 else None
