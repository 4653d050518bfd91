"""The variables of an FMU's description as scalars under names."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from cosim.errors import CosimError
from cosim.measure import Measure
from cosim.slave import Port
from fmu.standard.units import BASE_UNITS
from fmu.standard.value_types import DISCRETE, INTEGERS, TYPES

KINDS = {"String": "text", "Binary": "bytes", "Boolean": "truth"}
"""What ports of these types carry; those of all others carry numbers."""
STRUCTURAL = "structuralParameter"


class FmuVariables:
    """The scalars of an FMU; those of arrays are counted from 1 row by row, ``w[1,2]``.

    Parameters
    ----------
    description : fmpy.model_description.ModelDescription

    Attributes
    ----------
    places : dict
        Name of a scalar -> its variable, and its place among the variable's elements.

    Raises
    ------
    CosimError
        If a unit or a size is no number, in a description that was not held against the schema.
    """

    def __init__(self, description: Any) -> None:
        self._measures = {unit.name: _measure(unit) for unit in description.unitDefinitions or ()}
        self._variables = [variable for variable in description.modelVariables if variable.type in TYPES]
        # Arrays have the sizes that structural parameters say.
        self._sizes = {
            v.valueReference: _size(v)
            for v in self._variables
            if v.causality == STRUCTURAL and v.type in INTEGERS and v.start
        }
        self._count()

    def resize(self, parameter: Any, value: int) -> None:
        """Give a structural parameter a value, and with it the arrays that have their sizes from it."""
        self._sizes[parameter.valueReference] = value
        self._count()

    def size(self, variable: Any) -> int:
        """Return the number of elements of a variable."""
        return int(np.prod(self._shape(variable)))

    def ports(self, causality: str) -> list[Port]:
        """Return the inputs or the outputs."""
        return [port for v in self._variables if v.causality == causality for port in self._ports(v)]

    def flowing(self, causality: str) -> list[str]:
        """Return the scalars among the inputs or the outputs that are numbers and change along flows."""
        found = [v for v in self._variables if v.causality == causality and v.type in ("Real", "Float64")]
        return [v.name for v in found if v.variability in (None, "continuous") and not v.dimensions]

    def smooth_outputs(self, outputs: Iterable[Any]) -> list[str]:
        """Return the flowing outputs that by the description depend on no flowing input at once.

        FMUs know the derivatives of these alone, for inputs stand still in a step, as far as they know.
        """
        inputs = set(self.flowing("input"))
        told = {unknown.variable.name: unknown.dependencies for unknown in outputs}
        return [
            name
            for name in self.flowing("output")
            if (depends := told.get(name)) is not None and not any(v.name in inputs for v in depends)
        ]

    def direct(self, outputs: Iterable[Any]) -> dict[str, list[str]]:
        """Return the inputs that outputs depend on at once, of scalars and where the description says which.

        Parameters
        ----------
        outputs : iterable of fmpy.model_description.Unknown
        """
        told = {
            unknown.variable.name: unknown.dependencies or () for unknown in outputs if not unknown.variable.dimensions
        }
        return {
            name: [v.name for v in dependencies if v.causality == "input" and not v.dimensions]
            for name, dependencies in told.items()
        }

    @property
    def tunable(self) -> list[str]:
        """Names of the parameters that may be set at events and communication points."""
        tunable = [v for v in self._variables if v.causality == "parameter" and v.variability == "tunable"]
        return [name for variable in tunable for name in self._names(variable)]

    def units(self) -> dict[str, tuple[str, Measure | None, bool]]:
        """Return the unit of each variable that has one, what it is in SI units, and whether it is a difference."""
        found = {v.name: (*self._unit(v), _is_relative(v)) for v in self._variables}
        return {name: told for name, told in found.items() if told[0]}

    def _unit(self, variable: Any) -> tuple[str, Measure | None]:
        declared = variable.declaredType
        unit = variable.unit or (declared.unit if declared else None) or ""
        measure = self._measures.get(unit)
        if measure is not None and _is_relative(variable):  # a difference: 20 degC are 20 K
            measure = replace(measure, offset=0.0)
        return unit, measure

    def _count(self) -> None:
        self.places = {
            name: (variable, place) for variable in self._variables for place, name in enumerate(self._names(variable))
        }

    def _shape(self, variable: Any) -> tuple[int, ...]:
        return tuple(
            self._sizes.get(dimension.valueReference, given)
            for dimension, given in zip(variable.dimensions, variable.shape or (), strict=True)
        )

    def _names(self, variable: Any) -> Iterator[str]:
        if not variable.dimensions:
            yield variable.name
            return
        for place in np.ndindex(*self._shape(variable)):
            yield f"{variable.name}[{','.join(str(i + 1) for i in place)}]"

    def _ports(self, variable: Any) -> Iterator[Port]:
        # FMI has nothing but floating-point numbers that changes along flows.
        discrete = variable.variability == "discrete" or variable.type in DISCRETE
        declared = variable.declaredType
        unit, measure = self._unit(variable)
        array = variable.name if variable.dimensions else ""
        kind, whole = KINDS.get(variable.type, "number"), variable.type in INTEGERS
        nominal = _nominal(variable.nominal or (declared.nominal if declared else None))
        for name in self._names(variable):
            yield Port(name, unit, discrete, kind, whole, array, measure, nominal)


def _is_relative(variable: Any) -> bool:
    declared = variable.declaredType
    return bool(variable.relativeQuantity or (declared is not None and declared.relativeQuantity))


def _nominal(text: str | None) -> float:
    """Return the size that a description says, which may be any text where it was not held against the schema."""
    try:
        size = abs(float(text or 0.0))
    except ValueError:
        return 0.0
    return size if math.isfinite(size) else 0.0


def _measure(unit: Any) -> Measure | None:
    base = unit.baseUnit
    if base is None:
        return None
    try:
        exponents = tuple(int(getattr(base, name) or 0) for name in BASE_UNITS)
        return Measure(exponents, float(base.factor or 1.0), float(base.offset or 0.0))
    except ValueError as error:
        raise CosimError(
            f"the BaseUnit of the unit {unit.name!r} is none, {error}: correct the description."
        ) from error


def _size(parameter: Any) -> int:
    try:
        return int(parameter.start)
    except ValueError as error:
        raise CosimError(
            f"{parameter.name}, a size, starts at {parameter.start!r}, which is no whole number: correct the "
            "description."
        ) from error
