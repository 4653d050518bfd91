"""A system from any file that describes one."""

from __future__ import annotations

from pathlib import Path

from cosim.errors import MisfitError
from cosim.systems.definition import FMU, Component, SystemDefinition
from cosim.systems.ssp_reading import DESCRIPTION, read_ssd, read_ssp
from cosim.systems.toml_file import is_system, read_toml

SUFFIX = ".fmu"
IN_FOLDER = "system.toml"


def read_system(path: str | Path) -> SystemDefinition | None:
    """Read a system from a TOML file, an SSP file or its description, a folder with one, or an FMU, a system by itself.

    Returns
    -------
    SystemDefinition or None
        None if the path is none of these, as for a scenario.

    Raises
    ------
    MisfitError
        If what it describes makes no sense.
    """
    path = Path(path)
    if path.is_dir():
        return _folder(path)
    if path.suffix.lower() == SUFFIX:
        return SystemDefinition(path.stem, [Component(path.stem, FMU, str(path))])
    if path.suffix.lower() == ".ssp":
        return read_ssp(path)
    if path.suffix.lower() == ".ssd":
        return read_ssd(path)
    if path.suffix.lower() == ".toml" and is_system(path):
        return read_toml(path)
    return None


def _folder(path: Path) -> SystemDefinition:
    if (path / IN_FOLDER).is_file():
        return read_toml(path / IN_FOLDER)
    if (path / DESCRIPTION).is_file():
        return read_ssd(path / DESCRIPTION)
    fmus = sorted(file for file in path.iterdir() if file.suffix.lower() == SUFFIX)
    if not fmus:
        raise MisfitError(f"{path} has no {IN_FOLDER} and no FMU: give one of them.")
    return SystemDefinition(path.name, [Component(fmu.stem, FMU, str(fmu)) for fmu in fmus])
