"""Elements of an SSP file's XML: found by names without their namespaces, which both versions share, and read."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from cosim.errors import MisfitError
from cosim.measure import Measure
from cosim.systems.ssp_units import measure_of
from fmu.importer.plain_xml import PlainXmlError, parse_plain


def local(element: Any) -> str:
    """Return the name of an element without its namespace; nothing for comments."""
    return str(element.tag).rpartition("}")[2] if isinstance(element.tag, str) else ""


def children(elements: Iterable[Any], name: str) -> list[Any]:
    """Return the elements of a name among those in an element."""
    return [element for element in elements if local(element) == name]


def within(element: Any, group: str, name: str) -> list[Any]:
    """Return the elements of a name in the group of an element that lists them."""
    return children(next(iter(children(element, group)), ()), name)


def is_suppressed(element: Any) -> bool:
    """Return whether units are not converted along a connection or an entry of a mapping."""
    return element.get("suppressUnitConversion") in ("true", "1")


class SspFile:
    """One file of a system, and what its parts are relative to.

    Parameters
    ----------
    folder : Path
    told : str
        What messages call it.
    """

    def __init__(self, folder: Path, told: str) -> None:
        self.folder, self.told = folder.resolve(), told

    def file(self, source: str | None, what: str) -> Path:
        """Return the path of a part, as a URI relative to this file (RFC 3986).

        Raises
        ------
        MisfitError
            If it is no file, or not below the folder.
        """
        for name in (source or "", unquote(source or "")):
            path = (self.folder / name).resolve()
            if path.is_relative_to(self.folder) and path.is_file():
                return path
        raise self.misfit(f"{what} is said to be in {source!r}, which is no file in it")

    def parsed(self, path: Path) -> Any:
        """Return the root of a file of XML.

        Raises
        ------
        MisfitError
            If it must not be read, or is no XML.
        """
        try:
            return parse_plain(path.read_bytes(), path.name)
        except (PlainXmlError, OSError) as error:
            raise self.misfit(str(error)) from error

    def units(self, root: Any) -> dict[str, Measure]:
        """Return what the units that a root declares are in SI units.

        Raises
        ------
        MisfitError
            If one is no unit.
        """
        found = {}
        for unit in within(root, "Units", "Unit"):
            for base in children(unit, "BaseUnit"):
                try:
                    found[unit.get("name", "")] = measure_of(base.attrib)
                except ValueError as error:
                    told = f"the BaseUnit of its unit {unit.get('name')!r} has an exponent that is no whole number"
                    raise self.misfit(f"{told}, or a factor or an offset that is no number") from error
        return found

    def scale(self, element: Any, told: str) -> tuple[float, float]:
        """Return factor and offset of an element with or without a transformation.

        Raises
        ------
        MisfitError
            If it is not linear, or they are no numbers.
        """
        found = [child for child in element if local(child).endswith("Transformation")]
        if not found:
            return 1.0, 0.0
        if local(found[0]) != "LinearTransformation":
            raise self.misfit(f"{told} has a {local(found[0])}, and linear ones alone are supported")
        factor, offset = (
            self.number(found[0].get(name, default), f"the {name} of {told}")
            for name, default in (("factor", "1"), ("offset", "0"))
        )
        return factor, offset

    def number(self, text: str, what: str) -> float:
        """Return the finite number that a text says.

        Raises
        ------
        MisfitError
            If it says none.
        """
        try:
            number = float(text)
        except ValueError:
            raise self.misfit(f"{what} is {text!r}, which is no number") from None
        if not math.isfinite(number):
            raise self.misfit(f"{what} is {text!r}, which is not finite")
        return number

    def require_type(self, element: Any, expected: str, what: str) -> None:
        """Refuse a part of another kind, or one that lies inside a component.

        Raises
        ------
        MisfitError
            With the kind that is read.
        """
        if element.get("type") not in (None, expected):
            raise self.misfit(f"{what} are of type {element.get('type')!r}, and {expected} alone is read")
        if element.get("sourceBase") not in (None, "SSD"):
            raise self.misfit(f"{what} lie inside a component (sourceBase): put them beside the {self.told}")

    def misfit(self, why: str) -> MisfitError:
        """Return the error for what is wrong."""
        return MisfitError(f"{self.told} cannot be run: {why}.")
