"""Where a sequence repeats itself: stretches of one period after another, found from the left to the right."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["Run", "repeated_runs"]

Keys = npt.NDArray[np.int64]
_WINDOW = 3
"""Keys in a row by which the beginning of a next repetition is recognised."""
_TRIES = 12
"""Lengths that are tried at a place, the shortest first."""


class Run(NamedTuple):
    """A stretch of a sequence: where it starts, how long a repetition is, and how many follow one another."""

    start: int
    length: int
    times: int

    @property
    def stop(self) -> int:
        """The place behind it."""
        return self.start + self.length * self.times


def repeated_runs(keys: Keys, count: int) -> list[Run]:
    """Return the stretches that repeat themselves.

    Parameters
    ----------
    keys : ndarray of int, shape (n,)
        The sequence.
    count : int
        So many repetitions, at least, are a stretch; 2 or more.

    Returns
    -------
    list of Run
        Without overlaps, in order.
    """
    following = _following(keys)
    # Numbers of Python are quicker to look at one by one.
    plain, after = keys.tolist(), following.tolist()
    runs: list[Run] = []
    place = 0
    while place < len(plain):
        run = _run_at(keys, plain, after, place, count)
        if run is None:
            place += 1
        else:
            runs.append(run)
            place = run.stop
    return runs


def _following(keys: Keys) -> Keys:
    """Return for each place the next one at which the same keys begin; the end where there is none.

    Windows that are taken for each other, of more kinds of keys than two million, are compared by whoever looks closer.
    """
    size = len(keys)
    window = np.zeros(size, dtype=np.int64)
    for k in range(_WINDOW):
        # Behind the end there is a key of its own.
        window *= keys.max(initial=0) + 2
        window[: max(0, size - k)] += keys[k:] + 1
    _, window = np.unique(window, return_inverse=True)
    order = np.argsort(window, kind="stable")
    following = np.full(size, size)
    same = window[order[1:]] == window[order[:-1]]
    following[order[:-1][same]] = order[1:][same]
    return following


def _run_at(keys: Keys, plain: list[int], after: list[int], place: int, count: int) -> Run | None:
    other = place
    for _ in range(_TRIES):
        other = after[other]
        length = other - place
        # The key at this place comes again in each of the least repetitions, before all of them are compared.
        if place + count * length > len(plain) or any(
            plain[place + k * length] != plain[place] for k in range(2, count)
        ):
            if other >= len(plain):
                return None
            continue
        least = (count - 1) * length
        if np.array_equal(keys[place : place + least], keys[other : other + least]):
            return Run(place, length, (_matched(keys, place, other, least) + length) // length)
    return None


def _matched(keys: Keys, place: int, other: int, known: int) -> int:
    """Return for how many keys the sequence goes on equally from two places, of which some are known."""
    while other + known < len(keys):
        reach = min(2 * known, len(keys) - other)
        differs = np.flatnonzero(keys[place + known : place + reach] != keys[other + known : other + reach])
        if differs.size:
            return known + int(differs[0])
        known = reach
    return known
