"""What the parts of a network as arrays are given while it runs: one function of time for all, or one for each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hybrid_model.declare.layout import layout_of
from hybrid_model.declare.real_numbers import told
from hybrid_model.declare.signals import Inputs, InputValue, Signal
from hybrid_model.declare.variables import Kind, unknown_name
from hybrid_model.errors import WiringError
from hybrid_model.schedule.network_arrays import Network
from hybrid_model.schedule.outside import Given


class NetworkInputs:
    """Functions of time for inputs and tunable parameters of the parts.

    Parameters
    ----------
    network : Network
        Whose parts they are given to.
    inputs : mapping
        Input that no part sends to, or tunable parameter -> a function of time or a `Signal` for all parts, or a
        sequence with one for each part, None where it keeps its value.

    Raises
    ------
    WiringError
        For a name that the parts do not have or hear others by, or for what does not follow time.
    """

    def __init__(self, network: Network, inputs: Mapping[str, Any]) -> None:
        self._network = network
        for name in inputs:
            self._require_free(name)
        self._given = {name: self._follows(name, value) for name, value in inputs.items()}

    def of_part(self, part: int) -> dict[str, InputValue]:
        """Return what a part is given, counted from 0: name -> function of time."""
        found = {name: value[part] if isinstance(value, list) else value for name, value in self._given.items()}
        return {name: value for name, value in found.items() if value is not None}

    def scoped(self) -> dict[str, InputValue]:
        """Return the same for the network as a composition, whose names begin with the part's."""
        names = self._network.parts
        return {f"{names[k]}.{name}": value for k in range(len(names)) for name, value in self.of_part(k).items()}

    def given(self, span: tuple[float, float]) -> dict[int, Given]:
        """Return what parts are given in a run from start to end, in s; parts that are given the same share it.

        Raises
        ------
        TraceError
            If a function of time cannot be followed on the engine in C.
        """
        known: dict[tuple[int, ...], Given | None] = {}
        found = {}
        for part in range(len(self._network.parts) if self._given else 0):
            own = self.of_part(part)
            key = int(self._network.group_of[part]), *(id(own.get(name)) for name in self._given)
            if key not in known:
                known[key] = Given.of(Inputs(layout_of(self._network.template(part)), own), span)
            if (one := known[key]) is not None:
                found[part] = one
        return found

    def _require_free(self, name: str) -> None:
        network = self._network
        if name in network.signals:
            raise WiringError(f"{network.name}: {name} is what parts hear of others: leave it out of the inputs.")
        for template in network.templates:
            known = {variable.name: variable for variable in template.of_kind(Kind.INPUT, Kind.PARAMETER)}
            if name not in known:
                raise WiringError(unknown_name(f"each part of {network.name}", name, known, "input"))

    def _follows(self, name: str, value: Any) -> Any:
        count = len(self._network.parts)
        if _follows_time(value):
            return value
        each = list(value) if hasattr(value, "__len__") and not isinstance(value, (str, Mapping)) else []
        if len(each) == count and all(one is None or _follows_time(one) for one in each):
            return each
        raise WiringError(
            f"{self._network.name}: {name} = {told(value)} among the inputs: give one function of time or Signal for "
            f"all parts, or a list of {count}, one for each part; numbers are given among the values of the network."
        )


def _follows_time(value: Any) -> bool:
    return callable(value) or isinstance(value, Signal)
