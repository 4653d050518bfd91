"""Units in FMI notation, such as ``m/s2``, ``N.m`` or ``1/(m.s)``, as products of the SI base units.

The notation is that of Modelica (language specification 3.6, section 19.1): factors joined by a dot, one slash at most,
parentheses around several factors, whole exponents after the symbol, and ``1`` for the empty product.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""Attributes of the element BaseUnit, in the order of the schemas."""

Exponents = tuple[int, ...]
Factor = tuple[str, int]


@dataclass(frozen=True)
class BaseUnit:
    """A unit in terms of base units: value in base units = factor * value + offset.

    Attributes
    ----------
    exponents : tuple of int, shape (8,)
        Of kg, m, s, A, K, mol, cd, rad.
    ratio : Fraction
        The factor, without rounding: a km/h is 1000/3600 m/s.
    offset : float
        As in the FMI standard 3.0, section 2.4.3.
    """

    exponents: Exponents = (0,) * len(BASE_UNITS)
    ratio: Fraction = Fraction(1)
    offset: float = 0.0

    @property
    def factor(self) -> float:
        """The factor, as in the FMI standard 3.0, section 2.4.3."""
        return float(self.ratio)

    def attributes(self) -> dict[str, str]:
        """Return the attributes of the element BaseUnit that differ from their defaults."""
        found = {name: str(n) for name, n in zip(BASE_UNITS, self.exponents, strict=True) if n}
        if self.factor != 1.0:
            found["factor"] = repr(self.factor)
        if self.offset != 0.0:
            found["offset"] = repr(self.offset)
        return found


def _base(factor: float = 1.0, offset: float = 0.0, **exponents: int) -> BaseUnit:
    # As it is written: 1e-3 is a thousandth.
    return BaseUnit(tuple(exponents.get(name, 0) for name in BASE_UNITS), Fraction(repr(factor)), offset)


# The prefixed units kg and (from them) everything mechanical are coherent; g is what prefixes are set before.
_PREFIXABLE = {
    "m": _base(m=1),
    "g": _base(1e-3, kg=1),
    "s": _base(s=1),
    "A": _base(A=1),
    "K": _base(K=1),
    "mol": _base(mol=1),
    "cd": _base(cd=1),
    "rad": _base(rad=1),
    "sr": _base(rad=2),
    "Hz": _base(s=-1),
    "N": _base(kg=1, m=1, s=-2),
    "Pa": _base(kg=1, m=-1, s=-2),
    "J": _base(kg=1, m=2, s=-2),
    "W": _base(kg=1, m=2, s=-3),
    "C": _base(s=1, A=1),
    "V": _base(kg=1, m=2, s=-3, A=-1),
    "F": _base(kg=-1, m=-2, s=4, A=2),
    "Ohm": _base(kg=1, m=2, s=-3, A=-2),
    "S": _base(kg=-1, m=-2, s=3, A=2),
    "Wb": _base(kg=1, m=2, s=-2, A=-1),
    "T": _base(kg=1, s=-2, A=-1),
    "H": _base(kg=1, m=2, s=-2, A=-2),
    "lm": _base(cd=1, rad=2),
    "lx": _base(m=-2, cd=1, rad=2),
    "Bq": _base(s=-1),
    "Gy": _base(m=2, s=-2),
    "Sv": _base(m=2, s=-2),
    "kat": _base(s=-1, mol=1),
    "l": _base(1e-3, m=3),
    "bar": _base(1e5, kg=1, m=-1, s=-2),
    "eV": _base(1.602176634e-19, kg=1, m=2, s=-2),
}
_PLAIN = {
    "min": _base(60.0, s=1),
    "h": _base(3600.0, s=1),
    "d": _base(86400.0, s=1),
    "deg": _base(math.pi / 180.0, rad=1),
    "rev": _base(2.0 * math.pi, rad=1),
    "rpm": _base(math.pi / 30.0, s=-1, rad=1),
    "t": _base(1e3, kg=1),
    "ha": _base(1e4, m=2),
    "degC": _base(1.0, 273.15, K=1),
    "degF": _base(5.0 / 9.0, 459.67 * 5.0 / 9.0, K=1),
    "%": _base(1e-2),
}
_PREFIXES = {
    **{"Q": 30, "R": 27, "Y": 24, "Z": 21, "E": 18, "P": 15, "T": 12, "G": 9, "M": 6, "k": 3, "h": 2, "da": 1},
    **{"d": -1, "c": -2, "m": -3, "u": -6, "n": -9, "p": -12, "f": -15, "a": -18, "z": -21, "y": -24},
}
_LETTERS = str.maketrans({"²": "2", "³": "3", "⁻": "-", "¹": "1", "µ": "u", "μ": "u", "Ω": "Ohm", "°": "deg"})
_SYMBOLS = {
    **{"m": "meter metre", "g": "gram", "kg": "kilogram kilo kgs", "km": "kilometer kilometre", "l": "liter litre"},
    **{
        "s": "second sec",
        "min": "minute",
        "h": "hour hr",
        "d": "day",
        "ms": "msec millisecond",
        "us": "usec microsecond",
    },
    **{"A": "ampere amp", "K": "kelvin", "rad": "radian", "deg": "degree", "Hz": "hertz", "N": "newton", "J": "joule"},
    **{"Pa": "pascal", "W": "watt", "V": "volt", "F": "farad", "Ohm": "ohm", "C": "coulomb", "mol": "mole"},
    **{"degC": "celsius degcelsius", "degF": "fahrenheit degfahrenheit", "%": "percent", "rev": "revolution turn"},
    **{"mm": "millimeter millimetre", "cm": "centimeter centimetre", "rpm": "rpm", "t": "tonne ton"},
}
_WORDS = {form: symbol for symbol, words in _SYMBOLS.items() for word in words.split() for form in (word, f"{word}s")}
_KNOWN = {symbol.lower(): symbol for symbol in reversed([*_PREFIXABLE, *_PLAIN, "kg", "km", "kW", "kHz", "kPa", "MHz"])}
_SMALLEST, _LARGEST = Fraction(sys.float_info.min), Fraction(sys.float_info.max)
_FACTOR = re.compile(r"(?P<symbol>[A-Za-z%]+)(?P<exponent>[+-]?\d{1,3})?")


@dataclass(frozen=True)
class _Expression:
    """A unit as it is written: factors above and below the slash."""

    above: Sequence[Factor] = ()
    below: Sequence[Factor] = ()

    @property
    def factors(self) -> list[Factor]:
        return [*self.above, *((symbol, -exponent) for symbol, exponent in self.below)]


def base_unit(text: str) -> BaseUnit | None:
    """Return a unit in terms of base units.

    Parameters
    ----------
    text : str
        Unit in FMI notation.

    Returns
    -------
    BaseUnit or None
        None for a unit that is not known, not written in this notation, or beyond the range of numbers.
    """
    expression = _parse(text)
    if expression is None:
        return None
    factors = expression.factors
    if len(factors) == 1 and factors[0][1] == 1:
        return _symbol(factors[0][0])
    exponents, ratio = [0] * len(BASE_UNITS), Fraction(1)
    for symbol, power in factors:
        known = _symbol(symbol)
        # A scale with an offset has no products: 1/degC is a difference's, m.degC is nothing.
        if known is None or known.offset:
            return None
        exponents = [total + power * n for total, n in zip(exponents, known.exponents, strict=True)]
        ratio *= known.ratio**power
    return BaseUnit(tuple(exponents), ratio) if _SMALLEST <= ratio <= _LARGEST else None


def nearest_unit(text: str) -> str | None:
    """Return what a unit is called in FMI notation that is written as people write it.

    Parameters
    ----------
    text : str
        Such as ``meter``, ``m/s^2``, ``km*h-1``, ``Hertz`` or ``°C``.

    Returns
    -------
    str or None
        ``m``, ``m/s2`` and so on; None if the unit is known as it is, or means nothing that is known.
    """
    if not text or base_unit(text) is not None:
        return None
    plain = text.strip().replace("**", "").replace("^", "").replace("−", "-").translate(_LETTERS)
    plain = re.sub(r"[ *·⋅×]+", ".", re.sub(r"\s*([/*·()])\s*", r"\1", plain))
    above, *below = re.split(r"/|\.?\bper\b\.?", plain)
    if len(below) == 1 and "." in below[0] and not below[0].startswith("("):
        return None
    bottom = ".".join(part.strip("()") for part in below)
    joined = f"{above or '1'}/{bottom if '.' not in bottom else f'({bottom})'}" if below else above
    meant = re.sub(r"[^\W\d_]+", lambda word: _WORDS.get(word[0].lower(), word[0]), joined)
    found = next((unit for unit in (meant, _KNOWN.get(meant.lower(), "")) if base_unit(unit)), None)
    expression = _parse(found) if found else None
    return _written(_merged(expression.above), _merged(expression.below)) if expression else None


def unit_per_second(text: str) -> str:
    """Return the unit of a quantity's time derivative: ``m/s2`` for ``m/s``, ``1/s`` for ``1``.

    Parameters
    ----------
    text : str
        Unit in FMI notation.

    Returns
    -------
    str
        Empty if the unit is empty, or not written in this notation; ``K/s`` for temperatures in degC.
    """
    expression = _parse(text)
    if expression is None or "degF" in text:
        return ""
    above = [("K" if symbol == "degC" else symbol, power) for symbol, power in expression.above]
    below = list(expression.below)
    for side, change in ((below, 1), (above, -1)):
        at = next((k for k, (symbol, _) in enumerate(side) if symbol == "s"), None)
        if at is not None:
            power = side[at][1] + change
            side[at : at + 1] = [("s", power)] if power else []
            return _written(above, below)
    return _written(above, [*below, ("s", 1)])


def _merged(factors: Sequence[Factor]) -> list[Factor]:
    powers: dict[str, int] = {}
    for symbol, power in factors:
        powers[symbol] = powers.get(symbol, 0) + power
    return list(powers.items())


def _parse(text: str) -> _Expression | None:
    above, slash, below = text.partition("/")
    if not slash and text == "1":
        return _Expression()
    numerator = [] if above == "1" else _factors(above)
    denominator = _factors(below) if slash else []
    if numerator is None or denominator is None:
        return None
    if len(denominator) > 1 and not below.startswith("("):
        return None  # J/kg.K means J/(kg.K) to some and J.K/kg to others
    return _Expression(tuple(numerator), tuple(denominator))


def _factors(text: str) -> list[Factor] | None:
    inner = text[1:-1] if text.startswith("(") and text.endswith(")") else text
    found = [_FACTOR.fullmatch(part) for part in inner.split(".")]
    if not all(found):
        return None
    return [(match["symbol"], int(match["exponent"] or 1)) for match in found if match]


def _symbol(symbol: str) -> BaseUnit | None:
    known = _PLAIN.get(symbol) or _PREFIXABLE.get(symbol)
    if known is not None:
        return known if symbol != "g" else _PREFIXABLE["g"]
    for length in (1, 2):
        prefix, unit = symbol[:length], _PREFIXABLE.get(symbol[length:])
        if prefix in _PREFIXES and unit is not None:
            return BaseUnit(unit.exponents, unit.ratio * Fraction(10) ** _PREFIXES[prefix])
    return None


def _written(above: Sequence[Factor], below: Sequence[Factor]) -> str:
    def product(factors: Sequence[Factor]) -> str:
        return ".".join(symbol if power == 1 else f"{symbol}{power}" for symbol, power in factors)

    if not below:
        return product(above) or "1"
    bottom = product(below)
    return f"{product(above) or '1'}/{bottom if len(below) == 1 else f'({bottom})'}"
