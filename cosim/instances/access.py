"""Scalars of a running FMU by name: read, and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

from cosim.errors import CosimError
from cosim.instances.calls import FmuCalls
from cosim.instances.variables import STRUCTURAL, FmuVariables
from fmu.importer.instance import BoundCall, FmuInstance


@dataclass(frozen=True)
class FmuReader:
    """Reads scalars of one instance.

    Attributes
    ----------
    calls : FmuCalls
    bound : list of BoundCall
        What reads numbers.
    others : dict
        Scalars that are read one by one, by name, and their values.
    at : list of tuple
        For each scalar, in order, where its value is: an array or a table, and the place there.
    """

    access: FmuAccess
    calls: FmuCalls
    bound: list[BoundCall]
    others: dict[str, Any]
    at: list[tuple[Any, Any]]

    def __call__(self) -> list[Any]:
        """Return the values."""
        self.calls(self.access.instance.call_all, self.bound)
        for name in self.others:
            self.others[name] = self.access.read(name)
        return [values[k] for values, k in self.at]


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
        self._getters: dict[str, Callable[[], Any]] = {}
        self._setters: dict[str, Callable[[Sequence[Any]], None]] = {}
        self._writers: dict[str, Callable[[Any], None]] = {}
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
            self._getters[name] = self._getter(*self._variables.places[name])
        try:
            return self._getters[name]()
        except (UnicodeDecodeError, AttributeError) as error:
            raise CosimError(f"{self.instance.name}.{name} holds no text in UTF-8, as FMI wants it.") from error

    def _getter(self, variable: Any, index: int) -> Callable[[], Any]:
        calls, instance, size = self._calls, self.instance, self._variables.size(variable)
        if instance.in_one_call(variable) is None:
            getter, arguments = instance.getter(variable, size)
            return lambda: calls(getter, *arguments)[index]
        bound = [instance.numbers([variable], [size])]
        values = bound[0].values

        def read() -> Any:
            calls(instance.call_all, bound)
            return values[index]

        return read

    def reader(self, names: Sequence[str]) -> FmuReader:
        """Return what reads scalars: numbers of one type in one call of the FMU, and all else one by one."""
        groups: dict[str, list[str]] = {}
        for name in names:
            kind = self.instance.in_one_call(self._variables.places[name][0])
            if kind is not None:
                groups.setdefault(kind, []).append(name)
        bound, places = [], dict[str, tuple[Any, Any]]()
        for group in groups.values():
            call, found = self._group(group)
            bound.append(call)
            places |= found
        # One by one, into a table by name.
        others: dict[str, Any] = {name: None for name in names if name not in places}
        places |= {name: (others, name) for name in others}
        return FmuReader(self, self._calls, bound, others, [places[name] for name in names])

    def _group(self, names: Sequence[str]) -> tuple[BoundCall, dict[str, tuple[Any, Any]]]:
        """Return the call that reads scalars of one type, and in which array, and where in it, it puts each of them."""
        variables = {place[0].valueReference: place[0] for place in map(self._variables.places.__getitem__, names)}
        sizes = [self._variables.size(variable) for variable in variables.values()]
        firsts = dict(zip(variables, accumulate([0, *sizes]), strict=False))
        call = self.instance.numbers(list(variables.values()), sizes)
        owners = {name: self._variables.places[name] for name in names}
        return call, {
            name: (call.values, firsts[variable.valueReference] + index) for name, (variable, index) in owners.items()
        }

    def write(self, name: str, value: Any) -> None:
        """Write a scalar; of an array the others stay as they are."""
        if name not in self._writers:
            self._writers[name] = self.writer(name)
        self._writers[name](value)

    def writer(self, name: str) -> Callable[[Any], None]:
        """Return what writes a scalar, for one who writes it often."""
        variable, index = self._variables.places[name]
        if variable.name not in self._setters:
            setter = self.instance.writer(variable, self._variables.size(variable))
            self._setters[variable.name] = self._calls.bound(setter)
        put, is_array = self._setters[variable.name], bool(variable.dimensions)

        def write(value: Any) -> None:
            values = [value]
            if is_array:
                values = self._whole(variable)
                values[index] = value
            try:
                put(values)
            except CosimError as error:
                raise CosimError(f"{error} It was to set {name!r} to {value!r}.") from error

        return write

    def held(self) -> dict[str, list[Any]]:
        """Return what is known of arrays, to be `recalled` with the FMU's state of now."""
        return {name: list(values) for name, values in self._arrays.items()}

    def recall(self, held: dict[str, list[Any]]) -> None:
        """Know of arrays what was known when the FMU had the state that it has returned to."""
        self._arrays = {name: list(values) for name, values in held.items()}

    def _whole(self, variable: Any) -> list[Any]:
        """Return the elements of an array, read once: FMI 3.0.2 section 4.2 wants a step between set and get."""
        if variable.name not in self._arrays:
            getter, arguments = self.instance.getter(variable, self._variables.size(variable))
            self._arrays[variable.name] = list(self._calls(getter, *arguments))
        return self._arrays[variable.name]
