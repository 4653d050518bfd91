"""The error of slips in scenarios, and how its messages write values: short, whatever a file holds."""

import math
from collections.abc import Iterable

__all__ = ["ScenarioError", "enumerated", "shown"]

_MANY, _FIRST = 30, 10
_LONGEST = 60
_DIGITS = 30
_ITEMS = 12


class ScenarioError(ValueError):
    """A scenario that cannot be run; the message names the entry, its value, the rule and the remedy."""


def shown(value: object) -> str:
    """How a message writes a value: as the file does, cut if it is long."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return _whole_number(value)
    if isinstance(value, str):
        # Control characters would break the sentence or the terminal.
        return f"'{_cut(''.join(c if c.isprintable() else repr(c)[1:-1] for c in value[:_LONGEST]), len(value))}'"
    if isinstance(value, list):
        items = ", ".join(shown(item) for item in value[:_ITEMS])
        return _cut(f"[{items}]") if len(value) <= _ITEMS else _cut(f"[{items}, ...]")
    if isinstance(value, dict):
        return "a table"
    return _cut(str(value))


def _whole_number(value: int) -> str:
    # Python refuses to print integers of more than 4300 digits, so these are counted in binary.
    if abs(value) < 10**_DIGITS:
        return str(value)
    digits = math.floor(abs(value).bit_length() * math.log10(2))
    digits += abs(value) >= 10**digits
    sign = "-" if value < 0 else ""
    return f"{sign}{abs(value) // 10 ** (digits - 4)}... ({digits} digits)"


def _cut(text: str, length: int = 0) -> str:
    return text if max(len(text), length) <= _LONGEST else text[: _LONGEST - 3] + "..."


def enumerated(values: Iterable[object]) -> str:
    """Values with commas between them; of many the first ones, and how many there are."""
    texts = [str(value) for value in values]
    if len(texts) <= _MANY:
        return ", ".join(texts)
    return f"{', '.join(texts[:_FIRST])}, ... ({len(texts)} in all)"
