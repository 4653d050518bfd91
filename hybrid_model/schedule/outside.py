"""What the parts of a network are given from outside while it runs: inputs and parameters as functions of time."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.signals import Inputs
from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.native.driven import Driven, drive, given_on
from hybrid_model.native.network_run import NativeNetwork
from hybrid_model.native.replay import EVENT, Happening

_OF = {Kind.INPUT: Happening.GIVEN_INPUT, Kind.PARAMETER: Happening.GIVEN_PARAMETER}


@dataclass(frozen=True, eq=False)
class Given:
    """What one part is given.

    Attributes
    ----------
    inputs : Inputs
        Its inputs and parameters.
    driven : Driven or None
        Those inputs that vary, as the compiled model follows them.
    ends : sequence of float
        Breakpoints in s, and the end of the run.
    """

    inputs: Inputs
    driven: Driven | None
    ends: Sequence[float]

    @classmethod
    def of(cls, inputs: Inputs, span: tuple[float, float]) -> Given | None:
        """Return what a part is given in a run; None if that does not change.

        Raises
        ------
        TraceError
            If a function of time cannot be followed on the engine in C.
        """
        breakpoints = inputs.breakpoints_in(*span)
        if not inputs.vary and not breakpoints:
            return None
        return cls(inputs, drive(inputs, span) if inputs.vary else None, [*breakpoints, span[1]])

    @functools.cached_property
    def tuned(self) -> list[int]:
        """The places of parameters that change."""
        return [k for place in self.inputs.tuned for k in range(place.at.start, place.at.stop)]

    def begin(self, u: FloatArray, p: FloatArray, t: float) -> tuple[FloatArray, FloatArray]:
        """Return the inputs and the parameters of a part at the start `t` in s, which has these by itself."""
        inputs, parameters = self.piece(t, 0)
        first, tuned = len(self.inputs.held), p.copy()
        tuned[self.tuned] = parameters[self.tuned]
        return np.concatenate([u[:first], inputs[first:]]), tuned

    def piece(self, a: float, k: int) -> tuple[FloatArray, FloatArray]:
        """Return the inputs and the parameters from `a` in s to the end number `k`."""
        return given_on(self.inputs, self.driven, a, self.ends[k], closed=k == len(self.ends) - 1)


class Outside:
    """What all parts of a run are given, and what has been given so far.

    Parameters
    ----------
    given : mapping
        Number of a part -> what it is given.
    """

    def __init__(self, given: Mapping[int, Given]) -> None:
        self._given = given
        self._happened: dict[int, list[tuple[float, float, int, Happening]]] = {part: [] for part in given}
        self._after: dict[int, list[int]] = {part: [] for part in given}

    def times(self) -> list[tuple[float, list[tuple[int, int]]]]:
        """Return the breakpoints in s, in order, with the parts that have them and their numbers there."""
        found: dict[float, list[tuple[int, int]]] = {}
        for part, given in self._given.items():
            for k, time in enumerate(given.ends[:-1]):
                found.setdefault(time, []).append((part, k))
        return sorted(found.items())

    def begin(self, network: NativeNetwork) -> None:
        """No part looks beyond its first breakpoint."""
        for part, given in self._given.items():
            network.look_until(part, given.ends[0])

    def give(self, network: NativeNetwork, part: int, k: int, events: int) -> bool:
        """Give a part what it has from a breakpoint on, after so many events; False if the run is over by that."""
        given = self._given[part]
        u, p = given.piece(given.ends[k], k + 1)
        network.look_until(part, given.ends[k + 1])
        # The inputs of the automaton that vary are computed from those behind them; the others are received.
        driving = range(len(given.inputs.held), len(u))
        for kind, values, places in ((Kind.INPUT, u, driving), (Kind.PARAMETER, p, given.tuned)):
            for index in places:
                self._happened[part].append((given.ends[k], float(values[index]), index, _OF[kind]))
                self._after[part].append(events)
                if not network.receive(part, kind, index, float(values[index])):
                    return False
        return True

    def of_part(self, part: int) -> tuple[npt.NDArray[np.void], npt.NDArray[np.int64]]:
        """Return what a part was given (see `EVENT`), and how many events of the network there were before each."""
        return np.array(self._happened.get(part, []), EVENT), np.array(self._after.get(part, []), np.int64)
