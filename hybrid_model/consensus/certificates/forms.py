"""The table of bounds: each quantity in each form, with its unit, its source and the hypotheses that it needs.

The JSON and the text of `certify`, its notes, the legends of figures and docs/paper-audit.md are made from this table;
a new bound is a row here and a function of the scenario's `Bounds`.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.gaps import Gaps
from hybrid_model.consensus.certificates.hypotheses import Hypothesis, follows_paper
from hybrid_model.consensus.certificates.observation import Observation
from hybrid_model.consensus.certificates.tree_bound import BoundForm
from hybrid_model.consensus.certificates.verdicts import statement
from hybrid_model.consensus.certificates.windows import RateForm

__all__ = ["BOUNDS", "Bound", "Certified", "Evidence", "Form", "Quantity", "certified_values"]


class Form(enum.StrEnum):
    """In which form a bound is given."""

    PRINTED = BoundForm.PRINTED.value
    """As in the paper."""
    VALID = BoundForm.VALID.value
    """The same proof with its gaps closed."""
    IMPROVED = RateForm.IMPROVED.value
    """A better proof, without a tree."""
    ENERGY = "energy"
    """A better proof, by what disagreement loses over windows."""
    EXACT = "exact"
    """No bound is smaller."""
    FLOQUET = "floquet"
    """The exact rate, by Floquet's theorem."""
    OBSERVED = "observed"
    """What one run shows: no bound."""

    @property
    def label(self) -> str:
        """As sentences and figures write it."""
        return "Floquet" if self is Form.FLOQUET else self.value


class Quantity(enum.StrEnum):
    """What is bounded: its name, its headings in text and on axes, its unit, and from which side."""

    heading: str
    axis: str
    unit: str
    is_upper: bool

    RATE = "rate", "rate of convergence", "rate (1/s)", "1/s", False
    TRANSIENT = "transient", "factor of the rate", "transient factor", "1", True
    RADIUS = "radius", "ultimate radius of ||x_e||", r"ultimate radius of $\|x_e\|$", "unit of x", True
    MIN_GAP = "min_gap", "minimum time between broadcasts", "smallest time between broadcasts (s)", "s", False

    def __new__(cls, name: str, heading: str, axis: str, unit: str, is_upper: bool) -> Quantity:
        """A member whose value is its name."""
        member = str.__new__(cls, name)
        member._value_ = name
        member.heading, member.axis, member.unit, member.is_upper = heading, axis, unit, is_upper
        return member


@dataclass(frozen=True, eq=False)
class Evidence:
    """What values are taken from: the bounds of a scenario whose union of graphs is connected, and a run of it."""

    bounds: Bounds
    seen: Observation | None = None

    @cached_property
    def gaps(self) -> Gaps:
        """The bounds on gaps."""
        return Gaps(self.bounds)

    @property
    def is_papers(self) -> bool:
        """Whether the printed statements are about this scenario."""
        return follows_paper(self.bounds.analysis.scenario)


@dataclass(frozen=True)
class Bound:
    """A row of the table.

    Parameters
    ----------
    quantity, form
        What is bounded, and how.
    source : str
        Where the formula is, and what was shown of a printed one.
    needs : tuple of Hypothesis
        Without which there is no value.
    value : callable
        The value from the `Evidence`; None if a hypothesis fails.
    instead : Hypothesis or None
        What takes the place of "beta below the Floquet rate" for weights without a period.
    in_json : bool
        Whether the object of ``certify --json`` has it.
    """

    quantity: Quantity
    form: Form
    source: str
    needs: tuple[Hypothesis, ...]
    value: Callable[[Evidence], float | None]
    instead: Hypothesis | None = None
    in_json: bool = True

    def needed(self, *, is_periodic: bool) -> tuple[Hypothesis, ...]:
        """The hypotheses that this bound needs, for weights with or without a period."""
        if is_periodic:
            return self.needs
        kept = tuple(each for each in self.needs if each is not Hypothesis.BETA_BELOW_FLOQUET)
        return kept if self.instead is None else (*kept, self.instead)


@dataclass(frozen=True)
class Certified:
    """One bound in one form.

    Parameters
    ----------
    quantity : Quantity
        "rate", "transient", "radius" or "min_gap".
    form : Form
        "printed", "valid", "improved", "energy", "exact", "floquet" or "observed".
    value : float or None
        None if a hypothesis fails.
    unit : str
        Of the value.
    source : str
        Where the formula is.
    needs : tuple of Hypothesis
        The hypotheses.
    """

    quantity: Quantity
    form: Form
    value: float | None
    unit: str
    source: str
    needs: tuple[Hypothesis, ...]


def certified_values(bounds: Bounds, seen: Observation | None) -> tuple[Certified, ...]:
    """All bounds in all forms; the observed ones are None without a run."""
    evidence = Evidence(bounds, seen)
    decay = bounds.slowest[0][1] if bounds.slowest else 0.0
    factor = "" if decay == 0 else f", times exp(-{decay:.6g} t)"
    return tuple(
        Certified(
            row.quantity,
            row.form,
            row.value(evidence),
            row.quantity.unit + (factor if row.quantity is Quantity.RADIUS else ""),
            row.source,
            row.needed(is_periodic=bounds.analysis.is_periodic),
        )
        for row in BOUNDS
    )


def _printed(place: str, row: str) -> str:
    """Where the paper states something, and what was shown of it."""
    return f"paper, {place} ({statement(row).remark})"


def _improved_transient(evidence: Evidence) -> float | None:
    rate = evidence.bounds.improved_rate
    return math.exp(rate * evidence.bounds.analysis.window) if rate else None


_RATE, _TRANSIENT, _RADIUS, _MIN_GAP = Quantity
_EXCITED = (Hypothesis.CONNECTED_UNION, Hypothesis.PERSISTENT_EXCITATION)
_PERIODIC = (Hypothesis.CONNECTED_UNION, Hypothesis.PERIODIC_WEIGHTS)
_ERRORS = (Hypothesis.CONNECTED_UNION, Hypothesis.BOUNDED_ERRORS)
_BELOW_FLOQUET = (*_ERRORS, Hypothesis.BETA_BELOW_FLOQUET)
_PAPERS = (
    Hypothesis.EXCITING_TREE,
    Hypothesis.PAPER_TRIGGER,
    Hypothesis.IDEAL_CHANNEL,
    Hypothesis.BETA_BELOW_PRINTED,
)

BOUNDS = (
    Bound(
        _RATE,
        Form.PRINTED,
        _printed("theorem 1", "b"),
        (Hypothesis.EXCITING_TREE,),
        lambda known: known.bounds.printed.rate or None,
    ),
    Bound(_RATE, Form.VALID, "audit, section 3 (i)", _EXCITED, lambda known: known.bounds.valid.rate or None),
    Bound(_RATE, Form.IMPROVED, "audit, section 3 (ii)", _EXCITED, lambda known: known.bounds.improved_rate or None),
    Bound(_RATE, Form.FLOQUET, "audit, section 7", _PERIODIC, lambda known: known.bounds.floquet_rate),
    Bound(_TRANSIENT, Form.PRINTED, _printed("eq:stm inequality", "b'"), (), lambda _: None, in_json=False),
    Bound(
        _TRANSIENT,
        Form.VALID,
        "audit, section 3, m_v",
        _EXCITED,
        lambda known: known.bounds.valid.overshoot if known.bounds.valid.rate else None,
        in_json=False,
    ),
    Bound(
        _TRANSIENT,
        Form.IMPROVED,
        "audit, section 3, in the coordinates xi",
        _EXCITED,
        _improved_transient,
        in_json=False,
    ),
    Bound(
        _TRANSIENT,
        Form.FLOQUET,
        "audit, section 7",
        _PERIODIC,
        lambda known: known.bounds.floquet_overshoot,
        in_json=False,
    ),
    Bound(
        _RADIUS,
        Form.PRINTED,
        _printed("theorem 2, rho kappa_2", "l"),
        _PAPERS,
        lambda known: known.bounds.printed_radius if known.is_papers else None,
    ),
    Bound(
        _RADIUS,
        Form.VALID,
        "audit, section 5.2",
        (*_ERRORS, Hypothesis.BETA_BELOW_VALID),
        lambda known: known.bounds.valid_radius,
    ),
    Bound(
        _RADIUS,
        Form.IMPROVED,
        "audit, end of section 5.2",
        (*_ERRORS, Hypothesis.BETA_BELOW_IMPROVED),
        lambda known: known.bounds.improved_radius,
        in_json=False,
    ),
    Bound(
        _RADIUS,
        Form.ENERGY,
        "audit, section 5.3",
        _BELOW_FLOQUET,
        lambda known: known.bounds.energy_radius,
        instead=Hypothesis.BETA_BELOW_IMPROVED,
    ),
    Bound(
        _RADIUS,
        Form.EXACT,
        "audit, section 7; reached from below, see the notes",
        _BELOW_FLOQUET,
        lambda known: known.bounds.exact_radius,
    ),
    Bound(_RADIUS, Form.OBSERVED, "run", (), lambda known: known.seen.radius if known.seen else None),
    Bound(
        _MIN_GAP,
        Form.PRINTED,
        _printed("eq:zeno dynamic upper bound", "e3"),
        _PAPERS,
        lambda known: known.gaps.printed if known.is_papers else None,
    ),
    Bound(
        _MIN_GAP,
        Form.VALID,
        "audit, section 6, Lambert form",
        (*_ERRORS, Hypothesis.BETA_BELOW_VALID),
        lambda known: known.gaps.valid,
    ),
    Bound(
        _MIN_GAP,
        Form.IMPROVED,
        "audit, section 6, logarithmic, per edge, excitation-aware",
        _BELOW_FLOQUET,
        lambda known: known.gaps.improved,
    ),
    Bound(_MIN_GAP, Form.OBSERVED, "run", (), lambda known: known.seen.min_gap if known.seen else None),
)
"""Every quantity in all its forms, the printed one first."""
