"""Libraries of macOS: several processors in one file.

Mach-O as in Apple's headers mach-o/fat.h and mach-o/loader.h.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

FAT_MAGIC = 0xCAFEBABE
PAGE_POWER = 14
"""Pages of 2^14 bytes, the larger of the two processors' sizes."""


def universal(libraries: Sequence[bytes]) -> bytes:
    """Join libraries of different processors to one file.

    Parameters
    ----------
    libraries : sequence of bytes
        64-bit Mach-O files, at least one; a single library of any format is returned as it is.

    Returns
    -------
    bytes
        The file; a loader picks its processor's part.
    """
    if len(libraries) == 1:
        return libraries[0]
    page = 1 << PAGE_POWER
    header = struct.pack(">II", FAT_MAGIC, len(libraries))
    parts, end = [], page
    for library in libraries:
        processor, variant = struct.unpack_from("<II", library, 4)
        header += struct.pack(">5I", processor, variant, end, len(library), PAGE_POWER)
        parts.append(library + bytes(-len(library) % page))
        end += len(parts[-1])
    parts[-1] = libraries[-1]
    return header.ljust(page, b"\0") + b"".join(parts)
