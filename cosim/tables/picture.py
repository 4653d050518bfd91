"""Outputs of a run over time as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from fmu.archives.writing import replacing

MOST_AXES = 8
"""Most axes in one picture; further signals share them."""
BESIDE = 3
"""Names of signals in one line above their axes."""


def draw(
    times: Sequence[float], signals: Mapping[str, Sequence[Any]], title: str, path: Path | None, *, show: bool
) -> None:
    """Draw all outputs that are numbers, one below the other; jumps are vertical lines.

    Parameters
    ----------
    times : sequence of float
        In s.
    signals : mapping
        Name -> values.
    title : str
    path : Path, optional
        Where to write it; the suffix chooses the format.
    show : bool
        Whether to open a window.

    Raises
    ------
    DataError
        For PGF where there is no TeX that can write it.
    """
    # matplotlib is imported by whoever draws.
    import matplotlib.pyplot as plt

    from hybrid_model.plots.style import JOURNAL, TIME
    from hybrid_model.plots.tex import measured_by_tex

    form = path.suffix[1:].lower() if path is not None else ""
    numbers = {name: values for name, values in signals.items() if values and not isinstance(values[0], (str, bytes))}
    count = max(min(len(numbers), MOST_AXES), 1)
    with plt.rc_context(JOURNAL):
        figure, axes = plt.subplots(count, sharex=True, squeeze=False, figsize=(6.0, 1.2 + 1.3 * count))
        shared: list[dict[str, Sequence[Any]]] = [{} for _ in range(count)]
        for k, (name, values) in enumerate(numbers.items()):
            shared[k * count // len(numbers)][name] = values
        for ax, some in zip(axes[:, 0], shared, strict=True):
            _curves(ax, times, some)
        figure.suptitle(title)
        axes[-1, 0].set_xlabel(TIME)
        if path is not None:
            with replacing(path) as part, measured_by_tex() if form == "pgf" else nullcontext():
                figure.savefig(part, format=form)
        if show:
            plt.show()
        plt.close(figure)


def _curves(ax: Any, times: Sequence[float], signals: Mapping[str, Sequence[Any]]) -> None:
    from matplotlib.ticker import MaxNLocator

    whole = {name: isinstance(values[0], int) for name, values in signals.items()}
    for name, values in signals.items():
        # Whole numbers have no values between two, where there is one row of a jump neither.
        drawn = "steps-post" if whole[name] else "default"
        ax.plot(times, [float(value) for value in values], label=name, drawstyle=drawn)
    if signals and all(whole.values()):
        ax.yaxis.set_major_locator(MaxNLocator(nbins=5, integer=True, min_n_ticks=1))
        if len(set().union(*signals.values())) == 1:
            ax.margins(y=10.0)  # of a range that is next to nothing
    if signals:
        # Above the axes, where no curve is.
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=BESIDE, borderaxespad=0.1)
