"""The trigger of a scenario as checked data: which law, and its numbers."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.declare.variables import Value

__all__ = ["Threshold", "Trigger", "TriggerKind", "trigger_keys"]


class TriggerKind(enum.Enum):
    """The trigger laws; ``hybrid_model.consensus.laws.event_generators`` makes an automaton of each.

    OWN is any class of the user's: see `hybrid_model.consensus.scenario.own_trigger`.
    """

    STATIC = "static"
    DYNAMIC = "dynamic"
    MIXED = "mixed"
    RELATIVE = "relative"
    GIRARD = "girard"
    SELF_TRIGGERED = "self-triggered"
    SAMPLED = "sampled"
    PERIODIC = "periodic"
    CONTINUOUS = "continuous"
    OWN = "file.py:ClassName"


class _Rule(enum.Enum):
    """What a number must be; the value is the end of the sentence that refuses it."""

    POSITIVE = "must be positive"
    NOT_NEGATIVE = "must not be negative"
    FRACTION = "must lie between 0 and 1, both excluded"

    def holds(self, value: float) -> bool:
        """Whether a finite number obeys the rule."""
        return {
            _Rule.POSITIVE: value > 0,
            _Rule.NOT_NEGATIVE: value >= 0,
            _Rule.FRACTION: 0 < value < 1,
        }[self]


@dataclass(frozen=True)
class _Number:
    """What a number of a law must be, and its value if it is not given; None: it must be given."""

    rule: _Rule
    default: float | None = None


@dataclass(frozen=True)
class _Law:
    """The numbers of a law, and whether it compares ``|e|`` with a function of time alone."""

    numbers: dict[str, _Number]
    has_level: bool = False


_POSITIVE = _Number(_Rule.POSITIVE)
_SHARE = _Number(_Rule.FRACTION)
_DECAY = _Number(_Rule.NOT_NEGATIVE)
_NO_DECAY = _Number(_Rule.NOT_NEGATIVE, 0.0)

_LAWS = {
    TriggerKind.STATIC: _Law({"threshold": _POSITIVE, "decay": _NO_DECAY}, has_level=True),
    TriggerKind.DYNAMIC: _Law({"threshold": _POSITIVE, "decay": _DECAY}, has_level=True),
    TriggerKind.MIXED: _Law({"offset": _POSITIVE, "threshold": _POSITIVE, "decay": _DECAY}, has_level=True),
    TriggerKind.RELATIVE: _Law({"sigma": _SHARE, "floor": _POSITIVE, "decay": _NO_DECAY}),
    TriggerKind.GIRARD: _Law({"sigma": _SHARE, "theta": _POSITIVE, "leak": _POSITIVE, "reserve": _POSITIVE}),
    TriggerKind.SELF_TRIGGERED: _Law({"threshold": _POSITIVE, "decay": _NO_DECAY}, has_level=True),
    TriggerKind.SAMPLED: _Law({"threshold": _POSITIVE, "decay": _NO_DECAY, "period": _POSITIVE}, has_level=True),
    TriggerKind.PERIODIC: _Law({"period": _POSITIVE}),
    TriggerKind.CONTINUOUS: _Law({}),
    TriggerKind.OWN: _Law({}),
}


def trigger_keys(kind: TriggerKind) -> dict[str, float | None]:
    """Return the numbers of a law: name -> value if it is not given, None if it must be given."""
    return {key: number.default for key, number in _LAWS[kind].numbers.items()}


@dataclass(frozen=True)
class Threshold:
    """The function of time that errors are compared with: ``c0 + c exp(-beta t)``.

    Static with beta = c0 = 0, dynamic with c0 = 0 (paper, section 4), else mixed (Seyboth, Dimarogonas, Johansson,
    Automatica 49 (2013) 245-252). The formula is stated here for runs, exports and bounds: it takes floats, arrays and
    symbols.

    Parameters
    ----------
    threshold : float, array or symbol
        c, in the unit of the states.
    decay : float, array or symbol
        beta in 1/s.
    offset : float, array or symbol
        c0, in the unit of the states.
    """

    threshold: Value
    decay: Value = 0.0
    offset: Value = 0.0

    def at(self, t: Value) -> Value:
        """The threshold at the time `t` in s."""
        return self.offset + self.threshold * np.exp(-self.decay * t)

    @property
    def is_possible(self) -> bool:
        """Whether numbers c, beta and c0 are finite and not negative, and c + c0 is positive."""
        numbers = (self.threshold, self.decay, self.offset)
        return all(0 <= number < math.inf for number in numbers) and self.threshold + self.offset > 0

    @property
    def exponentials(self) -> tuple[tuple[float, float], ...]:
        """Pairs (c, beta) of the exponentials ``c exp(-beta t)`` that it is the sum of."""
        decaying = (self.threshold, self.decay)
        return ((self.offset, 0.0), decaying) if self.offset else (decaying,)


@dataclass(frozen=True)
class Trigger:
    """When an agent broadcasts. Each law has numbers of its own; those of other laws are zero.

    Parameters
    ----------
    kind : TriggerKind
        The law. STATIC: ``|e| >= threshold``; DYNAMIC: ``|e| >= threshold exp(-decay t)`` (paper, section 4); MIXED:
        ``|e| >= offset + threshold exp(-decay t)``; RELATIVE and GIRARD: see
        `hybrid_model.consensus.laws.relative_triggers`; SELF_TRIGGERED: as DYNAMIC, the event time computed ahead;
        SAMPLED: as DYNAMIC, looked at every `period`; PERIODIC: a broadcast every `period`; CONTINUOUS: no error at
        all.
    threshold : float
        c > 0 (of MIXED c1), in the unit of the states.
    decay : float
        beta >= 0 [1/s].
    offset : float
        c0 > 0 of MIXED, in the unit of the states.
    sigma : float
        Share of the disagreement that the error may use up, between 0 and 1.
    floor : float
        What RELATIVE adds to the threshold of ``l_ii e**2``, positive, in the squared unit of the states per s.
    theta : float
        Weight of the instantaneous condition of GIRARD, positive [s].
    leak : float
        delta > 0 of GIRARD [1/s].
    reserve : float
        Start value of the internal variable of GIRARD, positive, in the squared unit of the states.
    period : float
        Time between checks or broadcasts, positive [s].

    Raises
    ------
    ScenarioError
        If a number is out of range, or is given to a law that has none of that name.
    """

    kind: TriggerKind
    threshold: float = 0.0
    decay: float = 0.0
    offset: float = 0.0
    sigma: float = 0.0
    floor: float = 0.0
    theta: float = 0.0
    leak: float = 0.0
    reserve: float = 0.0
    period: float = 0.0

    def __post_init__(self) -> None:
        """Check the values."""
        if not isinstance(self.kind, TriggerKind):
            raise ScenarioError(
                f"the kind of a trigger is {self.kind!r}; give a member of TriggerKind, such as DYNAMIC."
            )
        numbers = _LAWS[self.kind].numbers
        for key in (field.name for field in fields(self) if field.name != "kind"):
            value = getattr(self, key)
            if not math.isfinite(value):
                raise ScenarioError(f"[trigger] {key} is {value}; it must be a finite number.")
            if key in numbers and not numbers[key].rule.holds(value):
                raise ScenarioError(f"[trigger] {key} is {value}; it {numbers[key].rule.value}.")
            if key not in numbers and value != 0.0:
                raise ScenarioError(
                    f"[trigger] {key} is {value}, but the trigger '{self.kind.value}' has no {key}; leave it out."
                )
        if self.kind is TriggerKind.STATIC and self.decay != 0:
            raise ScenarioError(
                f"[trigger] decay is {self.decay}, but the static trigger has a constant threshold; "
                "leave decay out or set kind = 'dynamic'."
            )

    @property
    def name(self) -> str:
        """What the law is called."""
        return self.kind.value

    @property
    def numbers(self) -> dict[str, Any]:
        """The numbers of the law, by name."""
        return {key: getattr(self, key) for key in _LAWS[self.kind].numbers}

    @property
    def has_level(self) -> bool:
        """Whether the law compares ``|e|`` with a function of time, which is then `level`."""
        return _LAWS[self.kind].has_level

    def level(self, t: ArrayLike) -> NDArray[np.float64]:
        """The threshold of ``|e|`` at time `t` [s]; ScenarioError if the law has none."""
        if not self.has_level:
            raise ScenarioError(
                f"the trigger '{self.kind.value}' compares the error with no function of time alone; laws that do are "
                f"{', '.join(kind.value for kind, law in _LAWS.items() if law.has_level)}."
            )
        return np.asarray(self.threshold_in_time.at(np.asarray(t, dtype=float)))

    @property
    def threshold_in_time(self) -> Threshold:
        """The threshold of laws that have one."""
        return Threshold(self.threshold, self.decay, self.offset)
