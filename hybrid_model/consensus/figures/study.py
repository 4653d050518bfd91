"""Figures of a sweep: heat maps over two keys, and what a radius costs in broadcasts, beside what certificates say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter, MaxNLocator
from numpy.typing import NDArray

from hybrid_model.consensus.certificates.forms import Form, Quantity
from hybrid_model.consensus.figures.style import COLUMN, FORMS, is_drawable, save_figures
from hybrid_model.consensus.sweeps.axes import Seeds
from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.study import METRICS
from hybrid_model.consensus.sweeps.table import SweepTable
from hybrid_model.plots import new_axes

__all__ = ["label_of", "plot_events_against_radius", "plot_heat_map", "save_study_figures"]

_C, _BETA = "trigger.threshold", "trigger.decay"
_LABELS = {
    _C: "threshold $c$",
    _BETA: r"decay of the threshold $\beta$ (1/s)",
    "network.gain": "gain $k$",
    "network.agents": "agents $n$",
    "channel.delay": "delay (s)",
    "channel.loss": "share of lost broadcasts",
    "switching.dwell": "dwell time (s)",
    "stop_time": "stop time (s)",
    "events": "broadcasts",
    "link_messages": "messages over all edges",
    "active_messages": "messages over active edges",
    "rate": "broadcasts per agent and second (1/s)",
    "gap_min": "shortest gap (s)",
    "gap_mean": "mean gap (s)",
    "integral": r"$\int\|x-\bar x\|^2\,\mathrm{d}t$ (s)",
    "ultimate": r"largest $\|x-\bar x\|$, last quarter",
    "settling": "settling time (s)",
    "edge_norm_end": r"$\|x_e\|$ at the end",
}
_MAPPED = ("events", "gap_min", "ultimate", "settling")
"""Metrics of which `save_study_figures` draws maps."""
_MAP = "cividis"
"""Rises in brightness all along, and to eyes without red or green alike."""
_WIDE = 30.0
"""A ratio of values from which on their logarithms are shown."""
_LINES = 5
_TICKS = 6
"""Most ticks on an axis of a map."""
_PANELS = 3


def label_of(name: str) -> str:
    """The text of an axis for a key or a column of a sweep."""
    quantity, _, form = name.partition(".")
    known = next((member for member in Quantity if member.value == quantity), None)
    return _LABELS.get(name, name) if known is None else f"{Form(form).label} {known.axis}"


def plot_heat_map(
    table: SweepTable, value: str, x: str | None = None, y: str | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a column of a sweep over two of its keys, with lines of equal values.

    On a grid each point is a cell; drawn points are dots. Runs with the same two values, such as repeats, count by
    their mean. Points without a value (failed runs, bounds that do not exist) are left white and crossed out.

    Parameters
    ----------
    table : SweepTable
        The sweep.
    value : str
        A column with numbers.
    x, y : str, optional
        Keys with numbers; default: the first two.
    ax : Axes, optional
        Where to draw.

    Raises
    ------
    SweepError
        If there are not two such keys, or no number in the column.
    """
    ax = new_axes(ax)
    keys = _numeric_keys(table)
    chosen = [x or (keys[0] if keys else ""), y or next((key for key in keys if key != (x or keys[0])), "")]
    missing = next((key for key in chosen if key not in keys), None)
    if missing is not None:
        raise SweepError(
            f"a heat map needs two keys with numbers that vary; the sweep has {', '.join(keys) or 'none'}."
        )
    points = _points(table, chosen, value)
    known = np.array([entry for entry in points.values() if np.isfinite(entry)])
    if not known.size:
        raise SweepError(f"the column '{value}' has no number in any run, so there is nothing to draw.")
    wide = bool(known.min() > 0 and known.max() > _WIDE * known.min())
    norm = LogNorm(known.min(), known.max()) if wide else Normalize(known.min(), known.max())
    across, up = (np.unique([point[k] for point in points]) for k in (0, 1))
    on_grid = len(points) == len(across) * len(up) and min(len(across), len(up)) > 1
    if on_grid:
        mesh = _cells(ax, points, across, up, norm)
    else:
        xs, ys = np.array(list(points)).T
        values = np.array(list(points.values()))
        mesh = ax.scatter(xs, ys, c=values, cmap=_MAP, norm=norm, s=9, linewidths=0)
        gone = ~np.isfinite(values)
        ax.plot(xs[gone], ys[gone], "x", color="0.4", markersize=3)
    for scale, axis, places in ((ax.set_xscale, ax.xaxis, across), (ax.set_yscale, ax.yaxis, up)):
        if _is_geometric(places):
            scale("log")
        if on_grid:
            _mark_places(axis, places)
    ax.set_xlabel(label_of(chosen[0]))
    ax.set_ylabel(label_of(chosen[1]))
    bar = ax.figure.colorbar(mesh, ax=ax, pad=0.02)
    bar.set_label(label_of(value))
    bar.outline.set_linewidth(0.5)
    return ax


def _mark_places(axis: Axis, places: NDArray[Any]) -> None:
    """Set ticks where there are runs: cells reach half a step beyond, where a tick would be a value that none has."""
    shown = places[:: -(-len(places) // _TICKS)]
    axis.set_ticks(shown, [f"{place:.3g}" for place in shown])
    axis.set_ticks([], minor=True)


def _cells(
    ax: Axes, points: dict[tuple[float, ...], float], across: NDArray[Any], up: NDArray[Any], norm: Normalize
) -> Any:
    table = np.array([[points[a, b] for a in across.tolist()] for b in up.tolist()])
    mesh = ax.pcolormesh(_edges(across), _edges(up), np.ma.masked_invalid(table), cmap=_MAP, norm=norm)
    # Drawn as one picture: files with ten thousand cells are large, and viewers show seams between them.
    mesh.set_rasterized(True)
    gone = np.argwhere(~np.isfinite(table))
    if 0 < len(gone) <= 400:
        ax.plot(across[gone[:, 1]], up[gone[:, 0]], "x", color="0.5", markersize=2.5, markeredgewidth=0.5)
    finite = table[np.isfinite(table)]
    if finite.max() > finite.min() and min(table.shape) > 3:
        wide = isinstance(norm, LogNorm)
        levels = (
            np.geomspace(finite.min(), finite.max(), _LINES + 2)[1:-1]
            if wide
            else MaxNLocator(_LINES).tick_values(finite.min(), finite.max())
        )
        shown = [float(f"{level:.1g}") for level in levels] if wide else levels
        # A dark line on a white one can be seen on every brightness.
        kept = sorted({level for level in shown if finite.min() < level < finite.max()})
        if kept:
            ax.contour(across, up, table, levels=kept, colors="white", linewidths=1.4)
            lines = ax.contour(across, up, table, levels=kept, colors="black", linewidths=0.6)
            texts = ax.clabel(lines, fontsize="x-small", fmt=lambda level: f"{level:g}")
            for text in texts or ():
                text.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.8})
    return mesh


def plot_events_against_radius(table: SweepTable, decay: float | None = None, ax: Axes | None = None) -> Axes:
    """Draw what a radius costs: broadcasts against the radius that runs show and that certificates give.

    Each threshold c is one run, a mark, and for each form of the radius among the columns of the sweep a point of its
    curve: right of the mark by the factor by which the certificate is conservative.

    Parameters
    ----------
    table : SweepTable
        A sweep over ``trigger.threshold`` with columns ``radius.*``.
    decay : float, optional
        Of a sweep over ``trigger.decay`` as well: only runs with this beta [1/s]; default: the least.
    ax : Axes, optional
        Where to draw.

    Raises
    ------
    SweepError
        If the threshold does not vary, there is no column with a radius, or no run with this decay.
    """
    ax = new_axes(ax)
    forms = _radius_forms(table)
    if _C not in _numeric_keys(table) or not forms:
        raise SweepError(
            "broadcasts are drawn against the radius for a sweep over trigger.threshold with columns such as "
            "radius.observed and radius.energy: give both."
        )
    chosen = np.ones(len(table), dtype=bool)
    if _BETA in _numeric_keys(table):
        betas = table.column(_BETA)
        beta = float(np.nanmin(betas)) if decay is None else decay
        chosen = np.isclose(betas, beta, rtol=1e-12, atol=0.0)
        if not chosen.any():
            raise SweepError(f"no run has trigger.decay = {beta:g}; it takes the values {_shown(np.unique(betas))}.")
        ax.set_title(rf"$\beta={beta:.3g}$ 1/s", fontsize="medium")
    events, order = table.column("events"), np.argsort(table.column(_C), kind="stable")
    order = order[chosen[order]]
    for form in sorted(forms, key=list(Form).index):
        radius = table.column(f"radius.{form.value}")[order]
        drawable = np.array(
            [is_drawable(float(value)) and count > 0 for value, count in zip(radius, events[order], strict=True)]
        )
        look = {**FORMS[form], "markersize": 2.8}
        if form is Form.OBSERVED:
            look |= {"linestyle": "none", "markersize": 3.2}
        if drawable.any():
            ax.plot(
                radius[drawable],
                events[order][drawable],
                markevery=max(1, int(drawable.sum()) // 12),
                label=form.label,
                **look,
            )
    ax.set_xscale("log")
    ax.set_yscale("log")
    # Numbers of broadcasts are read as such, not as products with powers of ten.
    ax.yaxis.set_major_formatter(LogFormatter())
    ax.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(2.0, 0.5)))
    factor = "" if not ax.get_title() or "=0$" in ax.get_title() else r" times $e^{\beta t}$"
    ax.set_xlabel(rf"radius of $\|x_e\|${factor}")
    ax.set_ylabel("broadcasts")
    return ax


def save_study_figures(table: SweepTable, folder: Path) -> list[Path]:
    """Write the figures that a sweep has the columns for, as PNG and PDF.

    ``map-events``, ``map-gap_min``, ``map-ultimate``, ``map-settling`` and a map of each bound, over the first two keys
    with numbers; ``events-against-radius``, of a sweep over thresholds with certified radii, for up to three decays.

    Parameters
    ----------
    table : SweepTable
        The sweep.
    folder : Path
        Where to write.

    Returns
    -------
    list of Path
        The files written; none for a sweep of which there is nothing to draw.
    """
    figures: dict[str, Callable[[], Figure]] = {}
    keys = _numeric_keys(table)
    if len(keys) >= 2:
        for name in (*_MAPPED, *table.study.frame.bounds):
            values = table.column(name)
            if values.dtype != object and np.isfinite(values).any():
                figures[f"map-{name}"] = _map_of(table, name)
    if _C in keys and _radius_forms(table):
        figures["events-against-radius"] = lambda: _tradeoff(table)
    return save_figures(figures, folder)


def _map_of(table: SweepTable, name: str) -> Callable[[], Figure]:
    def draw() -> Figure:
        figure, ax = plt.subplots(figsize=(1.15 * COLUMN[0], COLUMN[1]), layout="constrained")
        plot_heat_map(table, name, ax=ax)
        return figure

    return draw


def _tradeoff(table: SweepTable) -> Figure:
    decays: Sequence[float | None] = [None]
    if _BETA in _numeric_keys(table):
        known = np.unique(table.column(_BETA))
        # A panel must have something to show.
        places = np.unique(np.linspace(0, len(known) - 1, min(_PANELS, len(known))).round().astype(int))
        decays = known[places].tolist()
    width = COLUMN[0] * (1 + 0.75 * (len(decays) - 1))
    figure, row = plt.subplots(
        1, len(decays), figsize=(width, COLUMN[1] + 0.35), sharey=True, squeeze=False, layout="constrained"
    )
    for place, (ax, decay) in enumerate(zip(row[0], decays, strict=True)):
        plot_events_against_radius(table, decay, ax)
        if place:
            ax.set_ylabel("")
    known_labels: dict[str, Any] = {}
    for ax in row[0]:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            known_labels.setdefault(label, handle)
    figure.legend(known_labels.values(), known_labels.keys(), loc="outside upper center", ncols=6, handlelength=1.8)
    return figure


def _numeric_keys(table: SweepTable) -> list[str]:
    """Keys with several values, all of them numbers, in the order of the axes."""
    found = []
    for axis in table.study.axes:
        if isinstance(axis, Seeds):
            continue
        values = table.column(axis.key)
        if values.dtype != object and len(np.unique(values)) > 1:
            found.append(axis.key)
    return found


def _radius_forms(table: SweepTable) -> list[Form]:
    radius = f"{Quantity.RADIUS.value}."
    return [Form(name.removeprefix(radius)) for name in table.study.frame.bounds if name.startswith(radius)]


def _points(table: SweepTable, keys: Sequence[str], value: str) -> dict[tuple[float, ...], float]:
    """Values of two keys -> mean of a column over the runs with these; NaN where no run has one."""
    if value not in (*METRICS, *table.study.frame.bounds):
        raise SweepError(f"'{value}' is no column with numbers: there are {', '.join(METRICS)} and the bounds.")
    columns = [table.column(key).tolist() for key in keys]
    gathered: dict[tuple[float, ...], list[float]] = {}
    for *place, number in zip(*columns, table.column(value).tolist(), strict=True):
        gathered.setdefault(tuple(place), []).append(number)
    return {
        place: float(np.mean(finite)) if (finite := [n for n in numbers if np.isfinite(n)]) else float("nan")
        for place, numbers in gathered.items()
    }


def _is_geometric(places: NDArray[Any]) -> bool:
    """Whether places on an axis stand in equal ratios."""
    if len(places) < 4 or places[0] <= 0:
        return False
    ratios = places[1:] / places[:-1]
    return bool(np.allclose(ratios, ratios[0], rtol=1e-6))


def _edges(places: NDArray[Any]) -> NDArray[Any]:
    """Return where cells round places on an axis begin and end: halfway, on the scale that the axis has."""
    if _is_geometric(places):
        return np.asarray(np.exp(_edges(np.log(places))))
    halves = np.diff(places) / 2
    return np.concatenate([[places[0] - halves[0]], places[:-1] + halves, [places[-1] + halves[-1]]])


def _shown(values: NDArray[Any]) -> str:
    return ", ".join(f"{value:g}" for value in values[:10])
