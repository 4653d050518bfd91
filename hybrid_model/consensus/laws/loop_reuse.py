"""One closed loop for scenarios that differ in numbers alone: composed and compiled once, run from other start values.

What decides about a closed loop is compared part by part: classes, names and shapes of variables, and whatever else an
instance holds. Start values and parameters do not.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

import hybrid_model as hm
from hybrid_model.consensus.laws.closed_loop import agent_name, agent_recipes, closed_loop
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.declare.variables import Kind

__all__ = ["LoopReuse"]

_MOST = 8
"""So many closed loops are kept, those that were used last."""
_OF_STRUCTURE = ("variables", "jumps", "clocks", "_transitions", "name")
"""Attributes of an instance that follow from its class and its variables."""

_Place = tuple[int, str, str]
"""Agent, part of it, variable."""
_Blocks = list[dict[str, Any]]
"""The parts of each agent."""


@dataclass(frozen=True, eq=False)
class _Known:
    """A closed loop that was made.

    Attributes
    ----------
    loop : Composition
        It.
    names : dict
        Its name of each start value of a part.
    declared : dict
        The start values that it was made with.
    held : list
        What its parts hold besides variables.
    """

    loop: hm.Composition
    names: dict[_Place, str]
    declared: dict[_Place, NDArray[Any]]
    held: list[object]


class LoopReuse:
    """Closed loops that were made, to be used again."""

    def __init__(self) -> None:
        self._known: OrderedDict[Hashable, _Known] = OrderedDict()
        self._blocks: dict[tuple[int, str], tuple[object, Any]] = {}

    def loop(self, scenario: Scenario) -> tuple[hm.Composition, dict[str, NDArray[Any]]]:
        """Return a closed loop and the `starts` of `hm.simulate` that make it that of a scenario.

        Raises
        ------
        ScenarioError
            As `closed_loop`.
        """
        blocks = [self._of_agent(scenario, number) for number in range(1, scenario.network.agents + 1)]
        structure, held = _structure(scenario, blocks)
        known = self._known.get(structure)
        if known is None or not _equal(known.held, held):
            loop = closed_loop(scenario)
            known = _Known(loop, _names(loop, blocks), dict(_starts(blocks)), held)
            self._known[structure] = known
        self._known.move_to_end(structure)
        while len(self._known) > _MOST:
            self._known.popitem(last=False)
        others = {
            known.names[place]: start
            for place, start in _starts(blocks)
            if place in known.names and start.tobytes() != known.declared[place].tobytes()
        }
        return known.loop, others

    def _of_agent(self, scenario: Scenario, number: int) -> dict[str, Any]:
        """The parts of an agent, those of the scenario before where nothing about them has changed."""
        blocks = {}
        for part, (key, make) in agent_recipes(scenario, number).items():
            known = self._blocks.get((number, part))
            if known is None or not _equal(known[0], key):
                known = self._blocks[number, part] = key, make()
            blocks[part] = known[1]
        return blocks


def _structure(scenario: Scenario, parts: _Blocks) -> tuple[Hashable, list[object]]:
    """What two scenarios must have in common: what can be hashed, and the rest."""
    shapes: list[Hashable] = []
    held: list[object] = []
    for blocks in parts:
        for argument, block in blocks.items():
            if block is None:
                continue
            shapes.append((argument, type(block), tuple((v.name, v.shape) for v in block.variables)))
            held += [(key, value) for key, value in vars(block).items() if key not in _OF_STRUCTURE]
    return (scenario.network.edges, scenario.trigger.kind, scenario.channel.ideal, tuple(shapes)), held


def _equal(a: object, b: object) -> bool:
    """Whether two things are equal beyond doubt; of arrays, which compare number by number, that is not known."""
    try:
        return a is b or bool(a == b)
    except ValueError:
        return False


def _starts(parts: _Blocks) -> Iterator[tuple[_Place, NDArray[Any]]]:
    for number, blocks in enumerate(parts, start=1):
        for argument, block in blocks.items():
            for variable in block.variables if block is not None else ():
                if variable.kind is not Kind.OUTPUT and not variable.computed:
                    yield (number, argument, variable.name), variable.start


def _names(loop: hm.Composition, parts: _Blocks) -> dict[_Place, str]:
    """The names in the closed loop of what its parts start from; inputs over wires have none."""
    known = {variable.name for variable in loop.variables}
    names = {}
    for (number, part, variable), _ in _starts(parts):
        one = loop.parts[agent_name(number)]
        assert isinstance(one, hm.Composition)
        inner = one.scoped_name(part, variable)
        if any(own.name == inner for own in one.variables):
            name = loop.scoped_name(agent_name(number), inner)
            if name in known:
                names[number, part, variable] = name
    return names
