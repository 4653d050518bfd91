"""Values of the types of FMI, exact: what a type cannot hold is refused by name, never rounded, cut or wrapped."""

from __future__ import annotations

import decimal
import math
import operator
from typing import Any

from fmu.standard.value_types import FLOATS, limits

Value = float | str | bytes
"""What a variable holds: a number, an int or bool exactly as such, a text, or bytes."""
_DIGITS = 400
"""Longest number that is read digit by digit; none that fits any type is longer."""


class UnfitError(ValueError):
    """A variable of an FMU does not hold a value; the message names both, and what it holds."""


def exact(variable: Any, value: Value, name: str) -> Any:
    """Return a value as the variable's type holds it.

    Parameters
    ----------
    variable : fmpy.model_description.ModelVariable
    value : float, int, bool, str or bytes
        A number for numbers and Booleans, a number or the name of an item for enumerations, text for strings.
    name : str
        What messages call the variable.

    Raises
    ------
    UnfitError
        If the type does not hold the value, with both and the rule.
    """
    kind = variable.type
    if kind == "String" or kind == "Binary":
        wanted = str if kind == "String" else bytes
        if not isinstance(value, wanted):
            raise _misfit(name, value, kind, "give text" if kind == "String" else "give bytes")
        return value
    if kind == "Enumeration":
        return _item(variable, value, name)
    if isinstance(value, (str, bytes)):
        raise _misfit(name, value, kind, "give a number")
    if kind in FLOATS:
        return _float(kind, value, name)
    whole = _whole(value)
    if kind == "Boolean":
        if whole not in (0, 1):
            raise _misfit(name, value, kind, "give true or false")
        return bool(whole)
    low, high = limits(kind)
    if whole is None or not low <= whole <= high:
        raise _misfit(name, value, kind, f"give a whole number from {low} to {high}")
    return whole


def parsed(variable: Any, text: str, name: str) -> Value:
    """Return the value that a text says, to be made `exact`.

    Parameters
    ----------
    variable : fmpy.model_description.ModelVariable
    text : str
        A number; ``true`` or ``false``; the name of an item of an enumeration; text; the digits of bytes, base 16.
    name : str
        What messages call the variable.

    Raises
    ------
    UnfitError
        If the text is no value of the variable's type.
    """
    kind = variable.type
    if kind == "String" or (kind == "Enumeration" and text in _items(variable)):
        return text
    if kind == "Binary":
        try:
            return bytes.fromhex(text)
        except ValueError:
            raise _misfit(name, text, kind, "give its bytes by pairs of digits of base 16") from None
    if kind == "Boolean" and text.lower() in ("true", "false"):
        return text.lower() == "true"
    try:
        if kind in FLOATS:
            return float(text)
        number = decimal.Decimal(text)
    except (ValueError, decimal.InvalidOperation):
        if kind == "Enumeration":
            return text  # refused with the names that there are
        raise _misfit(name, text, kind, "give true or false" if kind == "Boolean" else "give a number") from None
    if not number.is_finite() or abs(number.adjusted()) > _DIGITS or number != number.to_integral_value():
        return float(number)  # refused by what it is set to
    return int(number)


def require_within(variable: Any, value: Any, name: str) -> None:
    """Refuse a number outside the range that the description gives.

    Raises
    ------
    UnfitError
        With the value and the range.
    """
    if isinstance(value, (str, bytes)):
        return
    declared = variable.declaredType
    for bound, beyond, word in (("min", operator.lt, "below"), ("max", operator.gt, "above")):
        text = getattr(variable, bound) or (getattr(declared, bound) if declared else None)
        read = float if variable.type in FLOATS else decimal.Decimal  # no rounding in 64-bit integers
        limit = None if text is None else read(text)
        if limit is not None and beyond(value, limit):
            raise UnfitError(f"{name} is set to {value}, {word} its {bound}imum {text}: give a value in its range.")


def shown(value: Value) -> str:
    """Return a value as people read it; integers with all their digits."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, bytes):
        return value.hex()
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def _float(kind: str, value: float, name: str) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise UnfitError(f"{name} is set to {value}: set a finite number.")
    if abs(number) > FLOATS[kind]:
        raise _misfit(name, value, kind, f"give a number of at most {FLOATS[kind]:.8g} in size")
    return number


def _whole(value: float) -> int | None:
    if isinstance(value, float):
        return int(value) if value.is_integer() else None
    return operator.index(value)


def _items(variable: Any) -> dict[str, int]:
    return {item.name: int(item.value) for item in (variable.declaredType.items if variable.declaredType else [])}


def _item(variable: Any, value: Value, name: str) -> int:
    items = _items(variable)
    number = items.get(value) if isinstance(value, str) else None if isinstance(value, bytes) else _whole(value)
    if number is None or (items and number not in items.values()):
        told = ", ".join(f"{item} ({number})" for item, number in items.items())
        raise _misfit(name, value, "Enumeration", f"give one of {told}" if told else "give a whole number")
    return number


def _misfit(name: str, value: Value, kind: str, remedy: str) -> UnfitError:
    article = "an" if kind[0] in "EI" else "a"
    return UnfitError(f"{name} is set to {value!r}, but it is {article} {kind}: {remedy}.")
