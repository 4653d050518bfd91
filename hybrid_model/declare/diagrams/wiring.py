"""The usual compositions by name: product, series, parallel, feedback."""

from __future__ import annotations

from collections.abc import Mapping

from hybrid_model.declare.automaton import Automaton, require_automaton
from hybrid_model.declare.calls import explained
from hybrid_model.declare.composition import Composition, Source
from hybrid_model.declare.diagrams.operators import in_feedback, in_parallel, in_series
from hybrid_model.declare.real_numbers import told
from hybrid_model.errors import WiringError


@explained(WiringError)
def product(name: str, *parts: Automaton) -> Composition:
    """Compose parts that do not see each other, under their own names.

    Parameters
    ----------
    name : str
        Name of the composition.
    *parts : Automaton
        Of different names; their order is the order of simultaneous jumps.

    Raises
    ------
    WiringError
        If two parts have one name.
    """
    return Composition(name, _by_name(name, parts))


@explained(WiringError)
def series(name: str, first: Automaton, second: Automaton, connections: Mapping[str, str] | None = None) -> Composition:
    """Compose two parts of which the first drives the second.

    Parameters
    ----------
    name : str
        Name of the composition.
    first, second : Automaton
        Of different names.
    connections : mapping, optional
        Input of `second` -> output of `first`. Default: as many, in the order of their declarations, which is what
        ``second * first`` does.

    Raises
    ------
    WiringError
        As in `Composition`, and if both parts have one name.
    """
    parts = _by_name(name, (first, second))
    if connections is None:
        return in_series(name, first, second)
    return Composition(name, parts, _wires(name, second, first, connections))


@explained(WiringError)
def parallel(name: str, first: Automaton, second: Automaton) -> Composition:
    """Compose two parts that have the same inputs and whose outputs are added, as ``first + second`` does.

    Parameters
    ----------
    name : str
        Name of the composition.
    first, second : Automaton
        Of different names, with as many inputs and outputs, which are joined in the order of their declarations.

    Raises
    ------
    WiringError
        As in `Composition`, and if both have one name, or not as many signals.
    """
    _by_name(name, (first, second))
    return in_parallel(name, first, second)


@explained(WiringError)
def feedback(
    name: str,
    plant: Automaton,
    controller: Automaton,
    measured: Mapping[str, str] | None = None,
    actuated: Mapping[str, str] | None = None,
    *,
    sign: float = -1.0,
) -> Composition:
    """Close the loop of a plant and a controller.

    Parameters
    ----------
    name : str
        Name of the composition.
    plant, controller : Automaton
        Of different names; the plant's simultaneous jumps come first.
    measured, actuated : mapping, optional
        Input of `controller` -> output of `plant`, and input of `plant` -> output of `controller`. Default: as
        ``control.feedback``, signals are joined in the order of their declarations, and the plant is driven by a
        reference, an input of the loop, plus `sign` times the controller's output.
    sign : float
        Of the feedback where no wires are named; with wires named, signals arrive as they are.

    Raises
    ------
    WiringError
        As in `Composition`, and if both parts have one name.
    AlgebraicLoopError
        If measured and actuated signals need each other at one instant.
    """
    parts = _by_name(name, (plant, controller))
    if measured is None and actuated is None:
        return in_feedback(name, plant, controller, sign)
    if measured is None or actuated is None:
        raise WiringError(f"{name}: name the wires both ways, measured and actuated, or leave both out.")
    wires = _wires(name, controller, plant, measured) | _wires(name, plant, controller, actuated)
    return Composition(name, parts, wires)


def _wires(name: str, into: Automaton, source: Automaton, connections: Mapping[str, str]) -> dict[str, Source]:
    if not isinstance(connections, Mapping):
        raise WiringError(
            f"{name}: the connections are {told(connections)}: give a mapping, {{'input of {into.name}': 'output of "
            f"{source.name}'}}."
        )
    return {f"{into.name}.{target}": f"{source.name}.{output}" for target, output in connections.items()}


def _by_name(name: str, parts: tuple[Automaton, ...]) -> dict[str, Automaton]:
    for part in parts:
        _require_part(name, part)
    named = {part.name: part for part in parts}
    if len(named) < len(parts):
        raise WiringError(
            f"{name}: its parts are called {[part.name for part in parts]}: give each a name of its own when it is "
            "made, as in Plant('left')."
        )
    return named


def _require_part(name: str, given: object) -> None:
    if isinstance(given, Mapping):
        raise WiringError(f"{name}: a part is a mapping: for parts by other names than their own write hm.Composition.")
    if isinstance(given, (list, tuple)):
        raise WiringError(f"{name}: a part is {told(given)}: give automata one after the other, or *parts for a list.")
    require_automaton(given)
