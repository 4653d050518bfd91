"""The model description of an FMU, and the name of its binary."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from fmu.describe.fmi2 import fmi2_description
from fmu.describe.fmi3 import fmi3_description
from fmu.describe.parts import Description, model_identifier
from fmu.describe.variables import Fmi, FmuVariable

__all__ = ["model_description", "model_identifier"]


def model_description(
    traced: Any,
    variables: Sequence[FmuVariable],
    token: str,
    *,
    fmi: Fmi | str = Fmi.V3_0,
    kinds: Collection[str] = ("cs", "me"),
    stop_time: float | None = None,
    step_size: float | None = None,
    sources: Sequence[str] = (),
) -> bytes:
    """Return the model description of an FMU.

    Parameters
    ----------
    traced : Trace
        The automaton and its maps, or a network with the same methods.
    variables : sequence of FmuVariable
        In the order of their value references.
    token : str
        Instantiation token.
    fmi : Fmi or str
        Version of the standard.
    kinds : collection of {"cs", "me"}
        Co-Simulation, Model Exchange.
    stop_time, step_size : float, optional
        Of the default experiment, in s.
    sources : sequence of str
        C files to compile, relative to ``sources/``: FMI 2.0 lists them here, FMI 3.0 in its build description.

    Returns
    -------
    bytes
        XML in UTF-8.

    Raises
    ------
    ExportError
        If a variable's name cannot be written, or comes twice.
    """
    description = Description(traced, variables, token, tuple(kinds), stop_time, step_size, tuple(sources))
    return fmi2_description(description) if Fmi(fmi) is Fmi.V2_0 else fmi3_description(description)
