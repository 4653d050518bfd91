"""A trigger law of the user's own in a scenario: a class of automata, the numbers given to it, and what it promises."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import hybrid_model as hm
from hybrid_model.consensus.entries import Entries, suggestion
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.trigger import Threshold, Trigger, TriggerKind
from hybrid_model.declare.variables import Kind, Values
from hybrid_model.errors import DeclarationError

__all__ = ["OwnTrigger", "read_own_trigger"]

_HEARD = ("x", "neighbours", "weights")
"""What an agent can give to its event generator."""
_SENT = ("broadcast", "events")
"""What an agent needs from it."""
_GIVEN = ("degree", "gain")
"""What a law gets from its scenario if it declares it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OwnTrigger(Trigger):
    """A law that is a class of the user's own, in the place of the laws that come with the package.

    Parameters
    ----------
    law : type
        An automaton class with an input ``x`` (the agent's state) and outputs ``broadcast`` and ``events``, as
        `hybrid_model.consensus.EventGenerator` has them. It may have the inputs ``neighbours`` and ``weights`` of the
        length ``degree``, and a parameter ``gain`` that is the scenario's unless it is given.
    values : mapping, optional
        Start values and parameters by name; the class's own are the defaults.

    Raises
    ------
    ScenarioError
        If the class is no event generator, or has nothing of a name that is given.

    Notes
    -----
    A law may promise two things as methods of the class, each given the values of its parameters as ``s`` and
    returning a `hybrid_model.consensus.Threshold`: ``error_bound(s)``, which ``|xhat - x|`` never exceeds, and
    ``least_error(s)``, which it has reached whenever there is a broadcast. Certificates take them at their word: the
    first gives radii, both together minimum gaps.
    """

    kind: TriggerKind = field(default=TriggerKind.OWN, init=False)
    law: type[hm.HybridAutomaton]
    values: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Make an event generator once, and look at what it hears and sends."""
        if not (isinstance(self.law, type) and issubclass(self.law, hm.HybridAutomaton)):
            raise ScenarioError(
                f"the trigger {self.name} is no class of automata; derive one from "
                "hybrid_model.consensus.EventGenerator."
            )
        made = self.make(1, 1.0)
        heard = [variable.name for variable in made.of_kind(Kind.INPUT)]
        shown = [variable.name for variable in made.variables if variable.output or variable.kind is Kind.OUTPUT]
        missing = [f"input {name}" for name in ("x",) if name not in heard]
        missing += [f"output {name}" for name in _SENT if name not in shown]
        unknown = [name for name in heard if name not in _HEARD]
        if missing or unknown:
            what = f"has no {' and no '.join(missing)}" if missing else f"has the input {unknown[0]}"
            raise ScenarioError(
                f"the trigger {self.name} {what}; an event generator hears {', '.join(_HEARD)} and has the outputs "
                f"{', '.join(_SENT)}: derive it from hybrid_model.consensus.EventGenerator."
            )

    @property
    def name(self) -> str:
        """Name of the class."""
        return getattr(self.law, "__name__", str(self.law))

    @property
    def numbers(self) -> dict[str, Any]:
        """The values that were given, by name."""
        return dict(self.values)

    def make(self, degree: int, gain: float) -> hm.HybridAutomaton:
        """Make the event generator of an agent.

        Parameters
        ----------
        degree : int
            Number of its edges.
        gain : float
            Gain k of the network.

        Raises
        ------
        ScenarioError
            If the class has nothing of a name that is given, or refuses a value.
        """
        from_scenario = dict(zip(_GIVEN, (degree, gain), strict=True))
        wanted = {name: value for name, value in from_scenario.items() if hasattr(self.law, name)}
        known = [name for name in dir(self.law) if isinstance(getattr(self.law, name), hm.Parameter | hm.State)]
        for name in self.values:
            if not hasattr(self.law, name):
                raise ScenarioError(
                    f"[trigger] {name} is given, but {self.name} has nothing of that name."
                    f"{suggestion(name, known)} It has {', '.join(known) or 'no parameters'}."
                )
        try:
            return self.law(**{**wanted, **self.values})
        except (DeclarationError, TypeError) as error:
            raise ScenarioError(f"[trigger] {self.name} cannot be made: {error}") from error

    @property
    def error_bound(self) -> Threshold | None:
        """What the law promises never to let ``|xhat - x|`` exceed; None if it promises nothing."""
        return self._promised("error_bound")

    @property
    def least_error(self) -> Threshold | None:
        """What ``|xhat - x|`` has reached at every broadcast; None if the law does not say so."""
        return self._promised("least_error")

    def _promised(self, method: str) -> Threshold | None:
        if not hasattr(self.law, method):
            return None
        made = self.make(1, 1.0)
        values = {v.name: v.start[()] for v in made.of_kind(Kind.PARAMETER)}
        promised = getattr(made, method)(Values(self.name, values))
        if not isinstance(promised, Threshold | None):
            raise ScenarioError(
                f"{method} of the trigger {self.name} gives {promised!r}; it must give a Threshold(c, beta, c0), which "
                "stands for c0 + c exp(-beta t), or None."
            )
        if promised is not None and not promised.is_possible:
            raise ScenarioError(
                f"{method} of the trigger {self.name} gives c = {promised.threshold:g}, beta = {promised.decay:g} and "
                f"c0 = {promised.offset:g}; they must be finite and not negative, and c + c0 positive: give the "
                "trigger other numbers, or mend the promise."
            )
        return promised


def read_own_trigger(table: Entries, folder: Path) -> OwnTrigger:
    """Read the table ``[trigger]`` whose kind names a class; its other keys are values of that class.

    Parameters
    ----------
    table : Entries
        Everything that is given; ``kind`` is ``file.py:ClassName``, the file counted from `folder`, or
        ``module:ClassName``.
    folder : Path
        Folder of the scenario file.

    Raises
    ------
    ScenarioError
        If the class cannot be found or imported, or a value is not possible.
    """
    values = {key: table.numbers(key) if table.lists(key) else table.number(key) for key in table if key != "kind"}
    return OwnTrigger(law=table.named("kind", folder), values=values)
