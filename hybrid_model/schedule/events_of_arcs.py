"""The events of a network out of the arcs of its parts, where the scheduler in Python has run it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hybrid_model.declare.composition import Composition
from hybrid_model.record.arc import HybridArc
from hybrid_model.schedule.network_events import NetworkEvents


def events_of_arcs(network: Composition, arcs: Mapping[str, HybridArc], order: Sequence[str]) -> NetworkEvents:
    """Return all jumps but breakpoints, in the order in which they were taken.

    Parameters
    ----------
    network : Composition
        What ran.
    arcs : mapping
        Part -> its arc.
    order : sequence of str
        The part that took each of them.
    """
    parts = list(network.parts.items())
    sent: list[list[str]] = [[] for _ in parts]
    numbers = {name: k for k, (name, _) in enumerate(parts)}
    for wire in network.wires:
        names = sent[numbers[wire.source]]
        if wire.output not in names:
            names.append(wire.output)
    width = max(map(len, sent), default=0)
    of_part = {
        name: iter(
            [
                (jump.t, k, jump.index, [_element(arcs[name], jump.t, jump.j + 1, output) for output in sent[k]])
                for jump in arcs[name].jumps
                if not automaton.jumps[jump.index].internal
            ]
        )
        for k, (name, automaton) in enumerate(parts)
    }
    rows = [next(of_part[name]) for name in order]
    values = np.array([row[3] + [np.nan] * (width - len(row[3])) for row in rows]).reshape(len(rows), width)
    return NetworkEvents(
        np.array([row[0] for row in rows]),
        np.array([row[1] for row in rows], np.uint32),
        np.array([row[2] for row in rows], np.uint32),
        values,
        tuple(tuple(info.name for info in automaton.jumps) for _, automaton in parts),
        np.arange(len(parts), dtype=np.uint32),
        tuple(map(tuple, sent)),
    )


def _element(arc: HybridArc, t: float, j: int, output: str) -> float:
    """Return a scalar of an arc, counted from 1 where it is one of many."""
    name, _, inside = output.partition("[")
    value = np.asarray(arc.at(name, t, j=j))
    return float(value[tuple(int(k) - 1 for k in inside.rstrip("]").split(","))] if inside else value)
