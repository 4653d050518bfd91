"""Generate the tables with which a network runs part by part inside an FMU (hybrid_model/engine/schedule/assembly.h).

The parts' maps are the functions of the network's groups, which are there already; each group gets a model of its own,
whose parameters end with the constants in which its members differ.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.transitions import Trigger
from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.native.c_text import array, constant, definition, row
from hybrid_model.native.model_code import held_tables, model_definition, model_tables, nominals
from hybrid_model.native.names import NameTable
from hybrid_model.native.networks.groups import Group
from hybrid_model.native.networks.members import SOURCES, Member
from hybrid_model.native.networks.network import NetworkTrace

_BANKS = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER, Kind.OUTPUT)
"""In the order of the engine's banks."""
_OWN = (Kind.STATE, Kind.DISCRETE, Kind.PARAMETER, Kind.OUTPUT)
_CALL = "(const double **arg, double **res, long long *iw, double *w"
_CONSTANTS = "    arg[5] = arg[4] + {own};\n"

Columns = npt.NDArray[np.int64]


def assembly_code(network: NetworkTrace) -> str | None:
    """Return C99 that defines ``static const Assembly assembly`` after the model of a network.

    Parameters
    ----------
    network : NetworkTrace
        Traced parts.

    Returns
    -------
    str or None
        None where parts do not meet only at events: a wire carries a signal that changes along flows, or an input of
        the whole may.
    """
    if not _meets_at_events(network):
        return None
    return _Tables(network).text()


def _meets_at_events(network: NetworkTrace) -> bool:
    layout = network.layout
    steady = {
        kind: np.array([p.variable.discrete for p in layout.places[kind] for _ in range(p.variable.size)], bool)
        for kind in (Kind.INPUT, Kind.OUTPUT)
    }
    for number, place in zip(network.members.bank, network.members.place, strict=True):
        kind = SOURCES[int(number)]
        if kind is Kind.STATE or (kind in steady and not steady[kind][place]):
            return False
    return True


@dataclass(frozen=True)
class _Kind:
    """Parts with the same model: of one group, and with equal names, nominal values and whole numbers."""

    number: int
    group: Group
    member: Member


class _Tables:
    def __init__(self, network: NetworkTrace) -> None:
        self._network = network
        self._members = network.members.members
        found: dict[object, _Kind] = {}
        self._kind_of: list[_Kind] = []
        for member, number in zip(self._members, network.group_of, strict=True):
            layout = member.layout
            names = (*layout.names(Kind.STATE), *layout.names(Kind.DISCRETE), *(j.name for j in member.automaton.jumps))
            key = (number, names, tuple(nominals(layout)), tuple(layout.whole), member.automaton.stiff)
            kind = found.setdefault(key, _Kind(len(found), network.groups[number], member))
            self._kind_of.append(kind)
        self._kinds = tuple(found.values())
        self._signals: list[dict[tuple[Kind, int], int]] = [{} for _ in self._kinds]
        self._wires: list[tuple[int, int, int, int]] = []
        self._heard: list[tuple[int, int, int]] = []
        self._connect()

    def _connect(self) -> None:
        firsts = {kind: np.array([member.first[kind] for member in self._members]) for kind in _OWN}
        sources = zip(self._network.members.bank, self._network.members.place, strict=True)
        for target, member in enumerate(self._members):
            for into in range(member.layout.sizes[Kind.INPUT]):
                number, place = (int(value) for value in next(sources))
                kind = SOURCES[number]
                if kind is Kind.INPUT:
                    self._heard.append((place, target, into))
                    continue
                source = int(np.searchsorted(firsts[kind], place, side="right")) - 1
                signals = self._signals[self._kind_of[source].number]
                signal = signals.setdefault((kind, place - int(firsts[kind][source])), len(signals))
                self._wires.append((source, signal, target, into))
        self._wires.sort(key=lambda wire: wire[0])
        self._heard.sort(key=lambda heard: heard[0])

    def text(self) -> str:
        network, names = self._network, NameTable()
        kinds, parts = self._kinds, len(self._members)
        signals = [(kind, place) for sent in self._signals for kind, place in sent]
        wires = np.array(self._wires, np.int64).reshape(-1, 4)
        heard = np.array(self._heard, np.int64).reshape(-1, 3)
        tables = [
            *(text for kind in kinds for text in self._model(kind)),
            array("Model *const", "part_models", (f"&part{kind.number}_model" for kind in kinds)),
            array("size_t", "part_n_signals", (str(len(sent)) for sent in self._signals)),
            array("Signal", "part_signals", (row(_BANKS.index(kind), place) for kind, place in signals)),
            array("uint32_t", "part_groups", (str(kind.number) for kind in self._kind_of)),
            array("uint64_t", "wire_first", map(str, _rows(wires[:, 0], parts))),
            *(array("uint32_t", f"wire_{name}", map(str, wires[:, k])) for k, name in enumerate(_WIRE, 1)),
            array("Places", "part_places", self._places()),
            array("uint64_t", "heard_first", map(str, _rows(heard[:, 0], network.inputs))),
            array("Hearing", "part_hearings", (row(part, into) for _, part, into in heard)),
            array("double", "part_constants", map(constant, self._constants())),
            array("ModelName", "part_names", (names.entry(member.path) for member in self._members)),
        ]
        fields = {
            "n_groups": len(kinds),
            "n_parts": parts,
            "models": "part_models",
            "n_signals": "part_n_signals",
            "signals": "part_signals",
            "groups": "part_groups",
            "wires": row("wire_first", *(f"wire_{name}" for name in _WIRE)),
            "places": "part_places",
            "first_heard": "heard_first",
            "heard": "part_hearings",
            "constants": "part_constants",
            "part_names": "part_names",
            "names": "part_name_text",
        }
        made = f"static {definition('Assembly', 'assembly', fields)}"
        return "\n".join(['#include "assembly.h"', *tables, names.definition("part_name_text"), made])

    def _places(self) -> Iterator[str]:
        sizes = self._network.layout.sizes
        jumps = [info for member in self._members for info in member.automaton.jumps]
        for member in self._members:
            yield row(*(member.first[kind] for kind in _OWN), member.margin, member.jump)
        yield row(*(sizes[kind] for kind in _OWN), sum(j.trigger is Trigger.STATE for j in jumps), len(jumps))

    def _constants(self) -> Iterator[float]:
        columns: dict[int, FloatArray] = {}
        for group in self._network.groups:
            columns.update(zip(group.members, group.constants, strict=True))
        for part in range(len(self._members)):
            yield from map(float, columns[part])

    def _model(self, kind: _Kind) -> Iterator[str]:
        group, prefix = kind.group, f"part{kind.number}_"
        automaton, sizes = group.traced.automaton, group.sizes
        triggers = [info.trigger for info in automaton.jumps]
        there = {
            "flow": sizes[Kind.STATE] > 0,
            "flow_set": automaton.has_flow_set,
            "margins": Trigger.STATE in triggers,
            "times": Trigger.TIME in triggers,
            "outputs": sizes[Kind.OUTPUT] > 0,
            "factors": group.factors is not None,
        }
        take = _CONSTANTS.format(own=sizes[Kind.PARAMETER])
        maps = {}
        for name, is_there in there.items():
            if is_there:
                maps[name] = f"{prefix}{name}"
                yield _function(maps[name], f"{take}    return group{group.number}_{name}(arg, res, iw, w, mem);")
        if there["flow"]:
            maps["forward"] = f"{prefix}forward"
            shift = f"    for (int i = 10; i > 5; i--)\n        arg[i] = arg[i - 1];\n{take}"
            yield _function(
                maps["forward"], f"{shift}    return group{group.number}_flow_forward(arg, res, iw, w, mem);"
            )
        if triggers:
            maps["reset"] = f"{prefix}reset"
            body = f"{take}    return group{group.number}_resets[jump](arg, res, iw, w, 0);"
            yield f"static int {prefix}reset(size_t jump, {_CALL[1:]})\n{{\n{body}\n}}\n"
        yield from model_tables(kind.member.automaton, kind.member.layout, prefix)
        yield from held_tables(group.factors, prefix)
        yield model_definition(
            group.traced,
            self._network.definitions(factors=True).work,
            kind.member.path.rpartition(".")[2],
            prefix=prefix,
            maps=maps,
            constants=group.constants.shape[1],
            held=group.factors,
        )


_WIRE = ("signals", "targets", "inputs")


def _rows(column: Columns, count: int) -> Columns:
    """Where each row begins in a column that is sorted, and the end."""
    return np.searchsorted(column, np.arange(count + 1))


def _function(name: str, body: str) -> str:
    return f"static int {name}{_CALL}, int mem)\n{{\n{body}\n}}\n"
