"""Export an automaton as a native FMU."""

from __future__ import annotations

import enum
import hashlib
import tempfile
from pathlib import Path

from fmpy import platform_tuple, sharedLibraryExtension

from fmu.build import RUNTIME, compile_fmu, fmi_headers, package, runtime_sources
from fmu.code import model_code
from fmu.description import model_description, model_identifier
from fmu.errors import ExportError
from fmu.trace import trace
from fmu.variables import fmu_variables
from hybrid_model import Automaton


class Fmi(enum.Enum):
    """Versions of the standard that FMUs are exported for."""

    V3_0 = "3.0"


def export_fmu(
    automaton: Automaton, path: str | Path, *, fmi: Fmi | str = Fmi.V3_0, stop_time: float | None = None
) -> Path:
    """Write an automaton as a Co-Simulation FMU with event mode, for this machine's platform.

    The FMU holds compiled code only: it needs no Python to run.

    Parameters
    ----------
    automaton : Automaton
        Any automaton whose maps are written in numpy style.
    path : str or Path
        File to write; an existing one is replaced.
    fmi : Fmi or str
        Version of the standard.
    stop_time : float, optional
        Default stop time in s that the description proposes.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    ExportError
        If a map cannot be traced, a name is taken twice, or the version is unknown.
    fmu.build.BuildError
        If there is no C compiler or the code does not compile.
    """
    _require_version(fmi)
    traced = trace(automaton)
    variables = fmu_variables(traced)
    # The token ties description and binary together: it changes when either does.
    unsigned = model_description(traced, variables, "", stop_time) + model_code(traced, variables, "").encode()
    runtime = b"".join(source.read_bytes() for source in sorted(RUNTIME.iterdir()) if source.suffix in (".c", ".h"))
    token = hashlib.sha256(unsigned + runtime).hexdigest()[:32]
    identifier = model_identifier(automaton.name)
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        generated = work / "model.c"
        generated.write_text(model_code(traced, variables, token), encoding="ascii")
        binary = work / f"{identifier}{sharedLibraryExtension}"
        compile_fmu([generated, *runtime_sources()], [fmi_headers()], binary)
        members = {
            "modelDescription.xml": model_description(traced, variables, token, stop_time),
            f"binaries/{platform_tuple}/{binary.name}": binary.read_bytes(),
        }
        return package(members, Path(path))


def _require_version(fmi: Fmi | str) -> None:
    known = [version.value for version in Fmi]
    if (fmi.value if isinstance(fmi, Fmi) else fmi) not in known:
        raise ExportError(f"FMI version {fmi!r} is not one that can be exported: choose from {', '.join(known)}.")
