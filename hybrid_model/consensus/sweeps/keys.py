"""The keys of a scenario file by name, ``trigger.decay`` or ``network.initial[2]``, and other values under them.

A key in a table of a table is ``network.initial.seed``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hybrid_model.consensus.sweeps.errors import SweepError

__all__ = ["Key", "with_values"]

_FORM = re.compile(r"(?P<path>[a-z_]+(?:\.[a-z_]+)*)(?P<places>(?:\[[0-9]+\])*)")


@dataclass(frozen=True)
class Key:
    """A key of a scenario file.

    Attributes
    ----------
    path : tuple of str
        Names of the tables around it, and its own.
    places : tuple of int
        Where in its list, and in the lists there, counted from 1.
    """

    path: tuple[str, ...]
    places: tuple[int, ...]

    @classmethod
    def read(cls, text: str) -> Key:
        """Read a key.

        Raises
        ------
        SweepError
            If it has not the form of one.
        """
        found = _FORM.fullmatch(text)
        if found is None:
            raise SweepError(
                f"'{text}' is no key of a scenario: write table.key, such as trigger.decay, or table.key[2] for an "
                "element of a list, counted from 1."
            )
        places = tuple(int(place) for place in re.findall("[0-9]+", found["places"]))
        return cls(tuple(found["path"].split(".")), places)


def with_values(entries: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entries of a scenario file with other values; tables that are missing are added.

    Parameters
    ----------
    entries : Mapping
        Of the file, as parsed; they are not changed.
    values : Mapping
        Key -> value. Those of elements of a list come after that of the whole list.

    Raises
    ------
    SweepError
        If a key is none, or names an element that is not there.
    """
    changed = dict(entries)
    for text, value in sorted(values.items(), key=lambda item: item[0].count("[")):
        key = Key.read(text)
        *tables, name = key.path
        _require_table(text, key.path, entries)
        place: dict[str, Any] = changed
        for table in tables:
            inner = place.get(table, {})
            if not isinstance(inner, dict):
                raise SweepError(f"'{text}' names an entry of {table}, which is no table in this scenario.")
            # Copied on the way: the entries that were given stay as they are.
            place[table] = place = dict(inner)
        place[name] = _replaced(text, place.get(name), key.places, value) if key.places else value
    return changed


def _require_table(text: str, path: Sequence[str], entries: Mapping[str, Any]) -> None:
    """Refuse a key of a table that is named without it."""
    if len(path) > 1 or path[0] in entries:
        return
    tables = [table for table, inner in entries.items() if isinstance(inner, dict) and path[0] in inner]
    if tables:
        meant = " or ".join(f"{table}.{text}" for table in tables)
        raise SweepError(f"'{text}' is no key at the top of a scenario: write {meant}.")


def _replaced(text: str, given: Any, places: tuple[int, ...], value: Any) -> Any:
    """A copy of a list with another value at a place."""
    if not places:
        return value
    place, *rest = places
    if not isinstance(given, list) or not 1 <= place <= len(given):
        has = f"has {len(given)} elements" if isinstance(given, list) else "is no list"
        raise SweepError(f"'{text}' names element {place} of a list, but what this scenario has there {has}.")
    copy = list(given)
    copy[place - 1] = _replaced(text, given[place - 1], tuple(rest), value)
    return copy
