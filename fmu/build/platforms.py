"""The platforms that FMUs are built for, and where importers look for their libraries in the archive.

FMI 3 names a folder after processor and system. FMI 2 has names of its own for x86 processors and takes over those of
FMI 3 for all others (FMI 2.0.4, section 2.3). Importers of FMI 2 on other processors mostly look into the folders
for x86 all the same. On macOS one library serves both; and an FMU made on such a machine for that machine alone has
its library in both folders.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from fmu.build.mach_o import universal
from fmu.errors import BuildError
from fmu.standard.platforms import EXTENSIONS, FMI2, this_machine


@dataclass(frozen=True)
class Platform:
    """A processor and a system.

    Attributes
    ----------
    name : str
        As in FMI 3, for example ``x86_64-linux``.
    zig_target : str
        What the compiler of the package ziglang calls it, with the oldest system that libraries shall run on.
    """

    name: str
    zig_target: str

    @property
    def system(self) -> str:
        """``linux``, ``windows`` or ``darwin``."""
        return self.name.partition("-")[2]

    @property
    def extension(self) -> str:
        """Of a shared library."""
        return EXTENSIONS[self.system]

    @property
    def fmi2_folder(self) -> str:
        """The folder that FMI 2 had for this system before it knew of other processors than x86."""
        return next(name for name, place in FMI2.items() if place == ("x86_64", self.system))

    @property
    def is_x86(self) -> bool:
        """Whether the names of FMI 2 mean this processor."""
        return self.name.startswith("x86_64-")


PLATFORMS = {
    entry.name: entry
    for entry in (
        # glibc 2.17 is of 2012, and the first one for aarch64.
        Platform("x86_64-linux", "x86_64-linux-gnu.2.17"),
        Platform("aarch64-linux", "aarch64-linux-gnu.2.17"),
        Platform("x86_64-windows", "x86_64-windows-gnu"),
        Platform("aarch64-windows", "aarch64-windows-gnu"),
        Platform("x86_64-darwin", "x86_64-macos.10.15"),
        # The first macOS for this processor.
        Platform("aarch64-darwin", "aarch64-macos.11.0"),
    )
}
"""All platforms by name."""


def this_platform() -> Platform:
    """Return the platform of this machine.

    Raises
    ------
    BuildError
        If it is none of `PLATFORMS`.
    """
    name = "-".join(this_machine())
    if name not in PLATFORMS:
        raise BuildError(
            f"This machine is '{name}', and FMUs are built for {', '.join(PLATFORMS)} only. "
            "Remedy: name one of these platforms; the package ziglang builds for it (pip install ziglang)."
        )
    return PLATFORMS[name]


def chosen_platforms(names: Iterable[str] | None) -> tuple[Platform, ...]:
    """Look up platforms by name.

    Parameters
    ----------
    names : iterable of str, optional
        Names as in FMI 3; this machine's platform if not given.

    Returns
    -------
    tuple of Platform
        Each once, in the order of `PLATFORMS`.

    Raises
    ------
    BuildError
        If a name is unknown or there is none.
    """
    if names is None:
        return (this_platform(),)
    wanted = [names] if isinstance(names, str) else list(names)
    for name in wanted:
        if name not in PLATFORMS:
            raise BuildError(f"There is no platform '{name}'. Remedy: choose from {', '.join(PLATFORMS)}.")
    if not wanted:
        raise BuildError(f"An FMU needs a platform. Remedy: choose from {', '.join(PLATFORMS)}.")
    return tuple(entry for name, entry in PLATFORMS.items() if name in wanted)


def library_members(
    identifier: str, fmi: str, libraries: Mapping[Platform, bytes], *, only_here: bool = False
) -> dict[str, bytes]:
    """Give libraries their names in the archive.

    Parameters
    ----------
    identifier : str
        The model identifier.
    fmi : str
        ``"2.0"`` or ``"3.0"``.
    libraries : mapping of Platform to bytes
        What was built.
    only_here : bool
        Whether the FMU is for this machine alone, so that its importers' habits count more than other machines.

    Returns
    -------
    dict of str to bytes
        Archive members.
    """
    folders: dict[str, bytes] = {}
    extensions = {f"{name}": entry.extension for entry in libraries for name in (entry.name, entry.fmi2_folder)}
    for entry, library in libraries.items():
        folders[entry.fmi2_folder if fmi == "2.0" and entry.is_x86 else entry.name] = library
    if fmi == "2.0":
        folders |= _for_importers_that_ignore_the_processor(libraries, only_here)
    return {f"binaries/{name}/{identifier}{extensions[name]}": folders[name] for name in sorted(folders)}


def _for_importers_that_ignore_the_processor(libraries: Mapping[Platform, bytes], only_here: bool) -> dict[str, bytes]:
    """Return what goes into FMI 2's folders for x86 because of other processors."""
    folders = {}
    for entry, library in libraries.items():
        twins = [other for other in libraries if other.system == entry.system and other.is_x86]
        if entry.is_x86:
            continue
        # One file can hold the code for both processors on macOS only.
        if (twins and entry.system == "darwin") or only_here:
            folders[entry.fmi2_folder] = universal([*(libraries[twin] for twin in twins), library])
    return folders
