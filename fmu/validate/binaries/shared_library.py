"""What a shared library exports and needs, and its bytes with readers that never leave them."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass


class BinaryError(ValueError):
    """The bytes are no shared library of a known format, or are damaged."""


@dataclass(frozen=True)
class Binary:
    """A shared library.

    Attributes
    ----------
    system : str
        ``linux``, ``windows`` or ``darwin``, by the format.
    machines : frozenset of str
        Architectures as FMI 3 names them.
    exports, imports : frozenset of str
        Names of functions and data.
    needed : tuple of str
        Libraries.
    rpaths : tuple of str
        Folders where libraries are looked for first.
    flaws : tuple of str
        ``textrel`` (code is patched when loaded), ``execstack`` (asks for an executable stack).
    """

    system: str
    machines: frozenset[str]
    exports: frozenset[str]
    imports: frozenset[str]
    needed: tuple[str, ...]
    rpaths: tuple[str, ...] = ()
    flaws: tuple[str, ...] = ()


MAX_SYMBOLS = 1_000_000


class Bytes:
    """Bytes with readers that never leave them."""

    def __init__(self, content: bytes, order: str = "<") -> None:
        self.content, self.order = content, order

    def unpack(self, form: str, offset: int) -> tuple[int, ...]:
        """Read numbers."""
        size = struct.calcsize(self.order + form)
        if offset < 0 or offset + size > len(self.content):
            raise BinaryError(f"it ends before byte {offset + size}")
        return struct.unpack_from(self.order + form, self.content, offset)

    def text(self, offset: int, limit: int = 4096) -> str:
        """Read a string that ends with NUL."""
        if not 0 <= offset < len(self.content):
            raise BinaryError(f"a name lies at byte {offset}, outside the file")
        end = self.content.find(b"\0", offset, offset + limit)
        return self.content[offset : end if end >= 0 else offset + limit].decode("utf-8", "replace")


def bounded(count: int) -> range:
    """Return the range of a table's length, unless no honest table is that long."""
    if not 0 <= count <= MAX_SYMBOLS:
        raise BinaryError(f"a table has {count} entries")
    return range(count)


def first(pairs: Iterator[tuple[int, int]]) -> dict[int, int]:
    """Return a table by key; the first of equal keys counts."""
    table: dict[int, int] = {}
    for key, value in pairs:
        table.setdefault(key, value)
    return table
