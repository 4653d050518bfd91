"""What the figures share: size, marks, the look of each form of a bound, axes over time, legends, files."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeGuard

import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from hybrid_model.consensus.certificates.forms import Form
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.errors import DataError
from hybrid_model.plots import COLORS, JOURNAL
from hybrid_model.plots.tex import measured_by_tex, tex_system

__all__ = [
    "COLUMN",
    "DASHES",
    "FORMATS",
    "FORMS",
    "LINES",
    "MARKER",
    "PAGE",
    "VIOLATED",
    "agent_color",
    "agent_look",
    "agent_mark",
    "height_of",
    "in_column",
    "is_drawable",
    "legend_above",
    "over_time",
    "require_formats",
    "row_step",
    "save_figures",
]

COLUMN = (3.4, 2.5)
"""Width and height in inches of a figure in one column of a journal."""
PAGE = (7.0, 9.0)
"""Width and height in inches that a figure has at most: a page."""
ROW = 8.5
"""Height in points that a name needs."""
MARKER: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 2.2}
"""A broadcast in a figure over time."""
DASHES: tuple[Any, ...] = ((0, (5, 2)), (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5)), "solid", (0, (3, 1, 1, 1, 1, 1)))
"""Line styles of bounds, so that they can be told apart without colour as well."""
FORMATS: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None},
    "svg": {"Date": None},
    "pgf": {},
}
"""Forms of figures -> what is not written into them, so that one run gives the same files each time."""
LINES: tuple[Any, ...] = ("solid", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1.5, 1, 1.5)))
"""Line styles of agents, one after the other."""
_LARGEST = 1e100
"""A bound that is larger has overflown, or is about to; an axis that shows it shows nothing else."""
MARKS = "osD^v<>X"
"""Marks of agents, as many as there are colours."""
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


def agent_look(agent: int) -> dict[str, Any]:
    """The colour and the line of an agent, counted from 1: agents next to each other differ in both."""
    return {"color": agent_color(agent), "linestyle": LINES[(agent - 1) % len(LINES)]}


def agent_mark(agent: int, agents: int) -> dict[str, Any]:
    """The mark of an agent's broadcasts; of many agents dots, which take the least room."""
    few = agents <= len(COLORS)
    size = 2.2 if agent == 1 else 2.8
    return (
        MARKER
        | {"color": agent_color(agent)}
        | ({"marker": MARKS[agent - 1], "markersize": size} if few else {"markersize": 1.2})
    )


def row_step(agents: int, height: float) -> int:
    """Every how many rows a name has room, of so many rows in a height in inches."""
    return next(k for k in (1, 2, 5, 10, 20, 50, 100, agents + 1) if k * height * 72.0 >= ROW * agents)


def height_of(agents: int) -> float:
    """Height in inches of a figure with a row for each agent: no higher than a page."""
    return min(max(COLUMN[1], 0.9 + 0.16 * agents), PAGE[1])


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


def in_column(plot: Callable[[Axes], object], columns: float = 1.0, height: float = COLUMN[1]) -> Callable[[], Figure]:
    """What draws a figure with one pair of axes, on which `plot` draws; its width in columns, its height in inches."""

    def draw() -> Figure:
        figure, ax = plt.subplots(figsize=(columns * COLUMN[0], height))
        plot(ax)
        return figure

    return draw


def require_formats(formats: Sequence[str]) -> None:
    """Refuse forms of figures that cannot be written here.

    Raises
    ------
    DataError
        For an unknown one, and for PGF where there is no TeX, which measures its texts.
    """
    for name in formats:
        if name not in FORMATS:
            raise DataError(f"figures are written as {', '.join(FORMATS)}, and not as {name!r}: give one of these.")
    if "pgf" in formats:
        tex_system()


def save_figures(
    figures: Mapping[str, Callable[[], Figure]], folder: Path, formats: Sequence[str] = ("png", "pdf")
) -> list[Path]:
    """Write figures in a journal's style.

    Parameters
    ----------
    figures : mapping
        Name of the file -> what draws the figure.
    folder : Path
        Where to write.
    formats : sequence of str
        Out of `FORMATS`.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    DataError
        See `require_formats`.
    """
    require_formats(formats)
    folder.mkdir(parents=True, exist_ok=True)
    # The font's own time stamp is none of the reader's business; the subsetter warns about it for every figure.
    logging.getLogger("fontTools").setLevel(logging.ERROR)
    written: list[Path] = []
    with plt.rc_context(JOURNAL):
        for name, draw in figures.items():
            written += _save(draw(), folder / name, formats)
    return written


def _save(figure: Figure, path: Path, formats: Sequence[str]) -> list[Path]:
    """Write a figure under a name without suffix, and close it; it is laid out once for all files."""
    written = [path.with_name(f"{path.name}.{name}") for name in formats]
    # `savefig` draws a figure that has an engine once more, only to lay it out.
    with plt.rc_context({"figure.constrained_layout.use": False}):
        engine = figure.get_layout_engine()
        if engine is not None:
            figure.set_dpi(plt.rcParams["savefig.dpi"])
            engine.execute(figure)
            figure.set_layout_engine(None)
        for file, name in zip(written, formats, strict=True):
            if name == "pgf":
                with measured_by_tex():
                    figure.savefig(file)
            else:
                figure.savefig(file, metadata=FORMATS[name])
    plt.close(figure)
    return written


def is_drawable(value: float | None) -> TypeGuard[float]:
    """Whether a logarithmic axis can show a value."""
    return value is not None and 0 < value < _LARGEST
