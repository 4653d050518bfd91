"""The bounds of a scenario as a table: quantity, form, value, unit, source, hypotheses."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.hypotheses import PAPER_LAWS
from hybrid_model.consensus.certificates.observation import Observation
from hybrid_model.consensus.certificates.verdicts import statement

__all__ = ["FORMS", "Certified", "certified_values"]

FORMS = {
    "rate": ("printed", "valid", "improved", "floquet"),
    "transient": ("printed", "valid", "improved", "floquet"),
    "radius": ("printed", "valid", "improved", "energy", "exact", "observed"),
    "min_gap": ("printed", "valid", "improved", "observed"),
}
"""Every quantity in all its forms, in the order of `certified_values`."""


@dataclass(frozen=True)
class Certified:
    """One bound in one form.

    Parameters
    ----------
    quantity : str
        "rate", "transient", "radius" or "min_gap".
    form : str
        "printed", "valid", "improved", "energy", "exact", "floquet" or "observed".
    value : float or None
        None if a hypothesis fails.
    unit : str
        Of the value.
    source : str
        Where the formula is.
    needs : tuple of str
        Names of the hypotheses.
    """

    quantity: str
    form: str
    value: float | None
    unit: str
    source: str
    needs: tuple[str, ...]


def certified_values(bounds: Bounds, seen: Observation | None) -> tuple[Certified, ...]:
    """All bounds in all forms; the observed ones are None without a run."""
    decay = bounds.slowest[0][1] if bounds.slowest else 0.0
    ball = "unit of x" if decay == 0 else f"unit of x, times exp(-{decay:.6g} t)"
    union, tree, errors = "connected union", "exciting tree", "bounded errors"
    paper, periodic, excited = "trigger of the paper", "periodic weights", "persistent excitation"

    def entries(quantity: str, unit: str, *rows: tuple[str, float | None, str, tuple[str, ...]]) -> list[Certified]:
        return [Certified(quantity, form, value, unit, source, needs) for form, value, source, needs in rows]

    analysis = bounds.analysis
    below = "beta below the Floquet rate" if analysis.is_periodic else "beta below the improved rate"
    improved = bounds.improved_rate
    rates = entries(
        "rate",
        "1/s",
        ("printed", bounds.printed.rate or None, _printed("theorem 1", "b"), (tree,)),
        ("valid", bounds.valid.rate or None, "audit, section 3 (i)", (union, excited)),
        ("improved", improved or None, "audit, section 3 (ii)", (union, excited)),
        ("floquet", bounds.floquet_rate, "audit, section 7", (union, periodic)),
    )
    transients = entries(
        "transient",
        "1",
        ("printed", None, _printed("eq:stm inequality", "b'"), ()),
        ("valid", bounds.valid.overshoot if bounds.valid.rate else None, "audit, section 3, m_v", (union, excited)),
        (
            "improved",
            math.exp(improved * analysis.window) if improved else None,
            "audit, section 3, in the coordinates xi",
            (union, excited),
        ),
        ("floquet", bounds.floquet_overshoot, "audit, section 7", (union, periodic)),
    )
    radii = entries(
        "radius",
        ball,
        (
            "printed",
            bounds.printed_radius if _is_papers(bounds) else None,
            _printed("theorem 2, rho kappa_2", "l"),
            (tree, paper, "ideal channel", "beta below the printed rate"),
        ),
        ("valid", bounds.valid_radius, "audit, section 5.2", (union, errors, "beta below the valid rate")),
        (
            "improved",
            bounds.improved_radius,
            "audit, end of section 5.2",
            (union, errors, "beta below the improved rate"),
        ),
        ("energy", bounds.energy_radius, "audit, section 5.3", (union, errors, below)),
        (
            "exact",
            bounds.exact_radius,
            "audit, section 7; reached from below, see the notes",
            (union, errors, *([below] if analysis.is_periodic else [])),
        ),
        ("observed", None if seen is None else seen.radius, "run", ()),
    )
    gaps = entries(
        "min_gap",
        "s",
        (
            "printed",
            bounds.printed_gap if _is_papers(bounds) else None,
            _printed("eq:zeno dynamic upper bound", "e3"),
            (tree, paper, "ideal channel", "beta below the printed rate"),
        ),
        ("valid", bounds.valid_gap, "audit, section 6, Lambert form", (union, errors, "beta below the valid rate")),
        (
            "improved",
            bounds.improved_gap,
            "audit, section 6, logarithmic, per edge, excitation-aware",
            (union, errors, *([below] if analysis.is_periodic else [])),
        ),
        ("observed", None if seen is None else seen.min_gap, "run", ()),
    )
    return (*rates, *transients, *radii, *gaps)


def _printed(place: str, row: str) -> str:
    """Where the paper states something, and what was shown of it."""
    return f"paper, {place} ({statement(row).remark})"


def _is_papers(bounds: Bounds) -> bool:
    scenario = bounds.analysis.scenario
    return scenario.trigger.kind in PAPER_LAWS and scenario.channel.ideal
