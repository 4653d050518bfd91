"""Figures of one scenario's certificates beside its run, as files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from hybrid_model.consensus.certificates.certify import Certificates
from hybrid_model.consensus.figures.details import (
    plot_all_errors,
    plot_broadcasts_and_weights,
    plot_gaps_against_bounds,
)
from hybrid_model.consensus.figures.run import in_column, plot_states, save_figures
from hybrid_model.consensus.figures.sweeps import plot_conservatism
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.record.arc import HybridArc

__all__ = ["save_certificate_figures"]

_GAPS = ("printed", "valid", "improved")
_REFERENCES = {"rate": ("floquet",), "radius": ("exact", "energy"), "min_gap": ("observed",)}
"""What the forms of a quantity are measured by, the best known first."""


def save_certificate_figures(found: Certificates, arc: HybridArc, folder: Path) -> list[Path]:
    """Write the figures of a run and of what is certified about it as PNG and PDF.

    ``states``, ``broadcasts`` over the times in which weights act, ``errors`` against the threshold (of triggers that
    have one), ``gaps`` against their bounds, and ``conservatism``: by which factor each bound is weaker than what is
    exact or observed.

    Parameters
    ----------
    found : Certificates
        Of the scenario.
    arc : HybridArc
        A run of its closed loop.
    folder : Path
        Where to write.

    Returns
    -------
    list of Path
        The files written.
    """
    scenario = found.scenario
    times = run_report(scenario, arc).event_times
    gaps = {form: found.value("min_gap", form) for form in _GAPS}
    figures: dict[str, Callable[[], Figure]] = {
        "states": in_column(lambda ax: plot_states(scenario, arc, ax)),
        "broadcasts": in_column(lambda ax: plot_broadcasts_and_weights(scenario, times, ax)),
        # The legend at its side takes some of the room.
        "gaps": in_column(lambda ax: plot_gaps_against_bounds(scenario, times, gaps, ax), 1.5),
    }
    if scenario.trigger.has_level:
        figures["errors"] = lambda: plot_all_errors(scenario, arc)
    references = _references(found)
    if references:
        forms = {quantity: _forms(found, quantity) for quantity in references}
        figures["conservatism"] = in_column(lambda ax: plot_conservatism(forms, references, ax))
    return save_figures(figures, folder)


def _references(found: Certificates) -> dict[str, float | None]:
    """The best known number of each quantity that has one above zero."""
    references: dict[str, float | None] = {}
    for quantity, forms in _REFERENCES.items():
        known = [value for form in forms if (value := found.value(quantity, form)) is not None and value > 0]
        if known:
            references[quantity] = known[0]
    return references


def _forms(found: Certificates, quantity: str) -> dict[str, float | None]:
    return {value.form: value.value for value in found.values if value.quantity == quantity}
