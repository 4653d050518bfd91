"""The axes of a sweep: which values a key of the scenario takes."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.keys import Key

__all__ = ["Axis", "Choice", "Range", "Seeds", "as_axis", "read_axis"]

MOST_RUNS = 10_000_000
"""More are a slip."""
SEED_LIMIT = 2**31 - 1
"""Seeds are below this, as those of channels must be."""


@dataclass(frozen=True)
class Axis:
    """A key of the scenario that varies; `read_axis` has the notation.

    Attributes
    ----------
    key : str
        As in `hybrid_model.consensus.sweeps.keys`.
    """

    key: str
    kind: ClassVar[str]

    def __post_init__(self) -> None:
        """Check the key."""
        Key.read(self.key)

    def on_grid(self) -> list[Any]:
        """Return the values on a grid.

        Raises
        ------
        SweepError
            If the axis has none.
        """
        raise NotImplementedError

    def at(self, share: float) -> Any:
        """Return the value below which a share of the axis lies, from 0 to below 1."""
        raise NotImplementedError


@dataclass(frozen=True)
class Choice(Axis):
    """Listed values, of any kind that a scenario file can hold.

    Attributes
    ----------
    values : tuple
        On a grid all of them in turn; drawn, each as often as any other.
    """

    values: tuple[Any, ...]
    kind = "choice"

    def __post_init__(self) -> None:
        """Check that there is a value."""
        super().__post_init__()
        if not self.values:
            raise SweepError(f"{self.key} has no value to take: list one at least.")

    def on_grid(self) -> list[Any]:
        """See `Axis.on_grid`."""
        return list(self.values)

    def at(self, share: float) -> Any:
        """See `Axis.at`."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]


@dataclass(frozen=True)
class Range(Axis):
    """Numbers between two.

    Attributes
    ----------
    low, high : float
        The ends, both in it.
    count : int or None
        Number of values on a grid; None where values are drawn only.
    logarithmic : bool
        Whether equal ratios count the same, not equal differences; then the ends are positive.
    """

    low: float
    high: float
    count: int | None = None
    logarithmic: bool = False
    kind = "range"

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise SweepError(
                f"{self.key} goes from {self.low} to {self.high}: give two finite numbers, the lower first."
            )
        if self.logarithmic and self.low <= 0:
            raise SweepError(f"{self.key} goes from {self.low} on a logarithmic axis: begin above zero.")
        if self.count is not None and self.count < 2:
            raise SweepError(f"{self.key} has {self.count} values: a range has two ends, so give 2 or more.")
        if self.count is not None and self.count > MOST_RUNS:
            raise SweepError(
                f"{self.key} has {self.count} values; a sweep can have at most {MOST_RUNS} runs: give fewer."
            )

    def on_grid(self) -> list[Any]:
        """See `Axis.on_grid`."""
        if self.count is None:
            raise SweepError(
                f"{self.key} has no number of values for a grid: write {self.key}={self.low:g}:{self.high:g}:10, or "
                "choose a design that draws values."
            )
        spaced = np.geomspace if self.logarithmic else np.linspace
        return [float(value) for value in spaced(self.low, self.high, self.count)]

    def at(self, share: float) -> Any:
        """See `Axis.at`."""
        if self.logarithmic:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))


@dataclass(frozen=True)
class Seeds(Axis):
    """A seed for each run, all different, spawned from that of the sweep."""

    kind = "seeds"


def read_axis(text: str) -> Axis:
    """Read an axis.

    Parameters
    ----------
    text : str
        ``key=low:high:count`` or ``key=low:high:count:log``, the count left out where values are drawn;
        ``key=a,b,c`` for numbers or words; ``key=[...]`` for a list of values as TOML has them, such as
        ``network.edges=[[[1, 2], [2, 3]], [[1, 2], [1, 3]]]``; ``key=seeds``.

    Raises
    ------
    SweepError
        If it is none of these.
    """
    key, equals, rest = (part.strip() for part in text.partition("="))
    if not equals or not rest:
        raise SweepError(f"'{text}' is no axis: write key=low:high:count, key=a,b,c or key=seeds.")
    if rest == "seeds":
        return Seeds(key)
    if rest.startswith("["):
        try:
            values = tomllib.loads(f"v = {rest}")["v"]
        except ValueError as error:
            raise SweepError(f"the values of {key} are no list in TOML: {error}.") from error
        return Choice(key, tuple(values))
    if ":" in rest:
        return _range(key, rest)
    return Choice(key, tuple(_word(word.strip()) for word in rest.split(",")))


def as_axis(given: Axis | str) -> Axis:
    """Return an axis given as one or in the notation of `read_axis`."""
    return given if isinstance(given, Axis) else read_axis(given)


def _range(key: str, rest: str) -> Range:
    parts = rest.split(":")
    logarithmic = parts[-1] == "log"
    numbers = parts[:-1] if logarithmic else parts
    try:
        low, high, *count = (float(part) for part in numbers)
        whole = [int(number) for number in count]
    except (ValueError, OverflowError) as error:
        raise SweepError(_no_range(key, rest)) from error
    if len(count) > 1 or whole != count:
        raise SweepError(_no_range(key, rest))
    return Range(key, low, high, whole[0] if whole else None, logarithmic)


def _no_range(key: str, rest: str) -> str:
    return f"'{rest}' is no range for {key}: write low:high:count, with :log behind it for a logarithmic axis."


def _word(text: str) -> Any:
    """A number or a truth value as TOML has it, else the text itself."""
    try:
        return tomllib.loads(f"v = {text}")["v"]
    except ValueError:
        return text


def spawned_seeds(sequence: np.random.SeedSequence, count: int) -> Sequence[int]:
    """Return a seed for each of so many runs; the first ones do not depend on how many there are."""
    return [int(child.generate_state(1)[0]) % SEED_LIMIT for child in sequence.spawn(count)]
