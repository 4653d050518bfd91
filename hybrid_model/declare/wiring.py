"""The usual compositions by name: product, series, feedback."""

from __future__ import annotations

from collections.abc import Mapping

from hybrid_model.declare.automaton import Automaton, require_automaton
from hybrid_model.declare.composition import Composition, Source
from hybrid_model.declare.real_numbers import told
from hybrid_model.errors import WiringError


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


def series(name: str, first: Automaton, second: Automaton, connections: Mapping[str, str]) -> Composition:
    """Compose two parts of which the first drives the second.

    Parameters
    ----------
    name : str
        Name of the composition.
    first, second : Automaton
        Of different names.
    connections : mapping
        Input of `second` -> output of `first`.

    Raises
    ------
    WiringError
        As in `Composition`, and if both parts have one name.
    """
    parts = _by_name(name, (first, second))
    return Composition(name, parts, _wires(name, second, first, connections))


def feedback(
    name: str, plant: Automaton, controller: Automaton, measured: Mapping[str, str], actuated: Mapping[str, str]
) -> Composition:
    """Close the loop of a plant and a controller.

    Parameters
    ----------
    name : str
        Name of the composition.
    plant, controller : Automaton
        Of different names; the plant's simultaneous jumps come first.
    measured : mapping
        Input of `controller` -> output of `plant`.
    actuated : mapping
        Input of `plant` -> output of `controller`.

    Raises
    ------
    WiringError
        As in `Composition`, and if both parts have one name.
    AlgebraicLoopError
        If measured and actuated signals need each other at one instant.
    """
    parts = _by_name(name, (plant, controller))
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
