"""Names of platforms in FMU archives, and which is this machine's."""

from __future__ import annotations

import platform
import re
import sys

EXTENSIONS = {"linux": ".so", "windows": ".dll", "darwin": ".dylib"}
FMI2 = {
    "linux32": ("x86", "linux"),
    "linux64": ("x86_64", "linux"),
    "win32": ("x86", "windows"),
    "win64": ("x86_64", "windows"),
    "darwin32": ("x86", "darwin"),
    "darwin64": ("x86_64", "darwin"),
}
_TUPLE = re.compile(
    r"(aarch32|aarch64|riscv32|riscv64|x86|x86_64|ppc32|ppc64)-(darwin|linux|windows)(-[a-z][a-z0-9_]*)?"
)
"""Platform tuples of FMI 3.0.2, section 2.5.1, with the binary interface of static libraries."""
_MACHINES = {
    "amd64": "x86_64",
    "x86_64": "x86_64",
    "arm64": "aarch64",
    "aarch64": "aarch64",
    "i386": "x86",
    "i686": "x86",
    "x86": "x86",
}


def parts_of(folder: str) -> tuple[str, str, str] | None:
    """Return architecture, system and binary interface that the name of a folder below ``binaries`` stands for.

    Parameters
    ----------
    folder : str
        Either version's name; FMI 2 has no names for some platforms, so that its tools use those of FMI 3.

    Returns
    -------
    tuple of str or None
        None if neither version has the name.
    """
    if folder in FMI2:
        return (*FMI2[folder], "")
    match = _TUPLE.fullmatch(folder)
    return (match[1], match[2], (match[3] or "").removeprefix("-")) if match else None


def this_machine() -> tuple[str, str]:
    """Return architecture and system of this Python process."""
    systems = {"linux": "linux", "darwin": "darwin", "win32": "windows", "cygwin": "windows"}
    machine = platform.machine().lower()
    known = _MACHINES.get(machine, machine)
    if sys.maxsize < 2**32 and known == "x86_64":
        known = "x86"
    return known, systems.get(sys.platform, sys.platform)


def runs_here(folder: str) -> bool:
    """Tell whether binaries of a folder run in this process."""
    parts = parts_of(folder)
    return parts is not None and parts[:2] == this_machine()
