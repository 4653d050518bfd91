"""What the figures share: size, marks, the look of each form of a bound, axes over time, legends, files."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hybrid_model.consensus.certificates.forms import Form
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.plots import COLORS, JOURNAL

__all__ = [
    "COLUMN",
    "DASHES",
    "FORMS",
    "MARKER",
    "VIOLATED",
    "agent_color",
    "in_column",
    "legend_above",
    "over_time",
    "save_figures",
]

COLUMN = (3.4, 2.5)
"""Width and height in inches of a figure in one column of a journal."""
MARKER: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 2.2}
"""A broadcast in a figure over time."""
DASHES: tuple[Any, ...] = ((0, (5, 2)), (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5)), "solid", (0, (3, 1, 1, 1, 1, 1)))
"""Line styles of bounds, so that they can be told apart without colour as well."""
VIOLATED = COLORS[1]
"""Colour of a bound that does not hold."""

FORMS: dict[str, dict[str, Any]] = {
    Form.PRINTED: {"color": COLORS[1], "linestyle": DASHES[0], "marker": "x"},
    Form.VALID: {"color": COLORS[0], "linestyle": "solid", "marker": "s"},
    Form.IMPROVED: {"color": COLORS[4], "linestyle": "solid", "marker": "^"},
    Form.ENERGY: {"color": COLORS[2], "linestyle": "solid", "marker": "D"},
    Form.EXACT: {"color": COLORS[6], "linestyle": "solid", "marker": "o"},
    Form.FLOQUET: {"color": COLORS[6], "linestyle": "solid", "marker": "o"},
    Form.OBSERVED: {"color": COLORS[3], "linestyle": DASHES[1], "marker": "v"},
}
"""The look of each form of a bound, the same in all figures."""


def agent_color(agent: int) -> str:
    """The colour of an agent, counted from 1."""
    return COLORS[(agent - 1) % len(COLORS)]


def over_time(ax: Axes, scenario: Scenario) -> None:
    """Give axes the time of the run, with room between the axis and the fast start."""
    ax.set_xlabel("time $t$ (s)")
    ax.set_xlim(0.0, scenario.stop_time)
    ax.spines["left"].set_position(("outward", 4.0))


def legend_above(ax: Axes, words: Sequence[Line2D] = (), handlelength: float = 1.4) -> None:
    """Put a legend above the axes, where it hides no curve; `words` are entries of nothing that is drawn."""
    handles = [*ax.get_legend_handles_labels()[0], *words]
    if handles:
        ax.legend(
            handles=handles,
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            borderaxespad=0.3,
            ncols=len(handles) if len(handles) < 4 else (len(handles) + 1) // 2,
            columnspacing=1.2,
            handlelength=handlelength,
        )


def in_column(plot: Callable[[Axes], object], columns: float = 1.0) -> Callable[[], Figure]:
    """What draws a figure so many columns wide with one pair of axes, on which `plot` draws."""

    def draw() -> Figure:
        figure, ax = plt.subplots(figsize=(columns * COLUMN[0], COLUMN[1]))
        plot(ax)
        return figure

    return draw


def save_figures(figures: Mapping[str, Callable[[], Figure]], folder: Path) -> list[Path]:
    """Write figures in a journal's style as PNG and PDF.

    Parameters
    ----------
    figures : mapping
        Name of the file -> what draws the figure.
    folder : Path
        Where to write.

    Returns
    -------
    list of Path
        The files written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    # The font's own time stamp is none of the reader's business; the subsetter warns about it for every figure.
    logging.getLogger("fontTools").setLevel(logging.ERROR)
    written: list[Path] = []
    with plt.rc_context(JOURNAL):
        for name, draw in figures.items():
            written += _save(draw(), folder / name)
    return written


def _save(figure: Figure, path: Path) -> list[Path]:
    """Write a figure under a name without suffix, and close it; it is laid out once for both files."""
    written = [path.with_name(f"{path.name}{suffix}") for suffix in (".png", ".pdf")]
    # `savefig` draws a figure that has an engine once more, only to lay it out.
    with plt.rc_context({"figure.constrained_layout.use": False}):
        engine = figure.get_layout_engine()
        if engine is not None:
            figure.set_dpi(plt.rcParams["savefig.dpi"])
            engine.execute(figure)
            figure.set_layout_engine(None)
        for file, metadata in zip(written, ({"Software": None}, {"CreationDate": None}), strict=True):
            figure.savefig(file, metadata=metadata)
    plt.close(figure)
    return written
