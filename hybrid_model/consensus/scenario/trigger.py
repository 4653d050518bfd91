"""The trigger of a scenario as checked data: which law, and its numbers."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.thresholds import mixed_threshold

__all__ = ["Trigger", "TriggerKind", "trigger_keys"]


class TriggerKind(enum.Enum):
    """The trigger laws; ``hybrid_model.consensus.laws.trigger_blocks`` makes an automaton of each."""

    STATIC = "static"
    DYNAMIC = "dynamic"
    MIXED = "mixed"
    RELATIVE = "relative"
    GIRARD = "girard"
    SELF_TRIGGERED = "self-triggered"
    SAMPLED = "sampled"
    PERIODIC = "periodic"
    CONTINUOUS = "continuous"


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


_THRESHOLD = {"threshold": _Rule.POSITIVE, "decay": _Rule.NOT_NEGATIVE}
_KEYS: dict[TriggerKind, dict[str, _Rule]] = {
    TriggerKind.STATIC: _THRESHOLD,
    TriggerKind.DYNAMIC: _THRESHOLD,
    TriggerKind.MIXED: {"offset": _Rule.POSITIVE, **_THRESHOLD},
    TriggerKind.RELATIVE: {"sigma": _Rule.FRACTION, "floor": _Rule.POSITIVE, "decay": _Rule.NOT_NEGATIVE},
    TriggerKind.GIRARD: {
        "sigma": _Rule.FRACTION,
        "theta": _Rule.POSITIVE,
        "leak": _Rule.POSITIVE,
        "reserve": _Rule.POSITIVE,
    },
    TriggerKind.SELF_TRIGGERED: _THRESHOLD,
    TriggerKind.SAMPLED: {**_THRESHOLD, "period": _Rule.POSITIVE},
    TriggerKind.PERIODIC: {"period": _Rule.POSITIVE},
    TriggerKind.CONTINUOUS: {},
}
_NO_DECAY_NEEDED = (TriggerKind.STATIC, TriggerKind.RELATIVE, TriggerKind.SELF_TRIGGERED, TriggerKind.SAMPLED)
_WITH_LEVEL = (
    TriggerKind.STATIC,
    TriggerKind.DYNAMIC,
    TriggerKind.MIXED,
    TriggerKind.SELF_TRIGGERED,
    TriggerKind.SAMPLED,
)


def trigger_keys(kind: TriggerKind) -> dict[str, float | None]:
    """Return the numbers of a law: name -> value if it is not given, None if it must be given."""
    return {key: 0.0 if key == "decay" and kind in _NO_DECAY_NEEDED else None for key in _KEYS[kind]}


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
        rules = _KEYS[self.kind]
        for key in (field.name for field in fields(self) if field.name != "kind"):
            value = getattr(self, key)
            if not math.isfinite(value):
                raise ScenarioError(f"[trigger] {key} is {value}; it must be a finite number.")
            if key in rules and not rules[key].holds(value):
                raise ScenarioError(f"[trigger] {key} is {value}; it {rules[key].value}.")
            if key not in rules and value != 0.0:
                raise ScenarioError(
                    f"[trigger] {key} is {value}, but the trigger '{self.kind.value}' has no {key}; leave it out."
                )
        if self.kind is TriggerKind.STATIC and self.decay != 0:
            raise ScenarioError(
                f"[trigger] decay is {self.decay}, but the static trigger has a constant threshold; "
                "leave decay out or set kind = 'dynamic'."
            )

    @property
    def has_level(self) -> bool:
        """Whether the law compares ``|e|`` with a function of time, which is then `level`."""
        return self.kind in _WITH_LEVEL

    def level(self, t: ArrayLike) -> NDArray[np.float64]:
        """The threshold of ``|e|`` at time `t` [s]; ScenarioError if the law has none."""
        if not self.has_level:
            raise ScenarioError(
                f"the trigger '{self.kind.value}' compares the error with no function of time alone; laws that do are "
                f"{', '.join(kind.value for kind in _WITH_LEVEL)}."
            )
        time = np.asarray(t, dtype=float)
        return np.asarray(mixed_threshold(self.offset, self.threshold, self.decay, time))
