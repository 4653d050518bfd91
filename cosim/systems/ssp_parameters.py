"""Parameter bindings in an SSP file: which values they give, and under which names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from cosim.measure import Measure
from cosim.systems.ssp_elements import SspFile, children, is_suppressed, within
from cosim.systems.ssp_units import Unit

_SET, _MAPPING = "application/x-ssp-parameter-set", "application/x-ssp-parameter-mapping"


@dataclass(frozen=True)
class Given:
    """A value for a parameter, and how it arrives there.

    Attributes
    ----------
    value : str or list of str
        As it is written; the elements of an array row by row.
    unit : Unit, optional
    factor, offset : float
        Of its transformation, which comes after the conversion of units.
    converted : bool
        Whether its unit is converted.
    """

    value: str | list[str]
    unit: Unit | None = None
    factor: float = 1.0
    offset: float = 0.0
    converted: bool = True


@dataclass(frozen=True)
class _Entry:
    target: str
    factor: float
    offset: float
    converted: bool


def parameters_of(element: Any, file: SspFile, units: Mapping[str, Measure]) -> dict[str, Given]:
    """Return the values that the bindings of a component or system give, by the names that these have there.

    Of several bindings the last counts. Where there is a mapping, what it does not name is not applied, and one value
    may have several targets (SSP 2.0, sections 5.2.3 and 7.1).

    Parameters
    ----------
    element : lxml.etree._Element
        Component or System.
    file : SspFile
    units : mapping
        Those of the file, which sets of parameters in it may use too.

    Raises
    ------
    MisfitError
        If a file is missing or of another kind, or a mapping makes no sense.
    """
    values: dict[str, Given] = {}
    for binding in within(element, "ParameterBindings", "ParameterBinding"):
        file.require_type(binding, _SET, "its parameters")
        prefix = binding.get("prefix", "")
        if binding.get("source") is not None:
            sets, around = [file.parsed(file.file(binding.get("source"), "parameters"))], {}
        else:
            around = dict(units)
            sets = [s for v in children(binding, "ParameterValues") for s in children(v, "ParameterSet")]
        found = {
            prefix + name: given for one in sets for name, given in _set(one, file, around | file.units(one)).items()
        }
        mapping = _mapping(binding, file)
        if mapping is None:
            values |= found
            continue
        for name, entries in mapping.items():
            for to in entries if name in found else ():
                given = found[name]
                values[to.target] = Given(given.value, given.unit, to.factor, to.offset, to.converted)
    return values


def _set(root: Any, file: SspFile, units: Mapping[str, Measure]) -> dict[str, Given]:
    """Return the values of a set of parameters as they are written, with their units."""
    values: dict[str, Given] = {}
    for parameter in within(root, "Parameters", "Parameter"):
        is_array, name = bool(children(parameter, "Dimension")), parameter.get("name", "")
        if not name:
            raise file.misfit("it has a parameter without a name")
        for typed in parameter:
            listed, unit = [element.get("value") for element in children(typed, "Value")], typed.get("unit")
            if None in listed:
                raise file.misfit(f"its parameter {name!r} has a Value that gives none")
            known = Unit(unit, units.get(unit)) if unit else None
            if listed:
                values[name] = Given(listed if is_array else listed[0], known)
            elif typed.get("value") is not None:
                values[name] = Given(typed.get("value").split() if is_array else typed.get("value"), known)
        if name not in values:
            raise file.misfit(f"its parameter {name!r} has no value")
    return values


def _mapping(binding: Any, file: SspFile) -> dict[str, list[_Entry]] | None:
    """Return where a mapping leads names; None if there is none."""
    elements = children(binding, "ParameterMapping")
    if not elements:
        return None
    found: dict[str, list[_Entry]] = {}
    targets = set[str]()
    for element in elements:
        file.require_type(element, _MAPPING, "the entries of a mapping")
        source = element.get("source")
        inner = children(element, "ParameterMapping") or [element]
        for root in [file.parsed(file.file(source, "a mapping"))] if source is not None else inner:
            for entry in children(root, "MappingEntry"):
                told, target = f"the mapping of {entry.get('source')}", entry.get("target")
                if target is None:
                    raise file.misfit(f"{told} has no target")
                if target in targets:
                    raise file.misfit(f"{told} has the target {target}, which another entry has too: leave one out")
                targets.add(target)
                made = _Entry(target, *file.scale(entry, told), not is_suppressed(entry))
                found.setdefault(entry.get("source", ""), []).append(made)
    return found
