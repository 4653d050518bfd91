"""Large compositions as networks: parts with equal maps share one function, and the network is a loop over tables.

A trace of the whole composition has an expression for each part, and a jump map of every jump copies all states. Here
each part is traced on its own; hybrid_model/engine/networks/network.c evaluates the composition by gathering the inputs
of one part after the other and calling the function of its group.
"""

from __future__ import annotations

import functools
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.composition import Composition
from hybrid_model.declare.layout import Layout
from hybrid_model.declare.variables import Kind
from hybrid_model.native.c_text import Definitions
from hybrid_model.native.networks.code import NetworkCode
from hybrid_model.native.networks.evaluation_order import Order, order
from hybrid_model.native.networks.groups import Group, grouped
from hybrid_model.native.networks.members import FEW, Members, NotLoopable, is_plain, leaves, members_of
from hybrid_model.native.networks.pattern import NetworkPattern
from hybrid_model.native.networks.trace import part_traces, require_known_times
from hybrid_model.native.trace import Trace, trace

if TYPE_CHECKING:
    import scipy.sparse

__all__ = ["NetworkTrace", "network_trace", "trace_any", "worth_looping"]

_MEAN_GROUP = 4


@dataclass(frozen=True, eq=False)
class NetworkTrace:
    """A composition as tables over traced parts.

    Attributes
    ----------
    automaton : Composition
        What was traced.
    members : Members
        Its parts, those of nested networks included, with the sources of their inputs.
    groups : tuple of Group
        Parts with equal maps.
    group_of : tuple of int
        Number of each member's group.
    order : Order
        In which outputs and start values are computed.
    """

    automaton: Composition
    members: Members
    groups: tuple[Group, ...]
    group_of: tuple[int, ...]
    order: Order

    @property
    def layout(self) -> Layout:
        """Where each variable lives in x, z, u, p and y."""
        return self.members.layout

    @functools.cached_property
    def patterns(self) -> NetworkPattern:
        """What depends on what."""
        return NetworkPattern(self.members, self.groups, self.group_of, self.order)

    def pattern(self, result: str, argument: str) -> scipy.sparse.csr_array:
        """Return which elements of a result depend on which of an argument.

        Parameters
        ----------
        result : str
            ``"flow"``, ``"flow_set"``, ``"margins"``, ``"times"``, ``"outputs"``, ``"start_x"`` or ``"start_z"``.
        argument : str
            ``"t"``, ``"x"``, ``"z"``, ``"u"`` or ``"p"``.

        Returns
        -------
        csr_array of bool, shape (elements of the result, elements of the argument)
        """
        return self.patterns.matrix(result, argument)

    def changes(self, kind: Kind) -> list[frozenset[int]]:
        """Return which continuous or discrete states each jump may change.

        Parameters
        ----------
        kind : {Kind.STATE, Kind.DISCRETE}
            Which vector.

        Returns
        -------
        list of frozenset of int
            One a jump: elements of the vector.
        """
        by_group = [group.traced.changes(kind) for group in self.groups]
        return [
            frozenset(member.first[kind] + element for element in elements)
            for member, number in zip(self.members.members, self.group_of, strict=True)
            for elements in by_group[number]
        ]

    @property
    def inputs(self) -> int:
        """Number of scalars in u."""
        return self.layout.sizes[Kind.INPUT]

    @functools.cache  # noqa: B019 - its definitions live as long as the network
    def definitions(self, *, factors: bool = False) -> Definitions:
        """Return C99 that defines the functions of hybrid_model/engine/model.h, and the work arrays they need.

        They are static: ``hybrid_start``, ``hybrid_flow``, ``hybrid_flow_set``, ``hybrid_margins``, ``hybrid_times``,
        ``hybrid_outputs``, ``hybrid_reset`` (which takes the number of the jump), ``hybrid_forward``,
        ``hybrid_reverse``, ``hybrid_start_forward`` and ``hybrid_start_reverse``.

        Parameters
        ----------
        factors : bool
            Whether those of the groups' rates are there too, which parts that run on their own have a use for.
        """
        code = NetworkCode(self.members, self.groups, self.group_of, self.order, factors=factors)
        return Definitions(code.text(), code.work_sizes)


def worth_looping(automaton: Automaton) -> bool:
    """Whether a network of tables is the better form of an automaton: a composition of many parts, few of them unlike.

    Parameters
    ----------
    automaton : Automaton
        Any.

    Returns
    -------
    bool
        False where the whole composition is to be traced.
    """
    if not is_plain(automaton):
        return False
    parts = leaves(automaton)
    kinds = Counter(_outside(part) for part in parts)
    return len(parts) > FEW and len(parts) >= _MEAN_GROUP * len(kinds)


def _outside(part: Automaton) -> tuple[object, ...]:
    """What parts with equal maps have in common, seen from outside."""
    sizes = Counter[Kind]()
    for variable in part.variables:
        sizes[variable.kind] += variable.size
    return type(part), *(sizes[kind] for kind in Kind), len(part.jumps)


def network_trace(composition: Composition) -> NetworkTrace:
    """Trace the parts of a composition.

    Parameters
    ----------
    composition : Composition
        One that evaluates its maps as `Composition` does (a subclass may only build it in another way).

    Returns
    -------
    NetworkTrace
        The composition as tables.

    Raises
    ------
    NotLoopable
        If the composition is to be traced whole: a subclass evaluates itself, or start values of nested networks
        depend on signals from outside.
    TraceError
        As in `hybrid_model.native.trace.trace`.
    """
    if not is_plain(composition):
        raise NotLoopable(f"{composition.name} does not evaluate its maps as the sum of its parts.")
    members = members_of(composition)
    traces, alike = part_traces([member.automaton for member in members.members])
    groups = tuple(grouped(traces, alike))
    group_of = tuple(number for _, number in sorted((k, group.number) for group in groups for k in group.members))
    found = NetworkTrace(composition, members, groups, group_of, order(members, groups, group_of))
    require_known_times(composition, members, groups, group_of, found.patterns)
    return found


def trace_any(automaton: Automaton) -> Trace | NetworkTrace:
    """Trace an automaton as a network if that is worth it, else whole.

    Raises
    ------
    TraceError
        As in `hybrid_model.native.trace.trace`.
    """
    if worth_looping(automaton):
        assert isinstance(automaton, Composition)
        try:
            return network_trace(automaton)
        except NotLoopable:
            pass
    return trace(automaton)
