"""The memory functions that an FMU of FMI 2.0 is given.

FMI 2.0.4 section 2.1.5 lets them be NULL only for FMUs with `canNotUseMemoryManagementFunctions`, and some of those
insist on them all the same: they are always given.
"""

from __future__ import annotations

import ctypes as c
import sys
from typing import Any

ALLOCATE = c.CFUNCTYPE(c.c_void_p, c.c_size_t, c.c_size_t)
FREE = c.CFUNCTYPE(None, c.c_void_p)


def memory_functions() -> tuple[Any, Any]:
    """Return allocateMemory and freeMemory: calloc and free of the C library, with no Python between."""
    library = c.CDLL("msvcrt" if sys.platform == "win32" else None)
    return c.cast(library.calloc, ALLOCATE), c.cast(library.free, FREE)
