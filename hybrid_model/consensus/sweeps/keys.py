"""The keys of a scenario file by name, ``trigger.decay`` or ``network.initial[2]``, and other values under them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hybrid_model.consensus.sweeps.errors import SweepError

__all__ = ["Key", "with_values"]

_FORM = re.compile(r"(?:(?P<table>[a-z_]+)\.)?(?P<key>[a-z_]+)(?P<places>(?:\[[0-9]+\])*)")


@dataclass(frozen=True)
class Key:
    """A key of a scenario file.

    Attributes
    ----------
    table : str
        Its table; empty for a key in front of all tables.
    key : str
        Its name.
    places : tuple of int
        Where in its list, and in the lists there, counted from 1.
    """

    table: str
    key: str
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
        return cls(found["table"] or "", found["key"], places)


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
    changed = {name: dict(entry) if isinstance(entry, dict) else entry for name, entry in entries.items()}
    for text, value in sorted(values.items(), key=lambda item: item[0].count("[")):
        key = Key.read(text)
        table: Any = changed.setdefault(key.table, {}) if key.table else changed
        if not isinstance(table, dict):
            raise SweepError(f"'{text}' names an entry of {key.table}, which is no table in this scenario.")
        if not key.places:
            table[key.key] = value
            continue
        table[key.key] = _replaced(text, table.get(key.key), key.places, value)
    return changed


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
