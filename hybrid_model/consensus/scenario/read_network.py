"""The table ``[network]`` of a scenario file: edges in a list or by a family of graphs, start values likewise."""

from __future__ import annotations

import numpy as np

from hybrid_model.consensus.entries import Entries
from hybrid_model.consensus.graphs.generators import GraphKind, graph_of_kind
from hybrid_model.consensus.graphs.undirected import Edge
from hybrid_model.consensus.messages import ScenarioError, shown
from hybrid_model.consensus.scenario.definition import Network, Underlying
from hybrid_model.consensus.scenario.formulas import FormulaError, formula_values

KEYS = ("agents", "edges", "graph", "degree", "seed", "rewiring", "initial", "gain", "underlying")
_OF_GRAPH = ("degree", "seed", "rewiring")
_DRAWN = {"uniform": ("low", "high"), "normal": ("mean", "deviation")}


def read_network(table: Entries) -> Network:
    """Read the network.

    Parameters
    ----------
    table : Entries
        With some of `KEYS`.

    Raises
    ------
    ScenarioError
        If a key is missing, or a value has the wrong type or is out of range; the message names it.
    """
    agents = table.whole_number("agents")
    return Network(
        agents=agents,
        edges=_drawn_edges(table, agents) if "graph" in table else _listed_edges(table),
        initial=_initial(table, agents),
        gain=table.number("gain", default=1.0),
        underlying=table.choice("underlying", Underlying, default=Underlying.LISTED),
    )


def _listed_edges(table: Entries) -> tuple[Edge, ...]:
    for key in _OF_GRAPH:
        if key in table:
            raise ScenarioError(f"{table.name} {key} belongs to a graph that is drawn; give graph, or leave it out.")
    edges = table.whole_number_lists("edges")
    for number, edge in enumerate(edges, start=1):
        if len(edge) != 2:
            raise table.error(f"edges[{number}]", list(edge), "must be a pair of agents, such as [1, 2]")
    return tuple((edge[0], edge[1]) for edge in edges)


def _drawn_edges(table: Entries, agents: int) -> tuple[Edge, ...]:
    if "edges" in table:
        raise ScenarioError(f"{table.name} has both edges and a graph; leave one out.")
    kind = table.choice("graph", GraphKind)
    seed = table.whole_number("seed") if "seed" in table else 0
    degree, rewiring = table.number("degree", default=4.0), table.number("rewiring", default=0.1)
    try:
        return graph_of_kind(kind, agents, degree, seed, rewiring=rewiring).edges
    except ValueError as error:
        raise ScenarioError(f"{table.name} graph: {error}") from None


def _initial(table: Entries, agents: int) -> tuple[float, ...]:
    """Start values: a list, a formula of the agent's number i, or drawn."""
    given = table.raw("initial", "must be a list of numbers, a formula of the agent's number i, or a table")
    if isinstance(given, str):
        try:
            return tuple(formula_values(given, {"i": np.arange(1.0, agents + 1.0), "n": float(agents)}, agents))
        except FormulaError as error:
            raise ScenarioError(f"{table.name} initial is {shown(given)}; {error}") from None
    if not isinstance(given, dict):
        return table.numbers("initial")
    name = f"{table.name} initial"
    kind = Entries(name, given, given).text("draw")
    if kind not in _DRAWN:
        raise ScenarioError(f"{name}: draw is {shown(kind)}; it must be one of 'uniform', 'normal'.")
    numbers = Entries(name, given, ("draw", "seed", *_DRAWN[kind]))
    first, second = (numbers.number(key) for key in _DRAWN[kind])
    least = first if kind == "uniform" else 0.0
    if second < least:
        raise ScenarioError(f"{name}: {_DRAWN[kind][1]} is {second:g}; it must be at least {least:g}.")
    seed = numbers.whole_number("seed") if "seed" in numbers else 0
    if seed < 0:
        raise ScenarioError(f"{name}: seed is {seed}; it must not be negative.")
    rng = np.random.default_rng(seed)
    draw = rng.uniform if kind == "uniform" else rng.normal
    return tuple(draw(first, second, agents).tolist())
