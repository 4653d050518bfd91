"""The communication step that a description proposes, where its author gives none.

Importers that find no step take one of their own, or that of another FMU beside this one; how late signals are handed
over follows from it.
"""

from __future__ import annotations

import math

import numpy as np

from fmu.standard.units import BASE_UNITS, base_unit
from hybrid_model import Automaton
from hybrid_model.declare.variables import Kind, Variable

_ROWS = 500
"""Steps of a run for which no step size is given, at most; at least two fifths of them, for a round step is chosen."""
_SHARE = 10
"""Steps in the fastest declared time, at least."""


def proposed_step(automaton: Automaton, stop_time: float | None) -> float | None:
    """Return a communication step [s] for an automaton.

    Parameters
    ----------
    automaton : Automaton
        Its parameters with a unit of time or of a rate declare how fast it is.
    stop_time : float, optional
        Length of the default experiment in s, if there is one.

    Returns
    -------
    float or None
        A round share of the experiment; without one, of the fastest declared time; None where neither is known.
    """
    if stop_time is not None:
        return round_step(stop_time)
    times = [time for variable in automaton.of_kind(Kind.PARAMETER) for time in declared_times(variable)]
    return round_step(min(times), _SHARE) if times else None


def declared_times(variable: Variable) -> list[float]:
    """Return the times [s] that a parameter's start values mean: times themselves, time constants, periods."""
    known = base_unit(variable.unit)
    if known is None or known.offset:
        return []
    powers = {name: power for name, power in zip(BASE_UNITS, known.exponents, strict=True) if power}
    values = np.abs(np.ravel(variable.start)) * known.factor
    values = values[(values > 0) & np.isfinite(values)]
    if powers == {"s": 1}:
        return [float(value) for value in values]
    whole = {frozenset({("s", -1)}): 1.0, frozenset({("s", -1), ("rad", 1)}): 2 * math.pi}.get(
        frozenset(powers.items())
    )
    return [] if whole is None else [float(whole / value) for value in values]


def round_step(length: float, rows: int = _ROWS) -> float:
    """Return the least step of 1, 2 or 5 times a power of ten that divides a time into at most `rows` parts.

    Parameters
    ----------
    length : float
        A time in s, above zero.
    rows : int
        Number of parts.
    """
    least = length / rows
    power = math.floor(math.log10(least))
    factor = next(factor for factor in (1, 2, 5, 10) if factor * 10.0**power >= least * (1 - 1e-12))
    return float(f"{factor}e{power}")
