"""Random sequences of graphs from a seed: random dwell times, Markov chains, jointly connected sequences.

All are drawn once, when the scenario is made, and are data from then on: every execution runs the same sequence. Only
uniform numbers in [0, 1) are taken from the generator (NumPy's PCG64), so a seed means the same sequence everywhere.
"""

import enum
import math
from bisect import bisect_right
from collections.abc import Callable, Sequence

import networkx as nx
import numpy as np

from hybrid_model.consensus.clocks.over_time import require
from hybrid_model.consensus.graphs.connectivity import is_connected
from hybrid_model.consensus.graphs.undirected import Edge
from hybrid_model.consensus.messages import shown
from hybrid_model.consensus.switching.base import validate_active
from hybrid_model.consensus.switching.sequence import SwitchingSequence

__all__ = ["Order", "jointly_connected_sequence", "markov_sequence", "random_dwell_sequence"]

_MOST_INTERVALS = 100_000

Graphs = Sequence[Sequence[int]]


class Order(enum.Enum):
    """Which graph comes next when only the dwell times are random."""

    CYCLIC = "cyclic"
    RANDOM = "random"


def random_dwell_sequence(
    active: Graphs,
    edge_count: int,
    *,
    shortest: float,
    longest: float,
    duration: float,
    seed: int,
    order: Order = Order.CYCLIC,
    repeat: bool = False,
) -> SwitchingSequence:
    """Graphs that stay for times drawn uniformly between two bounds.

    Parameters
    ----------
    active : sequence of sequence of int
        The graphs, each as the numbers of its edges, from 1.
    edge_count : int
        Number of edges of the network.
    shortest, longest : float
        Bounds of the dwell times [s]; `shortest` is the t_L of the paper's corollary.
    duration : float
        Intervals are drawn until they cover this time [s]; if the sequence repeats, the last one is cut there.
    seed : int
        Of the generator, not negative.
    order : Order
        CYCLIC goes through the graphs in turn; RANDOM takes any of the others with equal chance.
    repeat : bool
        Whether the drawn sequence repeats.

    Raises
    ------
    ValueError
        If a number is out of range.
    """
    graphs = _checked(active, edge_count)
    draw = _uniform(seed)

    def following(graph: int) -> int:
        if order is Order.CYCLIC or len(graphs) == 1:
            return (graph + 1) % len(graphs)
        return (graph + 1 + int(draw() * (len(graphs) - 1))) % len(graphs)

    return _draw(graphs, edge_count, 0, following, _dwell(shortest, longest, draw), longest, duration, repeat)


def markov_sequence(
    active: Graphs,
    edge_count: int,
    *,
    transition: Sequence[Sequence[float]],
    shortest: float,
    longest: float,
    duration: float,
    seed: int,
    first: int = 1,
    repeat: bool = False,
) -> SwitchingSequence:
    """Graphs that follow each other as the states of a Markov chain.

    Parameters
    ----------
    transition : sequence of sequence of float
        Row i: chances that graph j follows graph i; each row adds up to 1. A graph may follow itself.
    first : int
        Number, from 1, of the first graph.
    active, edge_count, shortest, longest, duration, seed, repeat
        As in `random_dwell_sequence`; equal bounds give a fixed dwell time.

    Raises
    ------
    ValueError
        If a number is out of range or the matrix is not one of chances.
    """
    graphs = _checked(active, edge_count)
    if len(transition) != len(graphs):
        raise ValueError(f"transition lists {len(transition)} rows for {len(graphs)} graphs in active; give one each.")
    for number, chances in enumerate(transition, start=1):
        if len(chances) != len(graphs):
            raise ValueError(
                f"transition[{number}] lists {len(chances)} numbers for {len(graphs)} graphs in active; give a chance "
                "for each."
            )
    matrix = np.array(transition, dtype=float)
    for number, row in enumerate(matrix, start=1):
        if not (np.all(row >= 0) and abs(row.sum() - 1) < 1e-9):
            raise ValueError(f"transition[{number}] is {shown(row.tolist())}; it must hold chances that add up to 1.")
    if not 1 <= first <= len(graphs):
        raise ValueError(f"first is {first}; graphs are numbered from 1 to {len(graphs)}.")
    draw = _uniform(seed)
    cumulative = np.cumsum(matrix, axis=1).tolist()
    # The last positive chance takes what rounding leaves of the sum.
    last = [int(np.flatnonzero(row)[-1]) for row in matrix]

    def following(graph: int) -> int:
        return min(bisect_right(cumulative[graph], draw()), last[graph])

    dwell = _dwell(shortest, longest, draw)
    return _draw(graphs, edge_count, first - 1, following, dwell, longest, duration, repeat)


def jointly_connected_sequence(
    agents: int,
    edges: Sequence[Edge],
    *,
    window: float,
    graphs: int,
    duration: float,
    seed: int,
    spare: float = 0.0,
    repeat: bool = False,
) -> SwitchingSequence:
    """Graphs whose union over each window is connected while, with two or more graphs a window, none of them need be.

    In each window a random spanning tree of the network is drawn and its edges are dealt out to the window's graphs;
    each further edge joins each graph with the chance `spare`.

    Parameters
    ----------
    agents : int
        Number of agents.
    edges : sequence of Edge
        The network's edges.
    window : float
        Length [s] of the windows ``[j*window, (j + 1)*window)``.
    graphs : int
        Number of graphs in each window; they stay for random times, each at least half of ``window/graphs``.
    duration : float
        Windows are drawn until they cover this time [s].
    seed : int
        Of the generator, not negative.
    spare : float
        Chance from 0 to 1.
    repeat : bool
        Whether the sequence repeats, after a whole number of windows.

    Raises
    ------
    ValueError
        If a number is out of range or the network itself is not connected.

    Notes
    -----
    This is the hypothesis of the paper's corollary in section 6, with intervals of one length.
    """
    if not is_connected(agents, edges):
        raise ValueError("the network's graph is not connected, so no union of its subgraphs is; add edges.")
    require("window", window, window > 0, "must be positive")
    if not 1 <= graphs <= _MOST_INTERVALS:
        raise ValueError(f"graphs is {shown(graphs)}; it must be at least 1 and at most {_MOST_INTERVALS}.")
    require("spare", spare, 0 <= spare <= 1, "must lie between 0 and 1")
    require("duration", duration, duration > 0, "must be positive")
    if duration * graphs > _MOST_INTERVALS * window:
        raise ValueError(
            f"window is {window} s for a duration of {duration} s and graphs is {graphs}, which makes more than "
            f"{_MOST_INTERVALS} graphs; choose a longer window, fewer graphs or a shorter duration."
        )
    count = max(1, math.ceil(duration / window - 1e-9))
    draw = _uniform(seed)
    dwells: list[float] = []
    active: list[tuple[int, ...]] = []
    begin = 0.0
    for number in range(1, count + 1):
        tree = _random_tree(edges, draw)
        place = {edge: int(draw() * graphs) for edge in tree}
        for graph in range(graphs):
            chosen = [
                e for e in range(1, len(edges) + 1) if place.get(e) == graph or (e not in place and draw() < spare)
            ]
            active.append(tuple(chosen))
        shares = np.array([draw() for _ in range(graphs)])
        lengths = window / graphs * (0.5 + 0.5 * graphs * (shares + 1e-9) / (shares + 1e-9).sum())
        # The last one ends with the window, to the last digit.
        begin = sum(lengths[:-1].tolist(), begin)
        dwells += [*lengths[:-1].tolist(), number * window - begin]
        begin += dwells[-1]
    sequence = SwitchingSequence(tuple(dwells), tuple(active), len(edges), repeat)
    _check_unions(sequence, agents, edges, graphs)
    return sequence


def _check_unions(sequence: SwitchingSequence, agents: int, edges: Sequence[Edge], graphs: int) -> None:
    for begin in range(0, len(sequence.active), graphs):
        union = sorted({edge for row in sequence.active[begin : begin + graphs] for edge in row})
        if not is_connected(agents, [edges[edge - 1] for edge in union]):
            raise ValueError(f"the union of graphs {begin + 1} to {begin + graphs} is not connected: edges {union}.")


def _random_tree(edges: Sequence[Edge], draw: Callable[[], float]) -> list[int]:
    """Edge numbers of the spanning tree that is least for random edge weights."""
    graph = nx.Graph()
    for number, (tail, head) in enumerate(edges, start=1):
        graph.add_edge(tail, head, number=number, weight=draw())
    return sorted(data["number"] for _, _, data in nx.minimum_spanning_edges(graph, data=True))


def _draw(
    graphs: tuple[tuple[int, ...], ...],
    edge_count: int,
    first: int,
    following: Callable[[int], int],
    dwell: Callable[[], float],
    longest: float,
    duration: float,
    repeat: bool,
) -> SwitchingSequence:
    require("duration", duration, duration > 0, "must be positive")
    if duration > _MOST_INTERVALS * longest:
        raise _too_many(duration)
    dwells: list[float] = []
    active: list[tuple[int, ...]] = []
    graph, total = first, 0.0
    while total < duration:
        length = dwell()
        if repeat:
            length = min(length, duration - total)
        dwells.append(length)
        active.append(graphs[graph])
        total += length
        graph = following(graph)
        if len(dwells) > _MOST_INTERVALS:
            raise _too_many(duration)
    return SwitchingSequence(tuple(dwells), tuple(active), edge_count, repeat)


def _too_many(duration: float) -> ValueError:
    return ValueError(
        f"duration is {duration:.6g} s, for which more than {_MOST_INTERVALS} intervals are drawn; choose it "
        "shorter, or longer intervals (shortest, longest)."
    )


def _dwell(shortest: float, longest: float, draw: Callable[[], float]) -> Callable[[], float]:
    require("shortest", shortest, shortest > 0, "must be positive")
    require("longest", longest, longest >= shortest, f"must be at least shortest, {shortest}")
    return lambda: shortest + (longest - shortest) * draw()


def _uniform(seed: int) -> Callable[[], float]:
    if seed < 0:
        raise ValueError(f"seed is {shown(seed)}; it must not be negative.")
    generator = np.random.Generator(np.random.PCG64(seed))
    return lambda: float(generator.random())


def _checked(active: Graphs, edge_count: int) -> tuple[tuple[int, ...], ...]:
    graphs = tuple(tuple(graph) for graph in active)
    validate_active(graphs, edge_count)
    return graphs
