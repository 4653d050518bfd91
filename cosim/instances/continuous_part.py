"""The continuous part of a Model Exchange FMU as functions of time and states: rates, and event indicators."""

from __future__ import annotations

import ctypes

import numpy as np

from cosim.errors import CosimError
from cosim.instances.calls import FmuCalls
from fmu.importer.instance import FmuInstance
from hybrid_model.declare.variables import FloatArray


class ContinuousPart:
    """Calls of the functions that only Model Exchange has.

    Parameters
    ----------
    instance : FmuInstance
        Of kind ``ModelExchange``, initialised.
    calls : FmuCalls
    states, indicators : int
        How many there are.
    completes : bool
        Whether the FMU wants to hear of each step of the solver.
    """

    def __init__(self, instance: FmuInstance, calls: FmuCalls, states: int, indicators: int, completes: bool) -> None:
        self._instance, self._calls, self._completes = instance, calls, completes
        self._x, self._dx = (ctypes.c_double * max(states, 1))(), (ctypes.c_double * max(states, 1))()
        self._z = (ctypes.c_double * max(indicators, 1))()
        self.states, self.indicators = states, indicators

    def put(self, t: float, x: FloatArray) -> None:
        """Go to time `t` in s and states `x`."""
        self._calls(self._instance.call, "SetTime", t)
        if self.states:
            self._x[: self.states] = x.tolist()
            self._calls(self._instance.call, "SetContinuousStates", self._x, self.states)

    def at(self) -> FloatArray:
        """Return the continuous states."""
        if self.states:
            self._calls(self._instance.call, "GetContinuousStates", self._x, self.states)
        return np.array(self._x[: self.states])

    def nominals(self) -> FloatArray:
        """Return the usual sizes of the states, 1 where the FMU says none."""
        if not self.states:
            return np.zeros(0)
        try:
            self._calls(self._instance.call, "GetNominalsOfContinuousStates", self._dx, self.states)
        except CosimError:
            return np.ones(self.states)
        found = np.abs(np.array(self._dx[: self.states]))
        return np.where((found > 0.0) & np.isfinite(found), found, 1.0)

    def rates(self, t: float, x: FloatArray) -> FloatArray:
        """Return dx/dt at `t` in s.

        Raises
        ------
        CosimError
            If the FMU refuses, or a derivative is not finite.
        """
        self.put(t, x)
        if not self.states:
            return np.zeros(0)
        self._calls(self._instance.call, "GetContinuousStateDerivatives", self._dx, self.states)
        return np.array(self._dx[: self.states])

    def margins(self, t: float, x: FloatArray) -> FloatArray:
        """Return the event indicators at `t` in s."""
        self.put(t, x)
        if self.indicators:
            self._calls(self._instance.call, "GetEventIndicators", self._z, self.indicators)
        return np.array(self._z[: self.indicators])

    def completed(self) -> tuple[bool, bool]:
        """Tell the FMU that a step is done; return whether it wants event mode, and the end of the run."""
        if not self._completes:
            return False, False
        event, terminate = self._calls(self._instance.fmu.completedIntegratorStep)
        return bool(event), bool(terminate)

    def begin_flow(self) -> None:
        """Enter the mode in which time goes on."""
        self._calls(self._instance.call, "EnterContinuousTimeMode")
