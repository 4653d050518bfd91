"""The usual compositions by name: product, series, feedback."""

from __future__ import annotations

from collections.abc import Mapping

from hybrid_model.automaton import Automaton
from hybrid_model.compose import Composition, Source
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
    wires: dict[str, Source] = {f"{second.name}.{into}": f"{first.name}.{out}" for into, out in connections.items()}
    return Composition(name, _by_name(name, (first, second)), wires)


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
    wires: dict[str, Source] = {
        **{f"{controller.name}.{into}": f"{plant.name}.{out}" for into, out in measured.items()},
        **{f"{plant.name}.{into}": f"{controller.name}.{out}" for into, out in actuated.items()},
    }
    return Composition(name, _by_name(name, (plant, controller)), wires)


def _by_name(name: str, parts: tuple[Automaton, ...]) -> dict[str, Automaton]:
    named = {part.name: part for part in parts}
    if len(named) < len(parts):
        raise WiringError(
            f"{name}: its parts are called {[part.name for part in parts]}: give each a name of its own when it is "
            "made, as in Plant('left')."
        )
    return named
