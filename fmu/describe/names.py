"""Names of variables by the naming conventions of the FMI standard (3.0, section 2.4.7.5.1; 2.0, section 2.2.9).

The structured convention is that of Modelica: parts joined by dots, each an identifier or anything in apostrophes, with
indices in brackets, and ``der(...)`` around the name of a time derivative. Letters beyond ASCII have no place in it:
an FMU with such a name has the flat convention, which takes names as they are.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from fmu.describe.xml_text import in_xml
from fmu.errors import ExportError

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_QUOTED = re.compile(r"'(?:[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['\"?\\abfnrtv])+'")
_INDICES = re.compile(r"\[\d+(?:,\d+)*\]")
_QUOTABLE = re.compile(r"[A-Za-z0-9_!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]")
_ESCAPES = {c: f"\\{c}" for c in "'\"\\"} | {
    "\a": "\\a",
    "\b": "\\b",
    "\f": "\\f",
    "\n": "\\n",
    "\r": "\\r",
    "\t": "\\t",
    "\v": "\\v",
}


def variable_names(owner: str, names: Sequence[str]) -> tuple[list[str], str]:
    """Return the names as they stand in the description, and the naming convention that all of them follow.

    Parameters
    ----------
    owner : str
        Name of the automaton, for messages.
    names : sequence of str
        Names of the variables, with indices and ``der(...)`` where they have them.

    Returns
    -------
    names : list of str
        In the same order; parts that are no identifiers are quoted, ``'a b'``.
    convention : {"structured", "flat"}
        Flat, with the names unchanged, if there is one that the structured convention cannot write.

    Raises
    ------
    ExportError
        If a name is empty, holds a character that neither convention takes, or comes twice.
    """
    structured = [structured_name(name) for name in names]
    written = [name for name in structured if name is not None]
    convention = "structured"
    if len(written) < len(names):
        convention, written = "flat", [_flat(owner, name) for name in names]
    twice = next((name for name, count in Counter(written).items() if count > 1), None)
    if twice is not None:
        raise ExportError(f"{owner} has two variables called {shortened(twice)}: rename one.")
    return written, convention


def structured_name(name: str) -> str | None:
    """Return a name by the structured convention, quoted where it must be; None if it cannot be written.

    Parameters
    ----------
    name : str
        Any text.
    """
    if name.startswith("der(") and name.endswith(")"):
        inner = structured_name(name[4:-1])
        # The derivative of a derivative is a name of its own and not der(der(x)), which the convention has not.
        if inner is not None and not inner.startswith("der("):
            return f"der({inner})"
    parts = [_part(part) for part in _split(name)]
    return ".".join(part for part in parts if part) if all(parts) else None


def _split(name: str) -> list[str]:
    """Split at the dots that are outside apostrophes."""
    parts: list[str] = []
    rest = name
    while True:
        quoted = _QUOTED.match(rest)
        dot = rest.find(".", quoted.end() if quoted else 0)
        if dot < 0:
            return [*parts, rest]
        parts.append(rest[:dot])
        rest = rest[dot + 1 :]


def _part(part: str) -> str | None:
    bracket = part.rfind("[")
    base, indices = (part[:bracket], part[bracket:]) if bracket > 0 else (part, "")
    if not (indices and _INDICES.fullmatch(indices)):
        base, indices = part, ""
    if _PLAIN.fullmatch(base) or _QUOTED.fullmatch(base):
        return base + indices
    characters = [_ESCAPES.get(c) or (c if _QUOTABLE.fullmatch(c) else "") for c in base]
    return f"'{''.join(characters)}'{indices}" if characters and all(characters) else None


def _flat(owner: str, name: str) -> str:
    if not name:
        raise ExportError(f"{owner} has a variable without a name: every variable of an FMU needs one.")
    bad = next((c for c in name if c in "\t\n\r" or not in_xml(c)), None)
    if bad is not None:
        raise ExportError(
            f"{owner} has a variable called {shortened(name)}: a name in a model description cannot hold the "
            f"character {bad!r}. Rename the variable."
        )
    return name


def shortened(name: str) -> str:
    """Return a name in quotes for a message, at most some 60 characters of it."""
    return repr(name) if len(name) <= 60 else f"{name[:50]!r}... ({len(name)} characters)"
