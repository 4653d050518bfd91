"""The C code of a network: the functions of its groups, and the tables that hybrid_model/engine/networks run over."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np

from hybrid_model.declare.layout import Layout
from hybrid_model.declare.transitions import Trigger
from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.native.c_text import Definitions, array, boolean, constant, functions, row
from hybrid_model.native.networks.evaluation_order import Call, Order, Piece
from hybrid_model.native.networks.groups import Group, forward, reverse, sliced
from hybrid_model.native.networks.members import Members, NotLoopable

_SOURCE_BITS = 30
_ARG, _RES = 10, 5
"""NETWORK_ARG and NETWORK_RES of hybrid_model/engine/networks/network.h."""
_MAPS = ("start", "flow", "flow_set", "margins", "times", "outputs", "forward", "reverse", "start_forward")
_WRAPPED = (*_MAPS, "start_reverse")
_START = "NETWORK_START"


class NetworkCode:
    """The functions and tables of a network, and the sizes of the work arrays.

    Parameters
    ----------
    members : Members
        The parts.
    groups : sequence of Group
        Parts with equal maps.
    group_of : sequence of int
        Number of each member's group.
    order : Order
        Of outputs and start values.
    factors : bool
        Whether the factors of the groups' rates are there too.
    """

    def __init__(
        self,
        members: Members,
        groups: Sequence[Group],
        group_of: Sequence[int],
        order: Order,
        *,
        factors: bool = False,
    ) -> None:
        self._members, self._groups, self._group_of, self._order = members, groups, group_of, order
        if max(members.layout.sizes.values()) >= 1 << _SOURCE_BITS:
            raise NotLoopable("The network has more variables than the tables can number.")
        self._functions: dict[str, ca.Function] = {}
        self._group_rows = [self._group(group) for group in groups]
        for group in groups if factors else ():
            if group.factors is not None:
                self._add(group.factors.function, f"group{group.number}_factors")
        self._piece_rows = [self._piece(number, piece) for number, piece in enumerate(order.pieces)]

    @property
    def work_sizes(self) -> tuple[int, int, int, int]:
        """Sizes that the functions need of arg, res, iw and w, see hybrid_model/engine/networks/network.h."""
        sizes = self._members.layout.sizes
        most = {kind: self._most(kind) for kind in Kind}
        own = (
            2 * sum(sizes[kind] for kind in (Kind.STATE, Kind.DISCRETE, Kind.OUTPUT))
            + 1
            + sizes[Kind.INPUT]
            + sizes[Kind.PARAMETER]
            + self._order.tape
            + 1
            + most[Kind.STATE]
            + most[Kind.DISCRETE]
            + 2 * most[Kind.INPUT]
            + most[Kind.PARAMETER]
        )
        arguments, results, integers, doubles = self._maps.work
        return _ARG + arguments, _RES + results, integers, own + doubles

    def text(self) -> str:
        """Return C99 that defines ``hybrid_start``, ``hybrid_flow``, ..., ``hybrid_reset`` for the engine."""
        return "\n".join(
            [self._maps.text, "#include <math.h>", '#include "network.h"', "", *self._tables(), _wrappers()]
        )

    @functools.cached_property
    def _maps(self) -> Definitions:
        return functions("network", self._functions.values())

    # Functions

    def _add(self, function: ca.Function, name: str) -> str:
        self._functions[name] = _renamed(function, name)
        return name

    def _map(self, function: ca.Function, name: str, used: bool = True) -> str:
        """Add a map with its derivatives and return the row that names them."""
        if not used:
            return "{NULL, NULL, NULL}"
        self._add(function, name)
        for way, derive in (("forward", forward), ("reverse", reverse)):
            self._functions[f"{name}_{way}"] = derive(function, f"{name}_{way}")
        return row(name, f"{name}_forward", f"{name}_reverse")

    def _group(self, group: Group) -> str:
        sizes, automaton, maps = group.sizes, group.traced.automaton, group.maps
        name = f"group{group.number}"
        triggers = [info.trigger for info in automaton.jumps]
        numbers = [sizes[kind] for kind in (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER, Kind.OUTPUT)]
        numbers += [triggers.count(Trigger.STATE), triggers.count(Trigger.TIME)]
        derived = [
            self._map(maps["start"], f"{name}_start", group.starts),
            self._map(maps["flow"], f"{name}_flow", sizes[Kind.STATE] > 0),
            self._map(maps["outputs"], f"{name}_outputs", sizes[Kind.OUTPUT] > 0),
        ]
        wanted = {
            "flow_set": automaton.has_flow_set,
            "margins": Trigger.STATE in triggers,
            "times": Trigger.TIME in triggers,
        }
        plain = [self._add(maps[key], f"{name}_{key}") if used else "NULL" for key, used in wanted.items()]
        for k in range(len(triggers)):
            self._add(maps[f"reset{k}"], f"{name}_reset{k}")
        flags = [boolean(group.starts), boolean(automaton.has_flow_set)]
        resets = f"{name}_resets" if triggers else "NULL"
        return row(*numbers, *flags, *derived, *plain, resets)

    def _piece(self, number: int, piece: Piece) -> str:
        function = self._groups[piece.group].maps["outputs"]
        if piece.count == function.size1_out(0):
            name = f"group{piece.group}_outputs"
            maps = row(name, f"{name}_forward", f"{name}_reverse")
        else:
            maps = self._map(sliced(function, piece.first, piece.count, f"piece{number}"), f"piece{number}")
        return row(piece.first, piece.count, maps)

    # Tables

    def _most(self, kind: Kind) -> int:
        return max((group.sizes[kind] for group in self._groups), default=0)

    def _tables(self) -> list[str]:
        members, order = self._members, self._order
        sources = (
            int(bank) << _SOURCE_BITS | int(place) for bank, place in zip(members.bank, members.place, strict=True)
        )
        owners = (number for number, member in enumerate(members.members) for _ in member.automaton.jumps)
        resets = (
            array("ModelFunction", f"group{group.number}_resets", names)
            for group in self._groups
            if (names := [f"group{group.number}_reset{k}" for k in range(len(group.traced.automaton.jumps))])
        )
        return [
            *resets,
            array("NetworkGroup", "network_groups", self._group_rows),
            array("NetworkPiece", "network_pieces", self._piece_rows),
            array("NetworkMember", "network_members", self._member_rows()),
            array("NetworkCall", "network_calls", map(self._call, order.calls)),
            array("NetworkCall", "network_start_calls", map(self._call, order.start)),
            array("uint32_t", "network_sources", (f"{source}u" for source in sources)),
            array("uint32_t", "network_jump_member", map(str, owners)),
            array("double", "network_constants", map(constant, self._constants().ravel())),
            self._network(),
        ]

    def _constants(self) -> FloatArray:
        rows = [group.constants.ravel() for group in self._groups]
        return np.concatenate(rows) if rows else np.zeros(0)

    def _member_rows(self) -> Iterable[str]:
        # Constants lie group by group.
        first, place = 0, {}
        for group in self._groups:
            for number in group.members:
                place[number] = first
                first += group.constants.shape[1]
        kinds = (Kind.STATE, Kind.DISCRETE, Kind.PARAMETER, Kind.OUTPUT)
        for k, member in enumerate(self._members.members):
            at = [member.first[kind] for kind in kinds]
            first_of = (member.margin, member.time, member.jump, member.first[Kind.INPUT])
            yield row(self._group_of[k], *at, *first_of, place[k])

    def _call(self, call: Call) -> str:
        piece = _START if call.piece is None else str(self._numbers[call.piece])
        return row(piece, call.member)

    @property
    def _numbers(self) -> dict[Piece, int]:
        return {piece: number for number, piece in enumerate(self._order.pieces)}

    def _network(self) -> str:
        layout: Layout = self._members.layout
        names = {Kind.STATE: "states", Kind.DISCRETE: "discrete", Kind.INPUT: "inputs", Kind.PARAMETER: "parameters"}
        fields: dict[str, object] = {f"n_{name}": layout.sizes[kind] for kind, name in names.items()}
        fields |= {
            "n_outputs": layout.sizes[Kind.OUTPUT],
            "n_members": len(self._members.members),
            "n_calls": len(self._order.calls),
            "n_start_calls": len(self._order.start),
            "n_tape": self._order.tape,
        }
        fields |= {f"most_{name}": self._most(kind) for kind, name in names.items()}
        tables = ("groups", "members", "pieces", "calls", "start_calls", "sources", "jump_member", "constants")
        fields |= {name: f"network_{name}" for name in tables}
        lines = "".join(f"    .{key} = {value},\n" for key, value in fields.items())
        return f"static const Network network = {{\n{lines}}};\n"


def _renamed(function: ca.Function, name: str) -> ca.Function:
    arguments = [ca.SX.sym(function.name_in(k), function.size1_in(k)) for k in range(function.n_in())]
    return ca.Function(name, arguments, function.call(arguments))


def _wrappers() -> str:
    lines = []
    for name in _WRAPPED:
        lines += [
            f"static int hybrid_{name}(const double **arg, double **res, long long *iw, double *w, int mem)",
            "{",
            "    (void)mem;",
            f"    return network_{name}(&network, arg, res, iw, w);",
            "}",
            "",
        ]
    lines += [
        "static int hybrid_reset(size_t jump, const double **arg, double **res, long long *iw, double *w)",
        "{",
        "    return network_reset(&network, jump, arg, res, iw, w);",
        "}",
        "",
    ]
    return "\n".join(lines)
