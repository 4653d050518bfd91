"""Libraries of macOS: several processors in one file, and no exports but those wanted.

The linker of zig exports two names of its own, and has no option against it.  Formats as in Apple's headers
mach-o/fat.h, mach-o/loader.h and mach-o/nlist.h, and in kern/cs_blobs.h for the signature, without which Apple's own
processors run no code.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator, Sequence

from fmu.errors import BuildError

FAT_MAGIC = 0xCAFEBABE
MAGIC = 0xFEEDFACF
PAGE_POWER = 14
"""Pages of 2^14 bytes, the larger of the two processors' sizes."""

_SYMTAB, _DYSYMTAB, _CODE_SIGNATURE, _DYLD_INFO = 0x2, 0xB, 0x1D, 0x80000022
_N_EXT, _N_PEXT = 0x01, 0x10
_SYMBOL = struct.Struct("<IBBHQ")
_CODE_DIRECTORY_MAGIC = 0xFADE0C02
_SHA256 = 2


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
    content = bytearray(page)
    for library in libraries:
        content.extend(bytes(-len(content) % page))
        processor, variant = struct.unpack_from("<II", library, 4)
        header += struct.pack(">5I", processor, variant, len(content), len(library), PAGE_POWER)
        content.extend(library)
    content[: len(header)] = header
    return bytes(content)


def export_only(library: bytes, prefix: str) -> bytes:
    """Hide all names of a library but those that begin in a certain way, and sign it anew if it is signed.

    Parameters
    ----------
    library : bytes
        A 64-bit Mach-O file with the loader's compressed information (``LC_DYLD_INFO_ONLY``).
    prefix : str
        Of the names to keep, with the underscore that C names have.

    Returns
    -------
    bytes
        A library of the same size.

    Raises
    ------
    BuildError
        If the file is of another form.
    """
    content = bytearray(library)
    if len(content) < 32 or struct.unpack_from("<I", content)[0] != MAGIC:
        raise BuildError("The linker has made no 64-bit Mach-O file. Remedy: use the pinned version of ziglang.")
    commands = dict(_commands(content))
    if not {_SYMTAB, _DYSYMTAB, _DYLD_INFO} <= commands.keys():
        raise BuildError("The linker has left out tables of the library. Remedy: use the pinned version of ziglang.")
    start, size = struct.unpack_from("<II", content, commands[_DYLD_INFO] + 40)
    trie = content[start : start + size]
    _prune(trie, 0, b"", prefix.encode())
    content[start : start + size] = trie
    _hide_symbols(content, commands[_SYMTAB], commands[_DYSYMTAB], prefix.encode())
    if _CODE_SIGNATURE in commands:
        _sign(content, struct.unpack_from("<I", content, commands[_CODE_SIGNATURE] + 8)[0])
    return bytes(content)


def _commands(content: bytearray) -> Iterator[tuple[int, int]]:
    """Yield kind and place of each load command."""
    (count,) = struct.unpack_from("<I", content, 16)
    place = 32
    for _ in range(count):
        kind, size = struct.unpack_from("<II", content, place)
        yield kind, place
        place += size


def _prune(trie: bytearray, node: int, name: bytes, prefix: bytes) -> bool:
    """Cut names without the prefix off the tree of exports; return whether any name is left from this node on.

    A node is the size of what is said of its name (0 if it is no name), that, the number of its children, and for
    each of them the letters that it adds and its place.  Nodes stay where they are, so places stay valid.
    """
    size, place = _number(trie, node)
    end = place + size
    wanted = size > 0 and name.startswith(prefix)
    kept = []
    place = end + 1
    for _ in range(trie[end]):
        letters = trie.index(0, place)
        child, following = _number(trie, letters + 1)
        edge = bytes(trie[place:following])
        if _prune(trie, child, name + bytes(trie[place:letters]), prefix):
            kept.append(edge)
        place = following
    pruned = (bytes(trie[node:end]) if wanted else b"\0") + bytes([len(kept)]) + b"".join(kept)
    trie[node:place] = pruned.ljust(place - node, b"\0")
    return wanted or bool(kept)


def _number(trie: bytearray, place: int) -> tuple[int, int]:
    """Read a number of any length, seven bits a byte, lowest first; return it and the place after it."""
    value = shift = 0
    while True:
        value |= (trie[place] & 0x7F) << shift
        place, shift = place + 1, shift + 7
        if trie[place - 1] < 0x80:
            return value, place


def _hide_symbols(content: bytearray, symtab: int, dysymtab: int, prefix: bytes) -> None:
    """Move symbols without the prefix from the exported ones to the end of the local ones, which come before them."""
    symbols, _, strings, _ = struct.unpack_from("<4I", content, symtab + 8)
    n_local, first, count = struct.unpack_from("<3I", content, dysymtab + 12)
    entries = [_SYMBOL.unpack_from(content, symbols + _SYMBOL.size * (first + k)) for k in range(count)]

    def hidden(k: int) -> bool:
        return not content.startswith(prefix, strings + entries[k][0])

    order = sorted(range(count), key=lambda k: (not hidden(k), k))
    n_hidden = sum(map(hidden, range(count)))
    for position, k in enumerate(order):
        name, kind, *rest = entries[k]
        kind = kind & ~(_N_EXT | _N_PEXT) if hidden(k) else kind
        _SYMBOL.pack_into(content, symbols + _SYMBOL.size * (first + position), name, kind, *rest)
    struct.pack_into("<3I", content, dysymtab + 12, n_local + n_hidden, first + n_hidden, count - n_hidden)
    # Stubs and pointers refer to symbols by number.
    moved = {first + k: first + position for position, k in enumerate(order)}
    table, length = struct.unpack_from("<2I", content, dysymtab + 56)
    for k in range(length):
        (number,) = struct.unpack_from("<I", content, table + 4 * k)
        struct.pack_into("<I", content, table + 4 * k, moved.get(number, number))


def _sign(content: bytearray, signature: int) -> None:
    """Renew the hashes of all pages in an ad-hoc signature."""
    _, _, count = struct.unpack_from(">3I", content, signature)
    for k in range(count):
        directory = signature + struct.unpack_from(">I", content, signature + 16 + 8 * k)[0]
        if struct.unpack_from(">I", content, directory)[0] != _CODE_DIRECTORY_MAGIC:
            continue
        hashes, _, _, pages, limit = struct.unpack_from(">5I", content, directory + 16)
        size, kind, _, power = struct.unpack_from(">4B", content, directory + 36)
        if kind != _SHA256 or size != 32:
            raise BuildError(
                "The library's signature is of an unknown kind. Remedy: use the pinned version of ziglang."
            )
        for page in range(pages):
            part = content[page << power : min((page + 1) << power, limit)]
            place = directory + hashes + 32 * page
            content[place : place + 32] = hashlib.sha256(part).digest()
