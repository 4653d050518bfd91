"""How conservative each bound is, and the figures of one scenario's certificates beside its run, as files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from hybrid_model.consensus.certificates.certify import Certificates
from hybrid_model.consensus.certificates.forms import Form, Quantity
from hybrid_model.consensus.figures.details import (
    plot_all_errors,
    plot_broadcasts_and_weights,
    plot_gaps_against_bounds,
)
from hybrid_model.consensus.figures.run import plot_edge_norm, plot_states
from hybrid_model.consensus.figures.style import COLUMN, VIOLATED, height_of, in_column, is_drawable, save_figures
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.plots import COLORS, new_axes
from hybrid_model.record.arc import HybridArc

__all__ = ["plot_conservatism", "save_certificate_figures"]

_REFERENCES = {
    Quantity.RATE: (Form.FLOQUET,),
    Quantity.RADIUS: (Form.EXACT, Form.ENERGY),
    Quantity.MIN_GAP: (Form.OBSERVED,),
}
"""What the forms of a quantity are measured by, the best known first."""


def save_certificate_figures(
    found: Certificates, arc: HybridArc, folder: Path, formats: Sequence[str] = ("png", "pdf")
) -> list[Path]:
    """Write the figures of a run and of what is certified about it.

    ``states``, ``edge_norm`` with the bounds from the start on, ``broadcasts`` over the times in which weights act,
    ``errors`` against the threshold (of triggers that have one), ``gaps`` against their bounds, and ``conservatism``:
    by which factor each bound is weaker than what is exact or observed.

    Parameters
    ----------
    found : Certificates
        Of the scenario.
    arc : HybridArc
        A run of its closed loop.
    folder : Path
        Where to write.
    formats : sequence of str
        Out of png, pdf, svg, pgf.

    Returns
    -------
    list of Path
        The files written.
    """
    scenario = found.scenario
    times = run_report(scenario, arc).event_times
    gaps = _forms(found, Quantity.MIN_GAP)
    del gaps[Form.OBSERVED]
    figures: dict[str, Callable[[], Figure]] = {
        "states": in_column(lambda ax: plot_states(scenario, arc, ax)),
        "edge_norm": in_column(lambda ax: plot_edge_norm(scenario, arc, ax=ax, found=found)),
        "broadcasts": in_column(
            lambda ax: plot_broadcasts_and_weights(scenario, times, ax), 1.5, height_of(scenario.network.agents)
        ),
        # The legend at its side takes some of the room.
        "gaps": in_column(lambda ax: plot_gaps_against_bounds(scenario, times, gaps, ax), 1.5),
    }
    if scenario.trigger.has_level:
        figures["errors"] = lambda: plot_all_errors(scenario, arc)
    references, sources = _references(found)
    if references:
        forms = {quantity: _forms(found, quantity) for quantity in references}
        rows = sum(map(len, forms.values())) + len(forms)
        figures["conservatism"] = in_column(
            lambda ax: plot_conservatism(forms, references, ax, sources=sources),
            1.25,
            max(COLUMN[1], 0.8 + 0.17 * rows),
        )
    return save_figures(figures, folder, formats)


def _references(found: Certificates) -> tuple[dict[str, float], dict[str, Form]]:
    """The best known number of each quantity that has one above zero, and which form that is."""
    references: dict[str, float] = {}
    sources: dict[str, Form] = {}
    for quantity, forms in _REFERENCES.items():
        known = [(form, value) for form in forms if (value := found.value(quantity, form)) is not None and value > 0]
        if known:
            sources[quantity], references[quantity] = known[0]
    return references, sources


def _forms(found: Certificates, quantity: str) -> dict[str, float | None]:
    return {value.form: value.value for value in found.values if value.quantity == quantity}


def plot_conservatism(
    certified: Mapping[str, Mapping[str, float | None]],
    reference: Mapping[str, float | None],
    ax: Axes | None = None,
    *,
    sources: Mapping[str, Form] | None = None,
) -> Axes:
    """Draw by which factor each bound is weaker than what is exact or observed; left of 1 it is violated.

    What is observed is no bound: it is drawn in grey, on the side on which it lies. What is printed has no proof: its
    mark is hollow and its stem dashed. What a run or an exact number refutes is a cross, and says so.

    Parameters
    ----------
    certified : mapping
        Quantity -> form -> value; upper bounds of a radius, lower bounds of a rate or a gap.
    reference : mapping
        Quantity -> exact or observed value that the bounds are divided by, or that is divided by them.
    ax : Axes, optional
        Where to draw.
    sources : mapping, optional
        Quantity -> form of its reference, which a line above its rows then states.

    Raises
    ------
    ValueError
        If a quantity has no positive reference.
    """
    ax = new_axes(ax)
    upper = {quantity for quantity in Quantity if quantity.is_upper}
    names: list[str] = []
    factors = [1.0]
    for quantity, forms in certified.items():
        against = reference.get(quantity)
        if not is_drawable(against):
            raise ValueError(f"the {quantity} has the reference {against}; give the exact or observed value, above 0.")
        if sources is not None:
            source = Form(sources[quantity])
            what = "observed in the run" if source is Form.OBSERVED else source.label
            text = rf"$\bf{{{quantity.replace('min_gap', 'gap')}}}$ against {_number(float(against or 0.0))}, {what}"
            paper = {"facecolor": "w", "edgecolor": "none", "pad": 1.0}
            where = ax.get_yaxis_transform()
            ax.text(0.01, len(names), text, transform=where, va="center", fontsize="small", bbox=paper)
            names.append("")
        for form, value in forms.items():
            row = len(names)
            label = Form(form).label
            names.append(label if sources is not None else f"{quantity.replace('min_gap', 'gap')}, {label}")
            if not is_drawable(value):
                ax.text(1.12, row, "none", va="center", fontsize="small", color="0.4")
                continue
            factor = value / against if quantity in upper else against / value
            # Exact forms agree with their reference up to rounding and the search for the supremum.
            violated = factor < 1 - 1e-6 and form != Form.OBSERVED
            color = "0.5" if form == Form.OBSERVED else VIOLATED if violated else COLORS[0]
            unproven = form == Form.PRINTED
            ax.plot([1.0, factor], [row, row], color=color, linewidth=1.0, linestyle=(0, (3, 2)) if unproven else "-")
            mark = "x" if violated else "o"
            ax.plot([factor], [row], marker=mark, markersize=4, color=color, markerfacecolor="w" if unproven else color)
            factors.append(factor)
            # Right of both ends of the stem, where nothing else is.
            ax.annotate(
                _number(factor) + (", violated" if violated else ", no proof" if unproven else ""),
                (max(factor, 1.0), row),
                (6, 0),
                textcoords="offset points",
                ha="left",
                va="center",
                fontsize="small",
            )
    ax.axvline(1.0, color="0.3", linewidth=0.8, zorder=0)
    ax.set_xscale("log")
    # Room for the numbers beside the dots.
    span = max(factors) / min(factors)
    ax.set_xlim(min(factors) / (1.5 * span**0.05), max(factors) * 4.0 * span**0.3)
    ax.xaxis.set_major_locator(LogLocator(numticks=7))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel("conservatism (factor to the reference)")
    return ax


def _number(value: float) -> str:
    """Three digits; as a power of ten where there would be more than four before the point or zeros behind it."""
    if 1e-2 <= value < 1e4:
        return f"{value:.0f}" if value >= 1000 else f"{value:.3g}"
    mantissa, exponent = f"{value:.1e}".split("e")
    return rf"${mantissa}\cdot 10^{{{int(exponent)}}}$"
