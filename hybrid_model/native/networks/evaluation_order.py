"""In which order the outputs and start values of a network are computed."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from hybrid_model.declare.layout import Place
from hybrid_model.declare.variables import Kind
from hybrid_model.native.networks.groups import Group
from hybrid_model.native.networks.members import SOURCES, Member, Members, NotLoopable

_INPUT = 3
"""Number of the inputs among the arguments of maps."""
_OUTPUT = SOURCES.index(Kind.OUTPUT)


@dataclass(frozen=True, order=True)
class Piece:
    """Consecutive outputs of the parts of a group, computed together."""

    group: int
    first: int
    count: int


@dataclass(frozen=True)
class Call:
    """A piece of the outputs of a member, or its start values (no piece)."""

    piece: Piece | None
    member: int


@dataclass(frozen=True)
class Order:
    """What is computed one after the other.

    Attributes
    ----------
    pieces : tuple of Piece
        All that are called.
    calls : tuple of Call
        The outputs that inputs are wired to, each after what it needs.
    start : tuple of Call
        Start values in the order of the parts, each after the outputs that it needs, as they are then.
    """

    pieces: tuple[Piece, ...]
    calls: tuple[Call, ...]
    start: tuple[Call, ...]

    @property
    def tape(self) -> int:
        """Number of outputs that the calls of `start` write."""
        return sum(call.piece.count for call in self.start if call.piece is not None)


def order(members: Members, groups: Sequence[Group], group_of: Sequence[int]) -> Order:
    """Order the outputs and start values of a network.

    Raises
    ------
    NotLoopable
        If outputs need each other, or the order of start values is too long a list.
    """
    return _Ordering(members, groups, group_of).order()


class _Ordering:
    def __init__(self, members: Members, groups: Sequence[Group], group_of: Sequence[int]) -> None:
        self.members = members
        self.groups, self.group_of = groups, group_of
        # Per output of the network: its member, and its variable in the member's layout.
        self.owner: list[tuple[int, int]] = [
            (number, variable)
            for number, member in enumerate(members.members)
            for variable, place in enumerate(member.layout.places[Kind.OUTPUT])
            for _ in range(place.variable.size)
        ]

    def order(self) -> Order:
        calls = self._calls()
        start = self._start(calls)
        pieces = sorted({call.piece for call in (*calls, *start) if call.piece is not None})
        return Order(tuple(pieces), tuple(calls), tuple(start))

    def _sources(self, number: int, elements: Iterable[int]) -> list[tuple[int, int]]:
        """Sources (bank, place) of some inputs of a member."""
        first = self.members.members[number].first[Kind.INPUT]
        return [(int(self.members.bank[first + k]), int(self.members.place[first + k])) for k in elements]

    def _outputs_for(self, number: int, elements: Iterable[int]) -> set[tuple[int, int]]:
        """Outputs (member, variable) that some inputs of a member come from."""
        return {self.owner[place] for bank, place in self._sources(number, elements) if bank == _OUTPUT}

    def _inputs_of(self, number: int, first: int, count: int) -> list[int]:
        """Inputs of a member that some of its outputs depend on."""
        rows = self.groups[self.group_of[number]].rows("outputs", 0, _INPUT)
        return sorted({column for row in rows[first : first + count] for column in row})

    def _place(self, output: tuple[int, int]) -> Place:
        number, variable = output
        return self.members.members[number].layout.places[Kind.OUTPUT][variable]

    def _needed(self) -> dict[tuple[int, int], set[tuple[int, int]]]:
        """Outputs that inputs are wired to, with the outputs that each of them needs."""
        wired = {self.owner[place] for place in self.members.place[self.members.bank == _OUTPUT]}
        found = {}
        for output in wired:
            at = self._place(output).at
            found[output] = self._outputs_for(output[0], self._inputs_of(output[0], at.start, at.stop - at.start))
        return found

    def _calls(self) -> list[Call]:
        needs = self._needed()
        try:
            sequence = list(TopologicalSorter(needs).static_order())
        except CycleError as error:
            raise NotLoopable("Outputs of the network need each other at one instant.") from error
        level: dict[tuple[int, int], int] = {}
        for output in sequence:
            level[output] = 1 + max((level[other] for other in needs[output]), default=-1)
        wanted: dict[tuple[int, int], set[int]] = {}
        for (number, variable), depth in level.items():
            wanted.setdefault((depth, number), set()).add(variable)
        calls = [
            (depth, piece, number)
            for (depth, number), variables in wanted.items()
            for piece in self._runs(number, variables)
        ]
        return [Call(piece, number) for _, piece, number in sorted(calls)]

    def _runs(self, number: int, variables: set[int]) -> list[Piece]:
        """Join neighbouring variables of a member that can be computed at once."""
        places = self.members.members[number].layout.places[Kind.OUTPUT]
        runs: list[list[int]] = []
        for variable in sorted(variables):
            if runs and runs[-1][-1] == variable - 1:
                runs[-1].append(variable)
            else:
                runs.append([variable])
        ends = [(places[run[0]].at.start, places[run[-1]].at.stop) for run in runs]
        return [Piece(self.group_of[number], first, last - first) for first, last in ends]

    def _start(self, calls: list[Call]) -> list[Call]:
        """Order the start values: an output is computed anew if something that it depends on has started since."""
        ranks = {call: rank for rank, call in enumerate(calls)}
        call_of = {(call.member, k): call for call in calls for k in _span(call)}
        now, started, computed = 0, dict[int, int](), dict[Call, int]()
        program: list[Call] = []
        limit = 1000 + 50 * len(self.members.members)
        member_of_state = self._member_of_state()

        @functools.cache
        def uses(call: Call) -> tuple[tuple[Call, ...], tuple[int, ...]]:
            """Calls whose outputs, and members whose states, a call reads."""
            assert call.piece is not None
            inputs = self._inputs_of(call.member, call.piece.first, call.piece.count)
            self._require_own(self.members.members[call.member], inputs)
            sources = self._sources(call.member, inputs)
            states = {member_of_state[source] for source in sources if source in member_of_state}
            return tuple(self._read(sources, call_of)), (call.member, *states)

        for number, member in enumerate(self.members.members):
            group = self.groups[self.group_of[number]]
            if not group.starts:
                continue
            inputs = sorted({*group.columns("start", 0, _INPUT), *group.columns("start", 1, _INPUT)})
            self._require_own(member, inputs)
            closure: set[Call] = set()
            waiting = self._read(self._sources(number, inputs), call_of)
            while waiting:
                call = waiting.pop()
                if call not in closure:
                    closure.add(call)
                    waiting += uses(call)[0]
            for call in sorted(closure, key=ranks.__getitem__):
                others, states = uses(call)
                newest = max((*(started.get(k, 0) for k in states), *(computed[other] for other in others)))
                if computed.get(call, -1) < newest:
                    now += 1
                    computed[call] = now
                    program.append(call)
            now += 1
            started[number] = now
            program.append(Call(None, number))
            if len(program) > limit:
                raise NotLoopable("The start values of the network need each other's outputs too often.")
        return program

    def _member_of_state(self) -> dict[tuple[int, int], int]:
        return {
            (SOURCES.index(kind), place): number
            for kind in (Kind.STATE, Kind.DISCRETE)
            for number, member in enumerate(self.members.members)
            for place in member.places(kind)
        }

    def _read(self, sources: list[tuple[int, int]], call_of: dict[tuple[int, int], Call]) -> list[Call]:
        found = []
        for bank, place in sources:
            if bank == _OUTPUT:
                number = self.owner[place][0]
                found.append(call_of[number, place - self.members.members[number].first[Kind.OUTPUT]])
        return found

    def _require_own(self, member: Member, inputs: list[int]) -> None:
        """Refuse start values that use inputs of a nested network: it reads them before any of its parts start."""
        first = member.first[Kind.INPUT]
        if any(self.members.crossing[first + k] for k in inputs):
            raise NotLoopable(f"Start values depend, in {member.path}, on a signal from outside its own network.")


def _span(call: Call) -> range:
    assert call.piece is not None
    return range(call.piece.first, call.piece.first + call.piece.count)
