"""Everything in an FMU's archive beside the binaries."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

from fmu.build.source_files import source_content, source_names
from fmu.describe.description import model_description
from fmu.describe.documentation import index_page
from fmu.describe.parts import Description
from fmu.describe.reference_results import FOLDER, NOTE, reference_results
from fmu.describe.terminals import terminals_and_icons
from fmu.describe.variables import Fmi, FmuVariable
from hybrid_model.errors import SimulationError

ASSETS = Path(__file__).resolve().parent / "assets"
"""Folder of the icons and the licence."""
_ASSETS = {
    "model.png": "icon.png",
    "terminalsAndIcons/icon.png": "icon.png",
    "terminalsAndIcons/icon.svg": "icon.svg",
    "terminalsAndIcons/sender.png": "sender.png",
    "terminalsAndIcons/sender.svg": "sender.svg",
    "terminalsAndIcons/receiver.png": "receiver.png",
    "terminalsAndIcons/receiver.svg": "receiver.svg",
    "documentation/licenses/license.txt": "license.txt",
}


def archive_content(
    traced: Any,
    variables: Sequence[FmuVariable],
    token: str,
    model_code: str,
    *,
    fmi: Fmi | str = Fmi.V3_0,
    kinds: Collection[str] = ("cs", "me"),
    stop_time: float | None = None,
    step_size: float | None = None,
    sources: bool = True,
    references: bool = True,
) -> dict[str, bytes]:
    """Return the members of an FMU's archive, all but those below ``binaries/``.

    Parameters
    ----------
    traced : Trace
        The automaton and its maps, or a network with the same methods.
    variables : sequence of FmuVariable
        In the order of their value references.
    token : str
        Instantiation token.
    model_code : str
        The generated C file.
    fmi : Fmi or str
        Version of the standard.
    kinds : collection of {"cs", "me"}
        Co-Simulation, Model Exchange.
    stop_time, step_size : float, optional
        Of the default experiment, in s.
    sources : bool
        Whether the C sources are members.
    references : bool
        Whether the automaton is run to the stop time for reference results, if there is a stop time. An automaton
        that cannot run from its start values has none.

    Returns
    -------
    dict of str to bytes
        Names with ``/`` -> content: modelDescription.xml, model.png, terminalsAndIcons/, documentation/, and as asked
        for sources/ and extra/.

    Raises
    ------
    ExportError
        If a variable's name cannot be written, or comes twice.
    BuildError
        If the FMI header files are missing.
    """
    version = Fmi(fmi)
    listed = tuple(source_names(version)) if sources else ()
    description = Description(traced, variables, token, tuple(kinds), stop_time, step_size, listed)
    members = {name: (ASSETS / file).read_bytes() for name, file in _ASSETS.items()}
    members["modelDescription.xml"] = model_description(
        traced,
        variables,
        token,
        fmi=version,
        kinds=kinds,
        stop_time=stop_time,
        step_size=step_size,
        sources=listed,
    )
    members["terminalsAndIcons/terminalsAndIcons.xml"] = terminals_and_icons(description)
    if sources:
        members |= source_content(model_code, description.identifier, version)
    if references and stop_time is not None and stop_time > 0.0:
        members |= _references(description, stop_time)
    related = [
        name for name in (f"{FOLDER}/results.csv", NOTE, "documentation/licenses/license.txt") if name in members
    ]
    members["documentation/index.html"] = index_page(description, version, related)
    return members


def _references(description: Description, stop_time: float) -> dict[str, bytes]:
    try:
        return reference_results(description, stop_time)
    except SimulationError:
        return {}
