"""The union of switching graphs, and how long it takes to be connected."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hybrid_model.consensus.graphs.connectivity import is_connected
from hybrid_model.consensus.graphs.undirected import Edge
from hybrid_model.consensus.switching.base import Switching

__all__ = ["joint_connectivity_window"]


def joint_connectivity_window(
    agents: int, edges: Sequence[Edge], switching: Switching, horizon: float | None = None
) -> float | None:
    """How long one must watch, at worst, until the graphs seen have a connected union.

    Every window longer than the result contains graphs, each for some part of the time, whose union is connected; for
    no shorter length is that so. It is 0 if each graph is connected.

    Parameters
    ----------
    agents, edges : int, sequence of Edge
        The network.
    switching : Switching
        Which edges are active when.
    horizon : float, optional
        Windows begin between 0 and this time [s]. Needed for switching without a period; then windows that the end of
        the horizon cuts off are left out, unless none is complete.

    Returns
    -------
    float or None
        In s; None if the union of all graphs is not connected.

    Raises
    ------
    ValueError
        If the switching has no period and no horizon is given.

    Notes
    -----
    A window that begins in an interval sees that interval's graph, so the worst start is the beginning of an interval,
    and the wait ends where the interval begins that completes the union.
    """
    period = switching.period
    if horizon is None and period is None:
        raise ValueError("the switching has no period, so windows do not repeat; say up to which time they are wanted.")
    last = float(horizon if horizon is not None else period or 1.0)
    # Two periods hold every window that begins in the first and is at most one period long.
    end = last if period is None else last + (period or 0.0)
    cuts = [0.0, *switching.breakpoints(0.0, end).tolist(), end]
    masks = [switching.active_at((a + b) / 2) for a, b in itertools.pairwise(cuts)]
    longest: float | None = None
    for first, start in enumerate(cuts[:-1]):
        if start >= last:
            break
        wait = _wait(agents, edges, masks[first:], [cut - start for cut in cuts[first:-1]])
        if wait is None:
            return longest
        longest = max(longest or 0.0, wait)
    return longest


def _wait(agents: int, edges: Sequence[Edge], masks: Sequence[ArrayLike], starts: Sequence[float]) -> float | None:
    seen = np.zeros(len(edges), dtype=bool)
    for mask, start in zip(masks, starts, strict=True):
        seen |= np.asarray(mask, dtype=bool)
        if is_connected(agents, [edge for edge, on in zip(edges, seen, strict=True) if on]):
            return start
    return None
