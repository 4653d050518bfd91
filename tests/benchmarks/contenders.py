"""Who takes part, and with which options: each is prepared once for a problem and a tolerance, then run many times."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from .problems import Outcome


@dataclass(frozen=True)
class Contender:
    """A tool in the hands of a user who knows it.

    Attributes
    ----------
    name : str
        As in the table.
    module, function : str
        Where its runs are prepared: ``function(problem, tolerance, **options)`` returns a run.
    needs : str, optional
        Module without which it cannot take part.
    tolerances : tuple of float
        What it may be given, loosest first. One number: it has no setting.
    """

    name: str
    module: str
    function: str = "prepare"
    needs: str | None = None
    options: dict[str, Any] = field(default_factory=dict)
    tolerances: tuple[float, ...] = tuple(10.0**-k for k in range(4, 14))

    @property
    def installed(self) -> bool:
        if self.needs is None:
            return True
        try:
            return importlib.util.find_spec(self.needs) is not None
        except ModuleNotFoundError:
            return False

    def prepare(self, problem: Any, tolerance: float) -> Callable[[], Outcome]:
        function = getattr(importlib.import_module(f".{self.module}", __package__), self.function)
        return function(problem, tolerance, **self.options)


# SciPy and hybrid-fmu refuse or clip tolerances below 100 eps; the other two take one decade more.
_DECADE_MORE = tuple(10.0**-k for k in range(4, 15))

CONTENDERS = (
    Contender("SciPy loop, DOP853", "with_scipy", options={"method": "DOP853"}),
    Contender("SciPy loop, LSODA", "with_scipy", options={"method": "LSODA"}),
    Contender("sksundae loop, CVODE Adams", "with_cvode", needs="sksundae", tolerances=_DECADE_MORE),
    Contender("pathsim, RKDP87", "with_pathsim", needs="pathsim", tolerances=_DECADE_MORE),
    Contender("hybrid-fmu, `simulate`", "with_hybrid_fmu", "simulate"),
    Contender('hybrid-fmu, `simulate(engine="python")`', "with_hybrid_fmu", "simulate_python"),
    # The FMUs integrate with the tolerance that they were built with.
    Contender("hybrid-fmu, FMUs event-exact", "with_hybrid_fmu", "co_simulate", tolerances=(1e-13,)),
)
