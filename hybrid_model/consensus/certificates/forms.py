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

__all__ = ["BOUNDS", "Bound", "Certified", "Evidence", "Form", "Progress", "Quantity", "certified_values"]

Progress = Callable[[int, int], None]
"""Called with the number of bounds that are computed, and of all."""


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
    def valid_transient(self) -> float | None:
        """``m_v``."""
        return self.bounds.valid.overshoot if self.bounds.valid.rate else None

    @property
    def improved_transient(self) -> float | None:
        """``exp(rate T)``, since the norm of xi never grows."""
        rate = self.bounds.improved_rate
        return math.exp(rate * self.bounds.analysis.window) if rate else None

    @property
    def printed_radius(self) -> float | None:
        """The printed radius of a scenario that the printed statements are about."""
        return self.bounds.printed_radius if follows_paper(self.bounds.analysis.scenario) else None

    @property
    def printed_gap(self) -> float | None:
        """The printed gap of such a scenario."""
        return self.gaps.printed if follows_paper(self.bounds.analysis.scenario) else None


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
    without_period : tuple of Hypothesis, optional
        What takes the place of `needs` for weights without a period.
    """

    quantity: Quantity
    form: Form
    source: str
    needs: tuple[Hypothesis, ...]
    value: Callable[[Evidence], float | None]
    without_period: tuple[Hypothesis, ...] | None = None

    @property
    def in_json(self) -> bool:
        """Whether the object of ``certify --json`` has it."""
        return self.quantity is not Quantity.TRANSIENT and (self.quantity, self.form) != (
            Quantity.RADIUS,
            Form.IMPROVED,
        )


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


def certified_values(
    bounds: Bounds, seen: Observation | None, progress: Progress | None = None
) -> tuple[Certified, ...]:
    """All bounds in all forms; the observed ones are None without a run."""
    evidence = Evidence(bounds, seen)
    decay = bounds.slowest[0][1] if bounds.slowest else 0.0
    factor = "" if decay == 0 else f", times exp(-{decay:.6g} t)"
    found = []
    for number, row in enumerate(BOUNDS):
        if progress is not None:
            progress(number, len(BOUNDS))
        needs = row.needs if bounds.analysis.is_periodic or row.without_period is None else row.without_period
        unit = row.quantity.unit + (factor if row.quantity is Quantity.RADIUS else "")
        found.append(Certified(row.quantity, row.form, row.value(evidence), unit, row.source, needs))
    if progress is not None:
        progress(len(BOUNDS), len(BOUNDS))
    return tuple(found)


def _printed(place: str, row: str) -> str:
    """Where the paper states something, and what was shown of it."""
    return f"paper, {place} ({statement(row).remark})"


_EXCITED = (Hypothesis.CONNECTED_UNION, Hypothesis.PERSISTENT_EXCITATION)
_PERIODIC = (Hypothesis.CONNECTED_UNION, Hypothesis.PERIODIC_WEIGHTS)
_ERRORS = (Hypothesis.CONNECTED_UNION, Hypothesis.BOUNDED_ERRORS)
_VALID = (*_ERRORS, Hypothesis.BETA_BELOW_VALID)
_IMPROVED = (*_ERRORS, Hypothesis.BETA_BELOW_IMPROVED)
_FLOQUET = (*_ERRORS, Hypothesis.BETA_BELOW_FLOQUET)
_TREE = (Hypothesis.EXCITING_TREE,)
_PAPERS = (*_TREE, Hypothesis.PAPER_TRIGGER, Hypothesis.IDEAL_CHANNEL, Hypothesis.BETA_BELOW_PRINTED)
_RATE, _TRANSIENT, _RADIUS, _GAP = Quantity
_GAP_SOURCE = "audit, section 6, logarithmic, per edge, excitation-aware"

BOUNDS = (
    Bound(_RATE, Form.PRINTED, _printed("theorem 1", "b"), _TREE, lambda e: e.bounds.printed.rate or None),
    Bound(_RATE, Form.VALID, "audit, section 3 (i)", _EXCITED, lambda e: e.bounds.valid.rate or None),
    Bound(_RATE, Form.IMPROVED, "audit, section 3 (ii)", _EXCITED, lambda e: e.bounds.improved_rate or None),
    Bound(_RATE, Form.FLOQUET, "audit, section 7", _PERIODIC, lambda e: e.bounds.floquet_rate),
    Bound(_TRANSIENT, Form.PRINTED, _printed("eq:stm inequality", "b'"), (), lambda _: None),
    Bound(_TRANSIENT, Form.VALID, "audit, section 3, m_v", _EXCITED, lambda e: e.valid_transient),
    Bound(
        _TRANSIENT, Form.IMPROVED, "audit, section 3, in the coordinates xi", _EXCITED, lambda e: e.improved_transient
    ),
    Bound(_TRANSIENT, Form.FLOQUET, "audit, section 7", _PERIODIC, lambda e: e.bounds.floquet_overshoot),
    Bound(_RADIUS, Form.PRINTED, _printed("theorem 2, rho kappa_2", "l"), _PAPERS, lambda e: e.printed_radius),
    Bound(_RADIUS, Form.VALID, "audit, section 5.2", _VALID, lambda e: e.bounds.valid_radius),
    Bound(_RADIUS, Form.IMPROVED, "audit, end of section 5.2", _IMPROVED, lambda e: e.bounds.improved_radius),
    Bound(_RADIUS, Form.ENERGY, "audit, section 5.3", _FLOQUET, lambda e: e.bounds.energy_radius, _IMPROVED),
    Bound(
        _RADIUS,
        Form.EXACT,
        "audit, section 7; reached from below, see the notes",
        _FLOQUET,
        lambda e: e.bounds.exact_radius,
        _ERRORS,
    ),
    Bound(_RADIUS, Form.OBSERVED, "run", (), lambda e: e.seen.radius if e.seen else None),
    Bound(_GAP, Form.PRINTED, _printed("eq:zeno dynamic upper bound", "e3"), _PAPERS, lambda e: e.printed_gap),
    Bound(_GAP, Form.VALID, "audit, section 6, Lambert form", _VALID, lambda e: e.gaps.valid),
    Bound(_GAP, Form.IMPROVED, _GAP_SOURCE, _FLOQUET, lambda e: e.gaps.improved, _ERRORS),
    Bound(_GAP, Form.OBSERVED, "run", (), lambda e: e.seen.min_gap if e.seen else None),
)
"""Every quantity in all its forms, the printed one first."""
