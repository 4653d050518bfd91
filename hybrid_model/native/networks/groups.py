"""Groups of parts with equal maps: what is equal becomes one function, constants that differ become its argument.

Two parts have equal maps if their traced functions are the same list of instructions up to the values of constants.
"""

from __future__ import annotations

import functools
import itertools
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.native.held_factors import HeldFactors, held_factors
from hybrid_model.native.trace import Trace, changed

Structure = tuple[object, ...]
_ARGUMENTS = ("t", "x", "z", "u", "p")
_KINDS = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)


@dataclass(frozen=True, eq=False)
class Group:
    """Parts with equal maps.

    Attributes
    ----------
    number : int
        Of the group in the network.
    traced : Trace
        Of one of its members.
    members : tuple of int
        Numbers of the members in the network.
    constants : ndarray of float, shape (members, constants)
        Constants in which the members differ.
    maps : dict
        Name -> casadi.Function of t, x, z, u, p and the constants: ``start``, ``flow``, ``flow_set``, ``margins``,
        ``times``, ``outputs``, and ``reset0``, ``reset1``, ...
    """

    number: int
    traced: Trace
    members: tuple[int, ...]
    constants: FloatArray
    maps: dict[str, ca.Function]

    @property
    def sizes(self) -> dict[Kind, int]:
        """Number of elements of each kind."""
        return self.traced.layout.sizes

    @functools.cached_property
    def starts(self) -> bool:
        """Whether some start value is computed."""
        return self.changes("start", Kind.STATE) or self.changes("start", Kind.DISCRETE)

    @functools.cached_property
    def factors(self) -> HeldFactors | None:
        """What the rates are affine in; the constants lie behind the parameters."""
        return held_factors(self.maps["flow"], f"group{self.number}_factors")

    def changes(self, name: str, kind: Kind) -> bool:
        """Whether a map that gives new states changes those of a kind."""
        return bool(changed(self.maps[name], kind))

    @functools.cache  # noqa: B019 - groups live as long as their network
    def rows(self, name: str, result: int, argument: int) -> tuple[tuple[int, ...], ...]:
        """Elements of an argument on which each element of a map's result depends."""
        pattern = self.maps[name].jac_sparsity(result, argument)
        found: list[list[int]] = [[] for _ in range(self.maps[name].size1_out(result))]
        for row, column in zip(*pattern.get_triplet(), strict=True):
            found[row].append(column)
        return tuple(tuple(sorted(columns)) for columns in found)

    def columns(self, name: str, result: int, argument: int) -> list[int]:
        """Elements of an argument on which any element of a map's result depends."""
        return sorted({column for row in self.rows(name, result, argument) for column in row})


def grouped(traces: Sequence[Trace], alike: Sequence[int]) -> list[Group]:
    """Put parts with equal maps into groups.

    Parameters
    ----------
    traces : sequence of Trace
        Traced parts, all different objects.
    alike : sequence of int
        For each member of the network, the number of the trace that is also its own.

    Returns
    -------
    list of Group
        In the order of their first members.
    """
    read = [_read(traced) for traced in traces]
    kinds: dict[Structure, list[int]] = {}
    for member, number in enumerate(alike):
        kinds.setdefault(read[number][0], []).append(member)
    groups = []
    for number, members in enumerate(kinds.values()):
        table = np.array([read[alike[member]][1] for member in members], dtype=np.float64).reshape(len(members), -1)
        traced = traces[alike[members[0]]]
        maps, constants = _lifted(traced, table)
        groups.append(Group(number, traced, tuple(members), constants, maps))
    return groups


def _named_functions(traced: Trace) -> dict[str, ca.Function]:
    names = ("start", "flow", "flow_set", "margins", "times", "outputs")
    resets = {f"reset{k}": function for k, function in enumerate(traced.resets)}
    return {name: getattr(traced, name) for name in names} | resets


def _read(traced: Trace) -> tuple[Structure, list[float]]:
    """Return what is the same in equal maps, and the constants in order."""
    automaton = traced.automaton
    structure: list[object] = [traced.layout.sizes[kind] for kind in Kind]
    structure += [automaton.has_flow_set, *((info.trigger, info.internal) for info in automaton.jumps)]
    constants: list[float] = []
    for function in _named_functions(traced).values():
        instructions: list[object] = []
        for k in range(function.n_instructions()):
            operation = function.instruction_id(k)
            instructions += (operation, *function.instruction_output(k))
            if operation == ca.OP_CONST:
                constants.append(function.instruction_constant(k))
            else:
                instructions += function.instruction_input(k)
        structure.append(tuple(instructions))
    return tuple(structure), constants


def _lifted(traced: Trace, table: FloatArray) -> tuple[dict[str, ca.Function], FloatArray]:
    """Rebuild the maps with an argument for the constants that differ; columns of equal numbers share a place."""
    places: dict[bytes, int] = {}
    columns: list[FloatArray] = []
    place_of: list[int | None] = []
    for column in table.T:
        bits = [struct.pack("d", value) for value in column]
        if len(set(bits)) == 1:
            place_of.append(None)
            continue
        key = b"".join(bits)
        if key not in places:
            places[key] = len(columns)
            columns.append(column)
        place_of.append(places[key])
    sizes = [1, *(traced.layout.sizes[kind] for kind in _KINDS), len(columns)]
    arguments = [ca.SX.sym(name, size) for name, size in zip((*_ARGUMENTS, "c"), sizes, strict=True)]
    constant = iter(place_of)
    maps = {}
    for name, function in _named_functions(traced).items():
        results = _rebuilt(function, arguments, lambda value: _constant(value, next(constant), arguments[-1]))
        maps[name] = ca.Function(name, arguments, results)
    return maps, np.stack(columns, axis=1) if columns else np.zeros((len(table), 0))


def _constant(value: float, place: int | None, lifted: ca.SX) -> ca.SX:
    return ca.SX(value) if place is None else lifted[place]


def _rebuilt(function: ca.Function, arguments: Sequence[ca.SX], constant: Callable[[float], ca.SX]) -> list[ca.SX]:
    """Run the instructions of a function on symbols."""
    results = [ca.SX.zeros(function.size1_out(k), 1) for k in range(function.n_out())]
    work: dict[int, ca.SX] = {}
    for k in range(function.n_instructions()):
        operation, into = function.instruction_id(k), function.instruction_output(k)
        if operation == ca.OP_CONST:
            work[into[0]] = constant(function.instruction_constant(k))
            continue
        given = function.instruction_input(k)
        if operation == ca.OP_INPUT:
            work[into[0]] = arguments[given[0]][given[1]]
        elif operation == ca.OP_OUTPUT:
            results[into[0]][into[1]] = work[given[0]]
        elif len(given) == 1:
            work[into[0]] = ca.SX.unary(operation, work[given[0]])
        else:
            work[into[0]] = ca.SX.binary(operation, work[given[0]], work[given[1]])
    return results


def forward(function: ca.Function, name: str) -> ca.Function:
    """Return the function of a map's arguments and the tangents of t, x, z, u, p that gives those of its results."""
    arguments, results = _opened(function)
    seeds = [ca.SX.sym(f"d{name}", given.shape[0]) for name, given in zip(_ARGUMENTS, arguments, strict=False)]
    at, along = ca.vertcat(*arguments[:5]), ca.vertcat(*seeds)
    tangents = [ca.densify(ca.jtimes(result, at, along)) for result in results]
    return ca.Function(name, [*arguments, *seeds], tangents)


def reverse(function: ca.Function, name: str) -> ca.Function:
    """Return the function of a map's arguments and the adjoints of its results that gives those of t, x, z, u, p."""
    arguments, results = _opened(function)
    seeds = [ca.SX.sym(f"a{k}", result.shape[0]) for k, result in enumerate(results)]
    at, result, seed = ca.vertcat(*arguments[:5]), ca.vertcat(*results), ca.vertcat(*seeds)
    adjoint = ca.densify(ca.jtimes(result, at, seed, True))
    ends = np.cumsum([0, *(argument.shape[0] for argument in arguments[:5])])
    parts = [adjoint[int(begin) : int(end)] for begin, end in itertools.pairwise(ends)]
    return ca.Function(name, [*arguments, *seeds], parts)


def sliced(function: ca.Function, first: int, count: int, name: str) -> ca.Function:
    """Return the function that gives some consecutive elements of a map's only result."""
    arguments, (result,) = _opened(function)
    return ca.Function(name, arguments, [result[first : first + count]])


def _opened(function: ca.Function) -> tuple[list[ca.SX], list[ca.SX]]:
    arguments = [ca.SX.sym(name, function.size1_in(k)) for k, name in enumerate((*_ARGUMENTS, "c"))]
    return arguments, list(function.call(arguments))
