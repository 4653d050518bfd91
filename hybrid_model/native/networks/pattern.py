"""Which results of a network depend on which of its arguments: the patterns of the parts, chained over the wires."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from hybrid_model.declare.variables import Kind
from hybrid_model.native.networks.evaluation_order import Call, Order
from hybrid_model.native.networks.groups import Group
from hybrid_model.native.networks.members import SOURCES, Members

if TYPE_CHECKING:
    import scipy.sparse

Dependencies = frozenset[int]
"""Elements of t, x, z, u, p, numbered through in this order."""
ARGUMENTS = ("t", "x", "z", "u", "p")
_KINDS = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)
_U = ARGUMENTS.index("u")


class NetworkPattern:
    """Dependencies of the maps of a network; every set is made when it is first asked for.

    Parameters
    ----------
    members, groups, group_of, order
        As for `hybrid_model.native.networks.code.NetworkCode`.
    """

    def __init__(self, members: Members, groups: Sequence[Group], group_of: Sequence[int], order: Order) -> None:
        self._members, self._groups, self._group_of, self._order = members, groups, group_of, order
        sizes = [1, *(members.layout.sizes[kind] for kind in _KINDS)]
        self._ends = [int(end) for end in np.cumsum([0, *sizes])]
        self._known: dict[str, list[Dependencies]] = {}
        self._banks: list[list[Dependencies]] | None = None

    def matrix(self, result: str, argument: str) -> scipy.sparse.csr_array:
        """Return the pattern of a result: see `hybrid_model.native.networks.network.NetworkTrace.pattern`.

        Returns
        -------
        csr_array of bool, shape (elements of the result, elements of the argument)
        """
        # Runs need no patterns, and this package takes long to import.
        import scipy.sparse

        rows = self.dependencies(result)
        number = ARGUMENTS.index(argument)
        first, last = self._ends[number], self._ends[number + 1]
        columns = [sorted(k - first for k in row if first <= k < last) for row in rows]
        pointers = np.cumsum([0, *map(len, columns)])
        indices = np.array([k for row in columns for k in row], dtype=np.int64)
        data = np.ones(len(indices), dtype=bool)
        return scipy.sparse.csr_array((data, indices, pointers), shape=(len(rows), last - first))

    def dependencies(self, result: str) -> list[Dependencies]:
        """Return what each element of a result depends on."""
        if result not in self._known:
            if result.startswith("start_"):
                self._known["start_x"], self._known["start_z"] = self._start()
            else:
                self._known[result] = self._result(result)
        return self._known[result]

    def of_inputs(self, number: int, elements: Iterable[int]) -> Dependencies:
        """Return what some inputs of a member depend on."""
        banks = self._given()
        sources = self._sources(number)
        return frozenset().union(*(banks[bank][place] for bank, place in (sources[k] for k in elements)))

    def of_reset(self, number: int, jump: int, kind: Kind) -> list[Dependencies]:
        """Return what the new states of a member depend on after its jump number `jump`, element by element."""
        return self._rows(number, f"reset{jump}", (Kind.STATE, Kind.DISCRETE).index(kind), self._given())

    def outside(self, found: Dependencies, *, time: bool) -> bool:
        """Whether there are continuous states, inputs or, if asked, the time among what something depends on."""
        states, inputs = range(self._ends[1], self._ends[2]), range(self._ends[3], self._ends[4])
        return any(k in states or k in inputs or (time and k == 0) for k in found)

    def _given(self) -> list[list[Dependencies]]:
        """Dependencies of states, discrete states, inputs and outputs, in the order of `SOURCES`."""
        if self._banks is None:
            self._banks = self._identity()
            for call in self._order.calls:
                self._evaluate(call, self._banks)
        return self._banks

    def _identity(self) -> list[list[Dependencies]]:
        banks = []
        for kind in SOURCES:
            if kind is Kind.OUTPUT:
                banks.append([frozenset[int]()] * self._members.layout.sizes[kind])
            else:
                at = _KINDS.index(kind) + 1
                banks.append([frozenset((k,)) for k in range(self._ends[at], self._ends[at + 1])])
        return banks

    def _sources(self, number: int) -> list[tuple[int, int]]:
        member = self._members.members[number]
        at = slice(member.first[Kind.INPUT], member.first[Kind.INPUT] + member.layout.sizes[Kind.INPUT])
        return list(zip(self._members.bank[at].tolist(), self._members.place[at].tolist(), strict=True))

    def _rows(
        self, number: int, name: str, result: int, banks: list[list[Dependencies]], elements: range | None = None
    ) -> list[Dependencies]:
        """Dependencies of a map's result for a member, where signals depend on what `banks` say."""
        group, member = self._groups[self._group_of[number]], self._members.members[number]
        rows = [group.rows(name, result, argument) for argument in range(len(ARGUMENTS))]
        sources = self._sources(number)
        parameters = self._ends[4] + member.first[Kind.PARAMETER]
        found = []
        for k in range(len(rows[0])) if elements is None else elements:
            sets = [
                *(banks[0][member.first[Kind.STATE] + i] for i in rows[1][k]),
                *(banks[1][member.first[Kind.DISCRETE] + i] for i in rows[2][k]),
                *(banks[sources[i][0]][sources[i][1]] for i in rows[_U][k]),
            ]
            own = {*rows[0][k], *(parameters + i for i in rows[4][k])}
            found.append(frozenset(own.union(*sets)))
        return found

    def _evaluate(self, call: Call, banks: list[list[Dependencies]]) -> None:
        assert call.piece is not None
        piece, member = call.piece, self._members.members[call.member]
        rows = self._rows(call.member, "outputs", 0, banks, range(piece.first, piece.first + piece.count))
        first = member.first[Kind.OUTPUT] + piece.first
        banks[SOURCES.index(Kind.OUTPUT)][first : first + piece.count] = rows

    def _result(self, name: str) -> list[Dependencies]:
        banks = self._given()
        if name == "flow_set":
            return [self._flow_set(banks)]
        return [row for number in range(len(self._members.members)) for row in self._rows(number, name, 0, banks)]

    def _flow_set(self, banks: list[list[Dependencies]]) -> Dependencies:
        """The flow set of the network is the intersection of those of the parts."""
        rows = (
            row
            for number, member in enumerate(self._members.members)
            if member.automaton.has_flow_set
            for row in self._rows(number, "flow_set", 0, banks)
        )
        return frozenset[int]().union(*rows)

    def _start(self) -> tuple[list[Dependencies], list[Dependencies]]:
        banks = self._identity()
        for call in self._order.start:
            if call.piece is not None:
                self._evaluate(call, banks)
                continue
            member = self._members.members[call.member]
            new = [self._rows(call.member, "start", result, banks) for result in (0, 1)]
            for bank, kind in enumerate((Kind.STATE, Kind.DISCRETE)):
                banks[bank][member.first[kind] : member.first[kind] + len(new[bank])] = new[bank]
        return banks[0], banks[1]
