"""Who hears whom in a network, as two columns: from a matrix, a graph, or the columns themselves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from hybrid_model.errors import WiringError

Whole = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Links:
    """Links from senders to receivers, ordered by receivers.

    Attributes
    ----------
    count : int
        Number of parts.
    receivers, senders : ndarray of int, shape (links,)
        Numbers of the parts, from 0.
    order : ndarray of int, shape (links,)
        Where each of them was in what was given, so that a column given with it can be ordered alike.
    """

    count: int
    receivers: Whole
    senders: Whole
    order: Whole

    @property
    def degrees(self) -> Whole:
        """How many links each part receives over."""
        return np.bincount(self.receivers, minlength=self.count)

    @property
    def first(self) -> Whole:
        """Where the links of each part begin, and the number of all."""
        return np.concatenate([[0], np.cumsum(self.degrees)])


def links_of(given: Any, count: int | None = None) -> Links:
    """Read who hears whom.

    Parameters
    ----------
    given : scipy sparse matrix, networkx graph, or (receivers, senders)
        A matrix has an entry in row i and column j where part i receives from part j; a graph's edges are heard in both
        directions, those of a directed graph by the node that they lead to; its nodes are numbered in their order.
        Links of one receiver stay in the order in which they are given: that of the columns of a matrix.
    count : int, optional
        Number of parts, where two columns are given.

    Raises
    ------
    WiringError
        For what is none of these, a matrix that is not square, or numbers of no part.
    """
    if hasattr(given, "tocoo"):
        matrix = given.tocsr()
        if matrix.shape[0] != matrix.shape[1]:
            raise WiringError(f"the matrix of a network has shape {matrix.shape}: give one row and column a part.")
        matrix.sort_indices()
        pairs = matrix.tocoo()
        count, receivers, senders = matrix.shape[0], pairs.row, pairs.col
    elif hasattr(given, "number_of_nodes"):
        numbers = {node: k for k, node in enumerate(given.nodes)}
        ends = np.array([(numbers[a], numbers[b]) for a, b in given.edges()], np.int64).reshape(-1, 2)
        both = ends if given.is_directed() else np.concatenate([ends, ends[:, ::-1]])
        count, receivers, senders = len(numbers), both[:, 1], both[:, 0]
    elif isinstance(given, tuple) and len(given) == 2:
        receivers, senders = (np.asarray(column) for column in given)
    else:
        raise WiringError(
            f"who hears whom is given as {type(given).__name__}: give a scipy sparse matrix, a networkx graph, or two "
            "arrays, (receivers, senders)."
        )
    return _ordered(np.asarray(receivers), np.asarray(senders), count)


def _ordered(receivers: npt.NDArray[Any], senders: npt.NDArray[Any], count: int | None) -> Links:
    whole = all(np.issubdtype(column.dtype, np.integer) or not column.size for column in (receivers, senders))
    if not whole or receivers.ndim != 1 or receivers.shape != senders.shape:
        raise WiringError(
            f"receivers have shape {receivers.shape} and senders {senders.shape}: give the whole numbers of parts, "
            "from 0, one receiver and one sender a link."
        )
    if count is None:
        count = int(max([-1, *(column.max() for column in (receivers, senders) if column.size)])) + 1
    for column in (receivers, senders):
        if column.size and not (column.min() >= 0 and column.max() < count):
            wrong = int(column.min() if column.min() < 0 else column.max())
            raise WiringError(f"a link names part {wrong}, but parts are numbered from 0 to {count - 1}.")
    order = np.argsort(receivers, kind="stable")
    return Links(count, receivers[order].astype(np.int64), senders[order].astype(np.int64), order)
