"""How flows are integrated and events located: the options of a run."""

from __future__ import annotations

import enum
import importlib
import math
from dataclasses import dataclass, fields
from typing import Any

from hybrid_model.declare.real_numbers import is_real, told
from hybrid_model.declare.signatures import ExplainedCall
from hybrid_model.errors import SimulationError


class Method(enum.Enum):
    """SciPy's steppers; the value is the name of the class in ``scipy.integrate``."""

    DOP853 = "DOP853"
    RK45 = "RK45"
    RADAU = "Radau"
    BDF = "BDF"
    LSODA = "LSODA"


@dataclass(frozen=True)
class Solver(ExplainedCall):
    """Accuracy of a run.

    Attributes
    ----------
    method : Method or str
        Stepper, or its name: ``"DOP853"``, ``"RK45"``, and for stiff flows ``"Radau"``, ``"BDF"`` and ``"LSODA"``.
    rtol : float
        Relative tolerance of a step, as in SciPy.
    atol : float, optional
        Absolute tolerance of a step, as in SciPy; default: 1e-15 of the nominal value where a state has one, else of
        its usual size (`hybrid_model.scales.tolerance_sizes`).
    max_step : float
        Longest step in s.
    scan_points : int
        Samples of every margin in a step, in whole eights; `hybrid_model.reference.zero_crossings` says what that
        bounds.
    event_tolerance : float, optional
        In s: crossings closer than this are taken at one instant, in the fixed order of the jumps. The same number, in
        the margin's unit, is how far outside the flow set rounding may leave a state. Default: both follow from the
        run (`hybrid_model.scales`), and so do not depend on units.

    Raises
    ------
    SimulationError
        For a method of another name, if a number is not positive, a tolerance is not finite, or `scan_points` is not
        whole.
    """

    method: Method | str = Method.DOP853
    rtol: float = 1e-13
    atol: float | None = None
    max_step: float = math.inf
    scan_points: int = 8
    event_tolerance: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.method, Method):
            object.__setattr__(self, "method", _by_name(self.method))
        for field in fields(self):
            given = getattr(self, field.name)
            if not (field.name == "method" or given is field.default or is_real(given)):
                raise SimulationError(f"solver option {field.name} = {told(given)}: give a number.")
        for name in ("rtol", "atol", "max_step", "scan_points", "event_tolerance"):
            value = getattr(self, name)
            if value is None and name in ("atol", "event_tolerance"):
                continue
            if not value > 0 or (math.isinf(value) and name != "max_step"):
                raise SimulationError(f"solver option {name} = {value}: give a positive number.")
        if self.scan_points != int(self.scan_points):
            raise SimulationError(f"solver option scan_points = {self.scan_points}: give a whole number.")

    @property
    def stepper(self) -> Any:
        """SciPy's class of the method."""
        # Imported by whoever steps with it: it takes longer to import than most runs take.
        return getattr(importlib.import_module("scipy.integrate"), Method(self.method).value)


def _by_name(name: str) -> Method:
    known = {method.value: method for method in Method}
    found = {key.upper(): method for key, method in known.items()}.get(str(name).upper())
    if found is None:
        raise SimulationError(f"solver option method = {name!r}: the methods are {', '.join(known)}.")
    return found
