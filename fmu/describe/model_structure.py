"""ModelStructure of an FMU: its unknowns, what each depends on and how, the same for both versions of the standard.

Discrete outputs depend on what decides about the next jump as well: in Event Mode they show its outcome.

What is listed as known (3.0, section 2.4.8; 2.0, section 2.2.8): while the FMU runs inputs, continuous states, time,
and, in FMI 3.0, tunable parameters; in Initialization Mode inputs, time, and everything whose start value can be set.
Fixed parameters do not change while it runs, and nobody outside can change discrete states, so they are left out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from scipy import sparse

from fmu.describe.variables import Bank, FmiType, FmuVariable
from hybrid_model.declare.transitions import Priority, Trigger
from hybrid_model.declare.variables import Kind
from hybrid_model.native.event_dependencies import after_jumps
from hybrid_model.native.factors import Factor, factors

Matrix: TypeAlias = Any  # scipy.sparse.csr_array of int
"""Elements of a result by elements of all arguments side by side; `Factor` + 1 where one depends on the other."""
_ARGUMENTS = {"t": Bank.TIME, "x": Bank.STATE, "z": Bank.DISCRETE, "u": Bank.INPUT, "p": Bank.PARAMETER}
_MAPS = ("flow", "outputs", "margins", "flow_set")
_EVENTS = ("z after", "outputs after")


@dataclass(frozen=True)
class Unknown:
    """An entry of ModelStructure.

    Attributes
    ----------
    variable : int
        Position in the table of variables.
    dependencies : tuple of int
        Positions of the knowns that it depends on, ascending.
    kinds : tuple of str or None
        How it depends on each: dependent, constant, fixed, tunable or discrete; None if the trace does not tell.
    """

    variable: int
    dependencies: tuple[int, ...] = ()
    kinds: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Structure:
    """The lists of ModelStructure; see the FMI standard 3.0, section 2.4.8."""

    outputs: tuple[Unknown, ...]
    derivatives: tuple[Unknown, ...]
    initial: tuple[Unknown, ...]
    indicators: tuple[Unknown, ...]


def model_structure(traced: Any, variables: Sequence[FmuVariable]) -> Structure:
    """Find the unknowns of an FMU and their dependencies, in time linear in the number of dependencies.

    Parameters
    ----------
    traced : Trace
        Patterns of the maps (``pattern(result, argument)``), and the maps themselves if they are scalar expressions.
    variables : sequence of FmuVariable
        In the order of their value references.

    Returns
    -------
    Structure
        Outputs and indicators in the order of the table, derivatives in the order of the state vector.
    """
    maps = _Maps(traced)
    moving = [v.tunable or v.bank in (Bank.TIME, Bank.INPUT, Bank.STATE) for v in variables]
    running = maps.dependencies(variables, moving)
    settable = [v.bank in (Bank.TIME, Bank.INPUT) or v.initial == "exact" for v in variables]
    # Parameters and discrete states are knowns at the start: a factor that holds one is not a fixed factor there.
    starting = maps.at_start().dependencies(variables, settable, kept=(Factor.CONSTANT,))
    of_bank = {bank: [k for k, v in enumerate(variables) if v.bank is bank] for bank in Bank}
    derivatives = sorted(of_bank[Bank.DERIVATIVE], key=lambda k: variables[k].index)
    initial = [k for k, v in enumerate(variables) if v.calculated and _starts_unknown(v)]
    return Structure(
        outputs=tuple(running[k] for k, v in enumerate(variables) if v.causality == "output"),
        derivatives=tuple(running[k] for k in derivatives),
        initial=tuple(starting[k] for k in initial),
        indicators=tuple(running[k] for k in of_bank[Bank.INDICATOR]),
    )


def _starts_unknown(variable: FmuVariable) -> bool:
    """Whether a computed start value makes an InitialUnknown: of outputs, continuous states and their derivatives."""
    return variable.causality == "output" or variable.bank in (Bank.STATE, Bank.DERIVATIVE)


class _Maps:
    """The dependencies of all maps of a trace, as rows of one matrix; `heights` has the number of rows of each map."""

    def __init__(self, traced: Any) -> None:
        self.traced = traced
        self.told = all(_scalar(getattr(traced, name, None)) for name in (*_MAPS, "start"))
        jumps = [k for k, info in enumerate(traced.automaton.jumps) if info.trigger is Trigger.STATE]
        self.margins = {jump: number for number, jump in enumerate(jumps)}
        sizes = traced.layout.sizes
        kinds = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)
        self.ends = np.cumsum([0, 1, *(sizes[kind] for kind in kinds)])
        self.begins = dict(zip(_ARGUMENTS.values(), self.ends[:-1].tolist(), strict=True))
        parts = {name: self._row(name) for name in _MAPS}
        parts |= {name: self._itself(name) for name in ("t", "x", "z")}
        parts |= self._events(parts)
        self.heights = {name: int(part.shape[0]) for name, part in parts.items()}
        self.matrix = sparse.csr_array(sparse.vstack(list(parts.values())))

    def at_start(self) -> _Maps:
        """Return the dependencies at the start, where computed states come out of the start map."""
        computed = [self._row("start_x"), self._row("start_z")]
        through = [self._itself("t"), *computed, self._itself("u"), self._itself("p")]
        chain = sparse.csr_array(sparse.vstack(through))
        start: _Maps = object.__new__(_Maps)
        start.traced, start.told, start.margins = self.traced, self.told, self.margins
        start.ends, start.begins = self.ends, self.begins
        # Events are the last rows.
        start.heights = {name: height for name, height in self.heights.items() if name not in _EVENTS}
        start.matrix = _chained(self.matrix[: sum(start.heights.values())], chain)
        return start

    def _events(self, parts: Mapping[str, Matrix]) -> dict[str, Matrix]:
        """Return what discrete states and outputs depend on in Event Mode by way of the jump that comes next."""
        after = after_jumps(self.traced, parts["margins"], parts["flow_set"])
        outputs = (parts["outputs"] != 0).astype(np.int64)
        columns = (self._columns(Bank.STATE), self._columns(Bank.DISCRETE))
        by_states = [outputs[:, at] @ after[kind].astype(np.int64) for at, kind in zip(columns, after, strict=True)]
        found = {"z after": after[Kind.DISCRETE], "outputs after": by_states[0] + by_states[1]}
        return {name: (matrix != 0).astype(np.int64) * (Factor.DEPENDENT + 1) for name, matrix in found.items()}

    def _columns(self, bank: Bank) -> slice:
        number = list(_ARGUMENTS.values()).index(bank)
        return slice(int(self.ends[number]), int(self.ends[number + 1]))

    def _row(self, result: str) -> Matrix:
        if self.told:
            name, _, part = result.partition("_") if result.startswith("start_") else (result, "", "x")
            parameters = self.traced.layout.places[Kind.PARAMETER]
            tunable = [
                k for place in parameters if place.variable.tunable for k in range(place.at.start, place.at.stop)
            ]
            return factors(getattr(self.traced, name), "xz".index(part), tunable)
        patterns = [sparse.csr_array(self.traced.pattern(result, argument)) for argument in _ARGUMENTS]
        if result == "flow_set":
            # The margin of a network is the least of its parts' margins.
            patterns = [sparse.csr_array(pattern.sum(axis=0)[np.newaxis]) for pattern in patterns]
        sides = [(pattern != 0).astype(np.int64) * (Factor.DEPENDENT + 1) for pattern in patterns]
        return sparse.csr_array(sparse.hstack(sides))

    def _itself(self, argument: str) -> Matrix:
        """Return the identity on an argument: it depends on itself by the factor one."""
        number = list(_ARGUMENTS).index(argument)
        first, last = int(self.ends[number]), int(self.ends[number + 1])
        at = (np.arange(last - first), np.arange(first, last))
        return sparse.csr_array((np.ones(last - first, dtype=np.int64), at), shape=(last - first, int(self.ends[-1])))

    def dependencies(
        self, variables: Sequence[FmuVariable], known: Sequence[bool], kept: Collection[Factor] = tuple(Factor)
    ) -> list[Unknown]:
        """Return what each variable depends on; a whole array depends on what any of its elements does."""
        rows, owners = self._rows(variables)
        columns = np.full(int(self.ends[-1]), -1)
        for position, variable in enumerate(variables):
            if known[position] and variable.bank in self.begins:
                at = self.begins[variable.bank] + variable.index
                columns[at : at + variable.size] = position
        found = _gathered(self.matrix, rows, owners, columns)
        countdown = [k for k, v in enumerate(variables) if v.bank is Bank.COUNTDOWN and known[k]]
        unknowns = []
        for position, variable in enumerate(variables):
            at, kinds = found.get(position, ((), ()))
            if variable.bank is Bank.CLOCK:
                at, kinds = (*at, *countdown), (*kinds, *(Factor.DEPENDENT for _ in countdown))
            real = variable.type is FmiType.FLOAT64
            names = [(kind if real and kind in kept else Factor.DEPENDENT).name.lower() for kind in kinds]
            unknowns.append(Unknown(position, at, tuple(names) if self.told else None))
        return unknowns

    def _rows(self, variables: Sequence[FmuVariable]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        """Return which rows tell about which variables."""
        first = dict(zip(self.heights, np.cumsum([0, *self.heights.values()]).tolist(), strict=False))
        rows: list[int] = []
        owners: list[int] = []
        for position, variable in enumerate(variables):
            for name, index, count in self._places(variable):
                rows += range(first[name] + index, first[name] + index + count)
                owners += [position] * count
        return np.array(rows, dtype=np.int64), np.array(owners, dtype=np.int64)

    def _places(self, variable: FmuVariable) -> list[tuple[str, int, int]]:
        automaton, index, size = self.traced.automaton, variable.index, variable.size
        plain = {Bank.DERIVATIVE: "flow", Bank.OUTPUT: "outputs", Bank.STATE: "x", Bank.DISCRETE: "z", Bank.TIME: "t"}
        if variable.bank in plain:
            name = plain[variable.bank]
            shown = variable.causality == "output" and variable.discrete and f"{name} after" in self.heights
            return [(name, index, size), *([(f"{name} after", index, size)] if shown else [])]
        if variable.bank is Bank.INDICATOR:
            return [("margins", index, 1) if index < len(self.margins) else ("flow_set", 0, 1)]
        if variable.bank is Bank.CLOCK:
            if index not in self.margins:
                return [("t", 0, 1)]
            waits = automaton.priority is Priority.FLOW and automaton.has_flow_set
            return [("margins", self.margins[index], 1), *([("flow_set", 0, 1)] if waits else [])]
        return []


def _scalar(function: Any) -> bool:
    return function is not None and bool(function.is_a("SXFunction"))


def _chained(matrix: Matrix, through: Matrix) -> Matrix:
    """Return the dependencies by way of `through`: by a constant factor where every way there has one."""
    some, every = (matrix != 0).astype(np.int64), (through != 0).astype(np.int64)
    loose = (matrix > Factor.CONSTANT + 1).astype(np.int64) @ every
    loose = loose + some @ (through > Factor.CONSTANT + 1).astype(np.int64)
    reached = (some @ every != 0).astype(np.int64)
    return sparse.csr_array(reached + (loose != 0).astype(np.int64) * int(Factor.DEPENDENT))


def _gathered(
    matrix: Matrix, rows: npt.NDArray[np.int64], owners: npt.NDArray[np.int64], columns: npt.NDArray[np.int64]
) -> Mapping[int, tuple[tuple[int, ...], tuple[Factor, ...]]]:
    """Gather rows into those of their owners, columns into those of variables; the freest kind stands for all."""
    lengths = matrix.indptr[rows + 1] - matrix.indptr[rows]
    within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    at = np.repeat(matrix.indptr[rows], lengths) + within
    owner, column, value = np.repeat(owners, lengths), columns[matrix.indices[at]], matrix.data[at]
    shown = (column >= 0) & (value > 0)
    owner, column, value = owner[shown], column[shown], value[shown]
    order = np.lexsort((column, owner))
    owner, column, value = owner[order], column[order], value[order]
    new = np.flatnonzero(np.diff(owner, prepend=-1) | np.diff(column, prepend=-1))
    if new.size == 0:
        return {}
    kinds = np.maximum.reduceat(value, new) - 1
    owner, column = owner[new], column[new]
    ends = np.flatnonzero(np.diff(owner, append=-1)) + 1
    starts = np.concatenate([[0], ends[:-1]])
    return {
        int(owner[a]): (tuple(column[a:b].tolist()), tuple(Factor(int(kind)) for kind in kinds[a:b]))
        for a, b in zip(starts, ends, strict=True)
    }
