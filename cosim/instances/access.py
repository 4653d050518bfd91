"""Scalars of a running FMU by name: read, and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from cosim.errors import CosimError
from cosim.instances.calls import FmuCalls
from cosim.instances.variables import STRUCTURAL, FmuVariables
from fmu.importer.instance import FmuInstance


class FmuAccess:
    """Access to the variables of one instance.

    Parameters
    ----------
    instance : FmuInstance
    variables : FmuVariables
        With the sizes that its arrays have.
    calls : FmuCalls

    Attributes
    ----------
    instance : FmuInstance
    """

    def __init__(self, instance: FmuInstance, variables: FmuVariables, calls: FmuCalls) -> None:
        self.instance = instance
        self._variables, self._calls = variables, calls
        self._getters: dict[str, tuple[Callable[..., list[Any]], tuple[Any, ...], int]] = {}
        self._arrays: dict[str, list[Any]] = {}

    def start(self, values: Mapping[str, Any]) -> None:
        """Write start values; structural parameters first, in the mode that FMI 3.0 has for them."""
        structural = [name for name in values if self._variables.places[name][0].causality == STRUCTURAL]
        if structural:
            self._calls(self.instance.call, "EnterConfigurationMode")
            for name in structural:
                self.write(name, values[name])
            self._calls(self.instance.call, "ExitConfigurationMode")
        for name, value in values.items():
            if name not in structural:
                self.write(name, value)

    def read(self, name: str) -> Any:
        """Return the value of a scalar.

        Raises
        ------
        CosimError
            If the FMU refuses, or gives a text that is none.
        """
        if name not in self._getters:
            variable, index = self._variables.places[name]
            self._getters[name] = *self.instance.getter(variable, self._variables.size(variable)), index
        getter, arguments, index = self._getters[name]
        try:
            return self._calls(getter, *arguments)[index]
        except (UnicodeDecodeError, AttributeError) as error:
            raise CosimError(f"{self.instance.name}.{name} holds no text in UTF-8, as FMI wants it.") from error

    def write(self, name: str, value: Any) -> None:
        """Write a scalar; of an array the others stay as they are."""
        variable, index = self._variables.places[name]
        values = [value]
        if variable.dimensions:
            values = self._whole(variable)
            values[index] = value
        try:
            self._calls(self.instance.set, variable, values)
        except CosimError as error:
            raise CosimError(f"{error} It was to set {name!r} to {value!r}.") from error

    def forget(self) -> None:
        """Forget what arrays hold: the FMU has gone to another state."""
        self._arrays.clear()

    def _whole(self, variable: Any) -> list[Any]:
        """Return the elements of an array, read once: FMI 3.0.2 section 4.2 wants a step between set and get."""
        if variable.name not in self._arrays:
            getter, arguments = self.instance.getter(variable, self._variables.size(variable))
            self._arrays[variable.name] = list(self._calls(getter, *arguments))
        return self._arrays[variable.name]
