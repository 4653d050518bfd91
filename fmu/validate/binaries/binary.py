"""What a shared library exports and needs, read from its bytes: ELF, PE and Mach-O.

Nothing is loaded or run.  Each reader looks at the few tables it needs; a reader of whole executables (LIEF, some
megabytes of C++ that would parse strangers' bytes in this process) does more than is asked here, and pyelftools knows
one of the three formats.
"""

from __future__ import annotations

from fmu.validate.binaries import elf, mach_o, pe
from fmu.validate.binaries.shared_library import Binary, BinaryError


def read_binary(content: bytes) -> Binary:
    """Read a shared library.

    Parameters
    ----------
    content : bytes
        The file.

    Returns
    -------
    Binary

    Raises
    ------
    BinaryError
        If it is not ELF, PE or Mach-O, or is damaged.
    """
    if content[:4] == b"\x7fELF":
        return elf.read(content)
    if content[:2] == b"MZ":
        return pe.read(content)
    if content[:4] in mach_o.MAGICS:
        return mach_o.read(content)
    raise BinaryError("it is neither ELF, PE nor Mach-O")
