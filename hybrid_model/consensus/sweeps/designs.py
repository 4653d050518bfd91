"""Designs of a sweep: which points of its axes are run."""

from __future__ import annotations

import enum
import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import qmc

from hybrid_model.consensus.sweeps.axes import MOST_RUNS, Axis, Seeds, spawned_seeds
from hybrid_model.consensus.sweeps.errors import SweepError

__all__ = ["Design", "points_of"]


class Design(enum.Enum):
    """How points are chosen."""

    GRID = "grid"
    """All combinations, the last axis the fastest."""
    RANDOM = "random"
    """Independent draws."""
    LATIN_HYPERCUBE = "latin-hypercube"
    """Draws that fill every axis evenly: M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979) 239-245."""


def points_of(axes: Sequence[Axis], design: Design, runs: int | None, repeats: int, seed: int) -> list[dict[str, Any]]:
    """Return the values of each run, key by key.

    Parameters
    ----------
    axes : sequence of Axis
        What varies.
    design : Design
        How.
    runs : int or None
        Number of points that are drawn; None for a grid, whose axes say it.
    repeats : int
        How often each point is run, for the sake of its seeds.
    seed : int
        Of the draws, and of the seeds of runs, which are two different streams.

    Raises
    ------
    SweepError
        If the arguments contradict each other.
    """
    _check(axes, design, runs, repeats)
    drawing, seeding = np.random.SeedSequence(seed).spawn(2)
    valued = [axis for axis in axes if not isinstance(axis, Seeds)]
    if design is Design.GRID:
        grids = [axis.on_grid() for axis in valued]
        _require_affordable(math.prod(map(len, grids)) * repeats)
        rows: list[tuple[Any, ...]] = list(itertools.product(*grids))
    else:
        assert runs is not None
        _require_affordable(runs * repeats)
        shares = _shares(design, len(valued), runs, np.random.default_rng(drawing))
        rows = [tuple(axis.at(share) for axis, share in zip(valued, row, strict=True)) for row in shares.tolist()]
    keys = [axis.key for axis in valued]
    points = [dict(zip(keys, row, strict=True)) for row in rows for _ in range(repeats)]
    for axis, stream in zip([axis for axis in axes if isinstance(axis, Seeds)], _streams(seeding), strict=False):
        for point, own in zip(points, spawned_seeds(stream, len(points)), strict=True):
            point[axis.key] = own
    return points


def _streams(sequence: np.random.SeedSequence) -> Any:
    while True:
        yield sequence.spawn(1)[0]


def _shares(design: Design, axes: int, runs: int, rng: np.random.Generator) -> Any:
    if axes == 0:
        return np.zeros((runs, 0))
    if design is Design.RANDOM:
        return rng.random((runs, axes))
    return qmc.LatinHypercube(axes, seed=rng).random(runs)


def _check(axes: Sequence[Axis], design: Design, runs: int | None, repeats: int) -> None:
    keys = [axis.key for axis in axes]
    double = next((key for key in keys if keys.count(key) > 1), None)
    if double is not None:
        raise SweepError(f"{double} has two axes: give it one.")
    if not axes:
        raise SweepError("nothing varies: give an axis at least, such as trigger.decay=0:0.1:11.")
    if design is Design.GRID and runs is not None:
        raise SweepError(f"runs is {runs}, but the number of runs of a grid is that of its points: leave it out.")
    if design is not Design.GRID and (runs is None or runs < 1):
        raise SweepError(f"runs is {runs}; the design '{design.value}' needs the number of points to draw, 1 or more.")
    if repeats < 1:
        raise SweepError(f"repeats is {repeats}; each point is run 1 time or more.")
    if repeats > 1 and not any(isinstance(axis, Seeds) for axis in axes):
        raise SweepError(f"repeats is {repeats}, but no axis has seeds, so all repeats would be the same run.")


def _require_affordable(count: int) -> None:
    if count > MOST_RUNS:
        raise SweepError(f"the design has {count} runs; a sweep can have at most {MOST_RUNS}.")
