"""Typed values out of the tables of a TOML file, with errors that name the table, the key, the value and the rule."""

import difflib
import enum
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from hybrid_model.consensus.messages import ScenarioError, shown
from hybrid_model.errors import ImportFailedError, NamingError
from hybrid_model.named_objects import imports_from, is_target, named_object

__all__ = ["Entries", "suggestion"]

Choice = TypeVar("Choice", bound=enum.Enum)

_LARGEST = 1e300
_LIMIT = 2**63


def suggestion(name: str, known: Iterable[str]) -> str:
    """`` Did you mean '...'?`` with the nearest of the `known` names, or nothing if none is near."""
    by_small_letters = {each.lower(): each for each in known}
    nearest = difflib.get_close_matches(name.lower(), list(by_small_letters), n=1)
    return f" Did you mean '{by_small_letters[nearest[0]]}'?" if nearest else ""


class Entries:
    """The entries of one table of a scenario file.

    Parameters
    ----------
    name : str
        How messages call it, such as ``[network]``.
    given : Mapping
        As parsed.
    known : iterable of str
        The keys that it may have.

    Raises
    ------
    ScenarioError
        If there is a key that is not known.
    """

    def __init__(self, name: str, given: Mapping[str, Any], known: Iterable[str]) -> None:
        """Check the keys."""
        self.name = name
        self._given = given
        names = list(known)
        for key in given:
            if key not in names:
                raise ScenarioError(
                    f"{name} has the unknown key {shown(key)}.{suggestion(key, names)} Known keys: {', '.join(names)}."
                )

    def __contains__(self, key: str) -> bool:
        """Whether the key is given."""
        return key in self._given

    def __iter__(self) -> Iterator[str]:
        """The keys that are given."""
        return iter(self._given)

    def target(self, key: str) -> str | None:
        """The value of a key if it names an object of the user's, as ``file.py:Name`` does; otherwise None."""
        value = self._given.get(key)
        return value if isinstance(value, str) and is_target(value) else None

    def named(self, key: str, folder: Path) -> Any:
        """The object that the value of `target` names, its file counted from `folder`; imports it, or ScenarioError."""
        target = self.text(key)
        try:
            with imports_from(str(folder / target)):
                return named_object(target, folder)
        except (NamingError, ImportFailedError) as error:
            raise ScenarioError(f"{self.name} {key}: {error}") from error

    def lists(self, key: str) -> bool:
        """Whether the key is given, as a list."""
        return isinstance(self._given.get(key), list)

    def error(self, key: str, value: object, rule: str) -> ScenarioError:
        """The error for a value that breaks a rule ("it must ...")."""
        return ScenarioError(f"{self.name} {key} is {shown(value)}; it {rule}.")

    def raw(self, key: str, rule: str) -> Any:
        """The entry as parsed; ScenarioError if it is missing."""
        if key not in self._given:
            raise ScenarioError(f"{self.name} has no '{key}'; it {rule}.")
        return self._given[key]

    def text(self, key: str) -> str:
        """A string."""
        rule = "must be a string"
        value = self.raw(key, rule)
        if not isinstance(value, str):
            raise self.error(key, value, rule)
        return value

    def choice(self, key: str, choices: type[Choice], default: Choice | None = None) -> Choice:
        """A member of an enumeration, by its value."""
        if default is not None and key not in self:
            return default
        names = [member.value for member in choices]
        rule = "must be one of " + ", ".join(f"'{name}'" for name in names)
        value = self.raw(key, rule)
        if not isinstance(value, str) or value not in names:
            near = suggestion(value, names) if isinstance(value, str) else ""
            raise ScenarioError(f"{self.name} {key} is {shown(value)}; it {rule}.{near}")
        return choices(value)

    def number(self, key: str, default: float | None = None) -> float:
        """A finite number."""
        if default is not None and key not in self:
            return default
        return self._as_number(key, self.raw(key, "must be a number"))

    def numbers(self, key: str) -> tuple[float, ...]:
        """A list of finite numbers."""
        return tuple(self._as_number(f"{key}[{place}]", value) for place, value in self._listed(key, "numbers"))

    def whole_number(self, key: str) -> int:
        """An integer."""
        return self._as_whole_number(key, self.raw(key, "must be a whole number"))

    def whole_number_lists(self, key: str) -> tuple[tuple[int, ...], ...]:
        """A list of lists of integers."""
        rows = []
        for place, row in self._listed(key, "lists of whole numbers"):
            name = f"{key}[{place}]"
            if not isinstance(row, list):
                raise self.error(name, row, "must be a list of whole numbers")
            rows.append(tuple(self._as_whole_number(f"{name}[{k}]", value) for k, value in enumerate(row, start=1)))
        return tuple(rows)

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        if key not in self:
            return default
        value = self._given[key]
        if not isinstance(value, bool):
            raise self.error(key, value, "must be true or false")
        return value

    def rows(self, key: str, count: int, of_what: str = "edges", shared: bool = True) -> tuple[tuple[float, ...], ...]:
        """A list of numbers for each of `count` things; if it may be `shared`, a single list stands for all."""
        listed = self._listed(key, "lists of numbers")
        rows = [row for _, row in listed]
        if shared and rows and not isinstance(rows[0], list):
            return (self.numbers(key),) * count
        for place, row in enumerate(rows, start=1):
            if not isinstance(row, list):
                raise self.error(f"{key}[{place}]", row, "must be a list of numbers")
        if len(rows) != count:
            also = ", or a single list for all" if shared else ""
            raise ScenarioError(
                f"{self.name} {key} lists {len(rows)} lists for {count} {of_what}; give one list for each{also}."
            )
        return tuple(
            tuple(self._as_number(f"{key}[{place}][{k}]", value) for k, value in enumerate(row, start=1))
            for place, row in enumerate(rows, start=1)
        )

    def per_edge(self, key: str, edge_count: int, default: float | None = None) -> tuple[float, ...]:
        """A number for each edge: a list of `edge_count` numbers, or one number that stands for all edges."""
        return self.per_item(key, edge_count, "edges", default)

    def per_item(self, key: str, count: int, of_what: str, default: float | None = None) -> tuple[float, ...]:
        """A number for each of `count` things, or one number that stands for all."""
        if not self.lists(key):
            return (self.number(key, default),) * count
        values = self.numbers(key)
        if len(values) != count:
            raise ScenarioError(
                f"{self.name} {key} lists {len(values)} numbers for {count} {of_what}; "
                "give one number for each of them, or a single number for all."
            )
        return values

    def _listed(self, key: str, of_what: str) -> enumerate[Any]:
        rule = f"must be a list of {of_what}"
        value = self.raw(key, rule)
        if not isinstance(value, list):
            raise self.error(key, value, rule)
        return enumerate(value, start=1)

    def _as_number(self, key: str, value: object) -> float:
        # A TOML boolean is an int to Python; "gain = true" is a slip, not the number 1.
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, value, "must be a number")
        # Not a number compares with nothing; whole numbers may be too large for a float.
        if not abs(value) <= _LARGEST:
            raise self.error(key, value, f"must be a finite number, at most {_LARGEST:g} in size")
        return float(value)

    def _as_whole_number(self, key: str, value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise self.error(key, value, "must be a whole number")
        if not -_LIMIT <= value < _LIMIT:
            raise self.error(key, value, "must be a whole number of at most 64 bits, as TOML has it")
        return value
