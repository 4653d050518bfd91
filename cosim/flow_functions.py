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

from fmu.archives.reading import Archive
from fmu.importer.instance import FmuInstance
from fmu.importer.loading import major_of, read_description
from fmu.importer.temporary_folders import temporary_folder
from fmu.importer.unpacking import unpack
from fmu.importer.values import exact
from fmu.standard.capabilities import Capability

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
                if description.modelExchange is None or major_of(description) is None:
                    raise FlowError("it has no Model Exchange of FMI 2.0 or 3.0")
                folder = temporary_folder()
                weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
                unpack(archive, folder)
                self._provides_derivatives = _provides_derivatives(
                    archive.read("modelDescription.xml"), major_of(description) or 0
                )
            self._begin(description, folder, dict(start or {}), t_start)
        except Exception as error:
            why = error.strerror if isinstance(error, OSError) and error.strerror else error
            raise FlowError(f"{path} cannot be run: {str(why).rstrip('.')}.") from error

    def derivatives(self, t: float, x: npt.ArrayLike, u: npt.ArrayLike = ()) -> FloatArray:
        """Return dx/dt, shape (n,), at time t in s, states x (n,) and inputs u (m,)."""
        with self._at(t, x, u):
            self._instance.call("GetContinuousStateDerivatives", self._buffer, len(self.states))
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
        # Messages are dropped: fmpy tells by an exception which function failed.
        self._instance = FmuInstance(description, folder, self.name, lambda status, message: None, "ModelExchange")
        self._fmu = self._instance.fmu
        self._instance.instantiate()
        self._end = weakref.finalize(self, _free, self._instance)
        known = {variable.name: variable for variable in variables}
        for name, value in start.items():
            if name not in known:
                raise FlowError(f"it has no variable {name!r}; it has {', '.join(known)}")
            self._set(known[name], [value])
        self._initialize(t_start)
        self._fmu.getContinuousStates(self._buffer, len(self.states))
        self.x, self.u = np.array(self._buffer[: len(self.states)]), self._get(self._u)

    def _initialize(self, t_start: float) -> None:
        self._instance.enter_initialization(t_start)
        self._fmu.exitInitializationMode()
        for _ in range(MAX_ITERATIONS):
            again, terminate, _ = self._instance.updater()()
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
            get, arguments = self._instance.getter(variable, _size(variable))
            values += get(*arguments)
        return np.array(values, dtype=np.float64)

    def _set(self, variable: Any, values: list[float]) -> None:
        self._instance.set(variable, [exact(variable, value, str(variable.name)) for value in values])

    def _sensitivity(self, unknowns: list[Any], known: Any, place: int) -> list[float]:
        references = [variable.valueReference for variable in unknowns]
        seed = [float(k == place) for k in range(_size(known))]
        return self._instance.slopes(references, known.valueReference, seed, sum(map(_size, unknowns)))


def _free(instance: FmuInstance) -> None:
    instance.free()
    instance.fmu.freeLibrary()


def _provides_derivatives(description: bytes, major: int) -> bool:
    # fmpy does not know the name that the capability has in FMI 3.0.
    interface = ElementTree.fromstring(description).find("ModelExchange")
    return interface is not None and Capability.DIRECTIONAL_DERIVATIVES.claimed(interface.attrib, major)


def _size(variable: Any) -> int:
    return math.prod(variable.shape or ()) if getattr(variable, "dimensions", None) else 1


def _names(variable: Any) -> list[str]:
    if not getattr(variable, "dimensions", None):
        return [str(variable.name)]
    return [f"{variable.name}[{','.join(str(i + 1) for i in place)}]" for place in np.ndindex(*variable.shape)]
