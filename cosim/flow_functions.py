"""The flow of a Model Exchange FMU as functions, and its linearisation by the derivatives that the FMU provides.

For tools that want dx/dt = f(t, x, u) and y = g(t, x, u) and look after time and states themselves.
"""

from __future__ import annotations

import contextlib
import ctypes
import math
import shutil
import weakref
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model
from fmpy.fmi3 import FMU3Model

from fmu.archives.reading import Archive
from fmu.importer.callbacks import Callbacks
from fmu.importer.loading import load_binary, read_description
from fmu.importer.temporary_folders import temporary_folder
from fmu.importer.unpacking import unpack
from fmu.importer.values import exact
from fmu.standard.value_types import accessor

FloatArray = npt.NDArray[np.float64]
MAX_ITERATIONS = 1000
"""Most event iterations at the start."""


class FlowError(ValueError):
    """An FMU cannot be used as functions; the message says why."""


class Linearization(NamedTuple):
    """Matrices of the deviations from a point: dx' = A dx + B du, dy = C dx + D du.

    Attributes
    ----------
    A, B, C, D : ndarray
        Shapes (n, n), (n, m), (p, n), (p, m).
    """

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray


class FlowFunctions:
    """The flow and the outputs of a Model Exchange FMU, of FMI 2.0 or 3.0, ours or anybody's.

    The FMU is brought to its start, events there included, and its discrete states then stay as they are: the functions
    are the FMU between two events. Loading an FMU runs its native code in this process: load only FMUs that you trust.

    Parameters
    ----------
    path : str or Path
        The FMU.
    start : mapping, optional
        Parameter or start value -> number.
    t_start : float
        Time in s.

    Attributes
    ----------
    states, inputs, outputs : tuple of str
        Names of the scalars: all continuous states, the inputs that may change along flows, and the outputs of floating
        point type. Elements of arrays are counted from 1, ``x[2]``. Discrete inputs keep their start values.
    x, u : ndarray
        Values at the start, shapes (n,) and (m,).

    Raises
    ------
    FlowError
        If the file is no Model Exchange FMU for this machine, or it refuses a value or to start.
    """

    def __init__(self, path: str | Path, start: Mapping[str, float] | None = None, *, t_start: float = 0.0) -> None:
        try:
            with Archive(path) as archive:
                description = read_description(path)
                if description.modelExchange is None or description.fmiVersion == "1.0":
                    raise FlowError("it has no Model Exchange of FMI 2.0 or 3.0")
                folder = temporary_folder()
                weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
                unpack(archive, folder)
                self._provides_derivatives = _provides_derivatives(archive.read("modelDescription.xml"))
            self._begin(description, folder, dict(start or {}), t_start)
        except Exception as error:
            raise FlowError(f"{path} cannot be run: {error}") from error

    def derivatives(self, t: float, x: npt.ArrayLike, u: npt.ArrayLike = ()) -> FloatArray:
        """Return dx/dt, shape (n,), at time t in s, states x (n,) and inputs u (m,)."""
        get = self._fmu.getDerivatives if self._fmi2 else self._fmu.getContinuousStateDerivatives
        with self._at(t, x, u):
            get(self._buffer, len(self.states))
        return np.array(self._buffer[: len(self.states)])

    def values(self, t: float, x: npt.ArrayLike, u: npt.ArrayLike = ()) -> FloatArray:
        """Return the outputs, shape (p,), at time t in s, states x (n,) and inputs u (m,)."""
        with self._at(t, x, u):
            return self._get(self._outputs)

    def linearize(self, t: float, x: npt.ArrayLike, u: npt.ArrayLike = ()) -> Linearization:
        """Return the linearisation at a point, by directional derivatives: exact but for rounding.

        Raises
        ------
        FlowError
            If the FMU provides no directional derivatives.
        """
        if not self._provides_derivatives:
            raise FlowError(f"{self.name} provides no directional derivatives: it cannot be linearised by them.")
        rows, knowns = [*self._rates, *self._outputs], [*self._x, *self._u]
        with self._at(t, x, u):
            columns = [self._sensitivity(rows, known, k) for known in knowns for k in range(_size(known))]
        n, total = len(self.states), len(self.states) + len(self.outputs)
        found = np.array(columns).reshape(-1, total).T
        return Linearization(found[:n, :n], found[:n, n:], found[n:, :n], found[n:, n:])

    def close(self) -> None:
        """Free the instance and unload the binary; nothing works after it."""
        self._end()

    def _begin(self, description: Any, folder: Path, start: dict[str, float], t_start: float) -> None:
        self.name = str(description.modelName)
        self._fmi2 = description.fmiVersion == "2.0"
        interface = description.modelExchange
        variables = description.modelVariables
        self._rates = [unknown.variable for unknown in description.derivatives]
        self._x = [variable.derivative for variable in self._rates]
        floats = [variable for variable in variables if variable.type in ("Real", "Float64")]
        self._u = [
            variable for variable in floats if variable.causality == "input" and variable.variability != "discrete"
        ]
        self._outputs = [variable for variable in floats if variable.causality == "output"]
        self.states, self.inputs, self.outputs = (
            tuple(name for variable in group for name in _names(variable))
            for group in (self._x, self._u, self._outputs)
        )
        self._buffer = (ctypes.c_double * max(len(self.states), 1))()
        token = description.guid if self._fmi2 else description.instantiationToken
        self._fmu = load_binary(
            FMU2Model if self._fmi2 else FMU3Model,
            folder,
            2 if self._fmi2 else 3,
            guid=token,
            modelIdentifier=interface.modelIdentifier,
            instanceName=self.name,
        )
        self._end = weakref.finalize(self, _free, self._fmu, self._instantiate())
        known = {variable.name: variable for variable in variables}
        for name, value in start.items():
            if name not in known:
                raise FlowError(f"it has no variable {name!r}; it has {', '.join(known)}")
            self._set(known[name], [value])
        self._initialize(t_start)
        self._fmu.getContinuousStates(self._buffer, len(self.states))
        self.x, self.u = np.array(self._buffer[: len(self.states)]), self._get(self._u)

    def _instantiate(self) -> Callbacks | None:
        # Messages are dropped: fmpy tells by an exception which function failed.
        if not self._fmi2:
            self._fmu.instantiate(logMessage=lambda environment, status, category, message: None)
            return None
        callbacks = Callbacks(lambda status, message: None, self.name)
        try:
            self._fmu.instantiate(callbacks=callbacks.functions)
        except Exception:
            callbacks.release()
            raise
        return callbacks

    def _initialize(self, t_start: float) -> None:
        if self._fmi2:
            self._fmu.setupExperiment(startTime=t_start)
            self._fmu.enterInitializationMode()
        else:
            self._fmu.enterInitializationMode(startTime=t_start)
        self._fmu.exitInitializationMode()
        update = self._fmu.newDiscreteStates if self._fmi2 else self._fmu.updateDiscreteStates
        for _ in range(MAX_ITERATIONS):
            again, terminate, *_ = update()
            if terminate:
                raise FlowError("it ends its run at the start")
            if not again:
                self._fmu.enterContinuousTimeMode()
                return
        raise FlowError(f"it asks for more than {MAX_ITERATIONS} event iterations at the start")

    @contextlib.contextmanager
    def _at(self, t: float, x: npt.ArrayLike, u: npt.ArrayLike) -> Iterator[None]:
        try:
            self._put(t, x, u)
            yield
        except FMICallException as error:
            raise FlowError(f"{self.name}: {error.function} failed at t = {t:.17g}, x = {x!r}, u = {u!r}.") from error

    def _put(self, t: float, x: npt.ArrayLike, u: npt.ArrayLike) -> None:
        states, inputs = np.asarray(x, dtype=np.float64), np.asarray(u, dtype=np.float64)
        if states.shape != (len(self.states),) or inputs.shape != (len(self.inputs),):
            raise FlowError(
                f"{self.name} has {len(self.states)} states and {len(self.inputs)} inputs, but shapes {states.shape} "
                f"and {inputs.shape} were given."
            )
        self._fmu.setTime(t)
        self._buffer[: len(self.states)] = states.tolist()
        self._fmu.setContinuousStates(self._buffer, len(self.states))
        at = 0
        for variable in self._u:
            self._set(variable, inputs[at : at + _size(variable)].tolist())
            at += _size(variable)

    def _get(self, variables: list[Any]) -> FloatArray:
        values: list[float] = []
        for variable in variables:
            size = () if self._fmi2 else (_size(variable),)
            values += getattr(self._fmu, f"get{variable.type}")([variable.valueReference], *size)
        return np.array(values, dtype=np.float64)

    def _set(self, variable: Any, values: list[float]) -> None:
        numbers = [exact(variable, value, str(variable.name)) for value in values]
        getattr(self._fmu, f"set{accessor(variable.type, 2 if self._fmi2 else 3)}")([variable.valueReference], numbers)

    def _sensitivity(self, unknowns: list[Any], known: Any, place: int) -> list[float]:
        references = [variable.valueReference for variable in unknowns]
        seed = [float(k == place) for k in range(_size(known))]
        size = () if self._fmi2 else (sum(map(_size, unknowns)),)
        return list(self._fmu.getDirectionalDerivative(references, [known.valueReference], seed, *size))


def _free(fmu: Any, callbacks: Callbacks | None) -> None:
    fmu.freeInstance()
    if callbacks is not None:
        callbacks.release()


def _provides_derivatives(description: bytes) -> bool:
    # fmpy does not know the name that the flag has in FMI 3.0.
    interface = ElementTree.fromstring(description).find("ModelExchange")
    names = ("providesDirectionalDerivative", "providesDirectionalDerivatives")
    return interface is not None and any(interface.get(name) in ("true", "1") for name in names)


def _size(variable: Any) -> int:
    return math.prod(variable.shape or ()) if getattr(variable, "dimensions", None) else 1


def _names(variable: Any) -> list[str]:
    if not getattr(variable, "dimensions", None):
        return [str(variable.name)]
    return [f"{variable.name}[{','.join(str(i + 1) for i in place)}]" for place in np.ndindex(*variable.shape)]
