"""Outputs of a run over time as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from fmu.archives.writing import replacing

MOST_AXES = 8
"""Most axes in one picture; further signals share them."""


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
        figure, axes = plt.subplots(count, sharex=True, squeeze=False, figsize=(6.0, 1.2 + 1.1 * count))
        for k, (name, values) in enumerate(numbers.items()):
            ax = axes[k * count // max(len(numbers), 1), 0]
            ax.plot(times, [float(value) for value in values], label=name)
        for ax in axes[:, 0]:
            ax.legend(loc="upper right")
        axes[0, 0].set_title(title)
        axes[-1, 0].set_xlabel(TIME)
        if path is not None:
            with replacing(path) as part, measured_by_tex() if form == "pgf" else nullcontext():
                figure.savefig(part, format=form)
        if show:
            plt.show()
        plt.close(figure)
