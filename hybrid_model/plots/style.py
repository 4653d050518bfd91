"""What all plots share: settings of a journal, axes, and texts with units."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.typing import RcKeyType

from hybrid_model.errors import DeclarationError

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000", "#999999")
"""Colours that remain apart for colour-blind readers (Okabe and Ito, Color Universal Design, 2008)."""
JOURNAL: dict[RcKeyType, Any] = {
    # STIX for text and formulas, so that both have one weight; it comes with matplotlib.
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 9,
    "axes.labelsize": 9,
    "legend.fontsize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "lines.linewidth": 1.0,
    "axes.linewidth": 0.6,
    "axes.prop_cycle": cycler(color=COLORS),
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 300,
    "pdf.fonttype": 42,
    # matplotlib's own values: other libraries change them for the whole process (findings/pathsim-style.sh).
    "path.simplify": True,
    "path.simplify_threshold": 1 / 9,
    "agg.path.chunksize": 0,
    # No creation date and no random identifiers: the same run gives the same file.
    "svg.hashsalt": "hybrid-fmu",
}
"""Settings for ``matplotlib.rc_context``: a figure of one column of a journal."""
TIME = "time $t$ (s)"
JUMPS = "jumps $j$"


def new_axes(ax: Axes | None, *, solid: bool = False) -> Axes:
    """Return `ax`, or new axes in a new figure if there are none.

    Parameters
    ----------
    ax : Axes, optional
        Where to draw.
    solid : bool
        Whether the axes must be three-dimensional.

    Raises
    ------
    DeclarationError
        If the axes given have the wrong number of dimensions.
    """
    if ax is None:
        return plt.subplots(layout="constrained", subplot_kw={"projection": "3d"} if solid else None)[1]
    if solid != (ax.name == "3d"):
        raise DeclarationError(
            "the axes given are two-dimensional, but this plot has three dimensions: make them with "
            "plt.subplots(subplot_kw={'projection': '3d'})."
            if solid
            else "the axes given are three-dimensional, but this plot has two dimensions: give plain ones."
        )
    return ax


def equal_scales(ax: Axes) -> None:
    """Give both axes one scale; limits give way, or the box where other axes share them."""
    groups = ax.get_shared_x_axes(), ax.get_shared_y_axes()
    shared = any(len(group.get_siblings(ax)) > 1 for group in groups)
    ax.set_aspect("equal", adjustable="box" if shared else "datalim")


def unit_text(unit: str) -> str:
    """Return a unit in FMI notation as a reader expects it: ``m/s2`` with a raised 2, ``degC`` with a degree sign."""
    text = unit.replace("deg", "°") if re.fullmatch(r"deg[CF]?", unit) else unit
    return re.sub(r"(?<=[A-Za-z])-?\d+", r"$^{\g<0>}$", text).replace(".", "·")


def with_unit(text: str, unit: str) -> str:
    """Return ``text (unit)``, or the text alone for a number without unit."""
    return f"{text} ({unit_text(unit)})" if unit else text


def add_label(present: str, label: str) -> str:
    """Return the label of an axis that shows something more: two plots in one pair of axes keep both names."""
    return present if label in present.split(", ") or not label else ", ".join(filter(None, (present, label)))


def legend(ax: Axes) -> None:
    """Give axes that show more than one thing a legend, above them, where it hides no curve."""
    count = len(ax.get_legend_handles_labels()[0])
    if count > 1:
        columns = count if count < 4 else math.ceil(count / math.ceil(count / 4))
        ax.legend(
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            borderaxespad=0.3,
            ncols=columns,
            columnspacing=1.2,
            handlelength=1.4,
        )


def short_names(names: Sequence[str]) -> tuple[list[str], str]:
    """Split off what scoped names have in common at their ends.

    Parameters
    ----------
    names : sequence of str
        As in ``agent1.trigger.broadcast``, ``agent2.trigger.broadcast``.

    Returns
    -------
    names : list of str
        ``agent1``, ``agent2``.
    common : str
        ``trigger.broadcast``; empty if there is nothing in common, or one name only.
    """
    parts = [name.split(".") for name in names]
    count = 0
    if len(names) > 1:
        most = min(len(p) for p in parts) - 1
        while count < most and len({p[-1 - count] for p in parts}) == 1:
            count += 1
    return [".".join(p[: len(p) - count]) for p in parts], ".".join(parts[0][len(parts[0]) - count :]) if names else ""
