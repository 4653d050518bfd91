"""Everything in an FMU's archive beside the binaries."""

from __future__ import annotations

from pathlib import Path

from fmu.build.source_files import source_members
from fmu.describe.description import Description
from fmu.describe.documentation import index_page
from fmu.describe.model_description import model_description
from fmu.describe.reference_results import FOLDER, NOTE, reference_results
from fmu.describe.terminals import terminals_and_icons
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


def archive_members(description: Description, model_code: str) -> dict[str, bytes]:
    """Return the members of an FMU's archive, all but those below ``binaries/``.

    Parameters
    ----------
    description : Description
        What is exported; with `sources` the C sources are members. If it has a stop time, the automaton is run to it
        for reference results; one that cannot run from its start values has none.
    model_code : str
        The generated C file.
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
    members = {name: (ASSETS / file).read_bytes() for name, file in _ASSETS.items()}
    members["modelDescription.xml"] = model_description(description)
    members["terminalsAndIcons/terminalsAndIcons.xml"] = terminals_and_icons(description)
    if description.sources:
        members |= source_members(model_code, description.identifier, description.fmi)
    stop_time = description.stop_time
    if stop_time is not None and stop_time > 0.0:
        members |= _references(description, stop_time)
    related = [
        name for name in (f"{FOLDER}/results.csv", NOTE, "documentation/licenses/license.txt") if name in members
    ]
    members["documentation/index.html"] = index_page(description, related)
    return members


def _references(description: Description, stop_time: float) -> dict[str, bytes]:
    try:
        return reference_results(description, stop_time)
    except SimulationError:
        return {}
