"""Export an automaton as a native FMU."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

from fmu.archives.writing import check_target, package
from fmu.build.archive_members import archive_members
from fmu.build.binaries import binaries, fmi_headers, own_files, runtime_sources
from fmu.build.fmu_code import fmu_code
from fmu.build.source_files import source_names
from fmu.describe.description import Description, model_identifier
from fmu.describe.variable_table import fmu_variables
from fmu.describe.variables import Fmi
from fmu.errors import ExportError
from fmu.standard.units import nearest_unit
from hybrid_model import Automaton, Network
from hybrid_model.declare.arguments import require_automaton
from hybrid_model.declare.calls import explained
from hybrid_model.declare.real_numbers import is_real
from hybrid_model.native.build.scratch import ScratchFolder
from hybrid_model.native.kept_models import kept_trace

KINDS = ("cs", "me")
"""Co-Simulation and Model Exchange."""

_TOKEN = "place-of-the-instantiation-token"
"""Stands for the token until what it is a digest of has been written; of the same length."""


@explained(ExportError)
def export_fmu(
    automaton: Automaton | Network,
    path: str | Path,
    *,
    fmi: Fmi | str = Fmi.V3_0,
    kinds: Collection[str] = KINDS,
    platforms: Sequence[str] | None = None,
    stop_time: float | None = None,
    step_size: float | None = None,
    sources: bool = True,
    clocks: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Path:
    """Write an automaton as an FMU: compiled code that needs no Python to run.

    Parameters
    ----------
    automaton : Automaton or Network
        Any automaton whose maps are written in numpy style, or copies of one as arrays. Where the parts of a large
        composition meet only at events, its FMU for Co-Simulation runs them part by part.
    path : str or Path
        File to write; an existing one is replaced.
    fmi : Fmi or str
        Version of the standard: ``"2.0"`` or ``"3.0"``.
    kinds : collection of str
        ``"cs"`` for Co-Simulation, ``"me"`` for Model Exchange; one file holds both.
    platforms : sequence of str, optional
        Platforms that it is to run on, named as in FMI 3.0, such as ``x86_64-linux``; this machine's if not given.
    stop_time, step_size : float, optional
        Default stop time and communication step in s that the description proposes. With a stop time the archive holds
        the results of a run up to it, except for large networks
        (`hybrid_model.native.networks.network.worth_looping`). Without a step
        it proposes a round share of the stop time, else of the fastest time or rate among the parameters.
    sources : bool
        Whether the archive holds the C sources as well.
    clocks : bool
        Whether an FMU of FMI 3.0 shows its clocks: those that tick with jumps, and the countdown to the next event.
        Some importers take every variable for a number; events are handled in any case.
    progress : callable, optional
        Told in a few words what is being done.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    ExportError
        If a map cannot be traced, a name is taken twice, an option is unknown, a time is not finite and positive, the
        file is not called ``.fmu``, or a unit is not written as in FMI, such as ``m/s2``.
    fmu.errors.BuildError
        If there is no C compiler, the code does not compile, or the file cannot be written.
    """
    if isinstance(automaton, Network):
        automaton = automaton.composition()
    require_automaton("export_fmu", automaton)
    if not isinstance(path, (str, Path)):
        suggested = f"{model_identifier(automaton.name)}.fmu"
        raise ExportError(f"The path {path!r} is no name of a file: give one, such as {suggested!r}.")
    version, target = _version(fmi), Path(path)
    if target.suffix.lower() != ".fmu" and not target.is_dir():
        raise ExportError(f"The file '{path}' would be no FMU by its name: call it '{target.with_suffix('.fmu')}'.")
    _check_experiment(stop_time, step_size)
    _check_units(automaton)
    chosen = _kinds(kinds)
    check_target(target)
    traced = kept_trace(automaton)
    variables = fmu_variables(traced, version, clocks=clocks)
    runtime = runtime_sources(version.value)

    code = fmu_code(traced, variables, _TOKEN, chosen)
    listed = tuple(source_names(version)) if sources else ()
    description = Description(traced, variables, _TOKEN, version, chosen, stop_time, step_size, listed)
    content = archive_members(description, code)
    # The token ties description and code together: it changes when either does.
    written = [content["modelDescription.xml"], code.encode(), *map(Path.read_bytes, [*runtime, *_headers()])]
    token = hashlib.sha256(b"".join(written)).hexdigest()[: len(_TOKEN)]
    members = {name: item.replace(_TOKEN.encode(), token.encode()) for name, item in content.items()}
    with ScratchFolder() as folder:
        generated = Path(folder) / "model.c"
        generated.write_text(code.replace(_TOKEN, token), encoding="ascii")
        identifier = model_identifier(automaton.name)
        members |= binaries(
            [generated, *runtime],
            [fmi_headers()],
            identifier,
            fmi=version.value,
            platforms=platforms,
            progress=progress,
        )
    return package(members, target)


def _check_experiment(stop_time: float | None, step_size: float | None) -> None:
    for name, value in (("stop time", stop_time), ("step size", step_size)):
        if value is not None and not (is_real(value) and math.isfinite(value) and value > 0.0):
            raise ExportError(f"The {name} {value!r} s cannot be proposed: give a finite number above zero, or none.")


def _check_units(automaton: Automaton) -> None:
    used = {variable.unit: variable.name for variable in reversed(automaton.variables)}
    for unit, name in used.items():
        meant = nearest_unit(unit)
        if meant is not None:
            raise ExportError(
                f"{automaton.name}.{name} has the unit {unit!r}, which tools do not know: write unit={meant!r}."
            )


def _headers() -> list[Path]:
    return own_files("*.h")


def _version(fmi: Fmi | str) -> Fmi:
    try:
        return Fmi(fmi)
    except ValueError:
        known = ", ".join(version.value for version in Fmi)
        raise ExportError(f"FMI version {fmi!r} is not one that can be exported: choose from {known}.") from None


def _kinds(kinds: Collection[str]) -> tuple[str, ...]:
    chosen = tuple(kind for kind in KINDS if kind in kinds)
    if isinstance(kinds, str) or len(chosen) != len(set(kinds)) or not chosen:
        raise ExportError(f"The kinds {kinds!r} are not kinds of FMU: give one or both of {', '.join(KINDS)}.")
    return chosen
