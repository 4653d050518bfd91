"""Mach-O shared libraries (loader.h and nlist.h of macOS), single and fat."""

from __future__ import annotations

from collections.abc import Iterator

from fmu.validate.binaries.shared_library import Binary, BinaryError, Bytes, bounded

MAGICS = (b"\xcf\xfa\xed\xfe", b"\xce\xfa\xed\xfe", b"\xca\xfe\xba\xbe")
_FAT = MAGICS[2]
_MACHINES = {7: "x86", 0x01000007: "x86_64", 12: "aarch32", 0x0100000C: "aarch64"}
_DYLIB, _BUNDLE = 6, 8
_SYMTAB, _LOAD_DYLIB, _RPATH, _DYLD_INFO, _EXPORTS_TRIE = 0x2, 0xC, 0x1C, 0x22, 0x33
_REQUIRED = 0x80000000
_EXTERNAL, _STAB, _PRIVATE, _TYPE = 0x01, 0xE0, 0x10, 0x0E
_LOADS = (_LOAD_DYLIB, 0x18, 0x1F, 0x20)


def read(content: bytes) -> Binary:
    """Read a Mach-O file; see `fmu.validate.binaries.binary.read_binary`."""
    if content[:4] != _FAT:
        return _slice(content)
    data = Bytes(content, ">")
    (count,) = data.unpack("I", 4)
    if not 0 < count < 20:
        raise BinaryError(f"it holds {count} architectures")
    places = [data.unpack("IIIII", 8 + 20 * number) for number in range(count)]
    parts = [_slice(content[offset : offset + size]) for _, _, offset, size, _ in places]
    return Binary(
        system="darwin",
        machines=frozenset().union(*(part.machines for part in parts)),
        exports=frozenset.intersection(*(part.exports for part in parts)),
        imports=frozenset().union(*(part.imports for part in parts)),
        needed=tuple(dict.fromkeys(name for part in parts for name in part.needed)),
        rpaths=tuple(dict.fromkeys(name for part in parts for name in part.rpaths)),
    )


def _slice(content: bytes) -> Binary:
    if content[:4] not in MAGICS[:2]:
        raise BinaryError("one of its architectures is no Mach-O file")
    data = Bytes(content)
    wide = content[:4] == MAGICS[0]
    machine, _, kind, count = data.unpack("IIII", 4)
    if kind not in (_DYLIB, _BUNDLE):
        raise BinaryError(f"it is a Mach-O file of kind {kind}, no shared library")
    exports: set[str] = set()
    imports: set[str] = set()
    needed: list[str] = []
    rpaths: list[str] = []
    for command, place in _commands(data, 32 if wide else 28, count):
        if command == _SYMTAB:
            _symbols(data, place, wide, exports, imports)
        elif command in _LOADS:
            needed.append(data.text(place + data.unpack("I", place + 8)[0]))
        elif command == _RPATH:
            rpaths.append(data.text(place + data.unpack("I", place + 8)[0]))
        elif command == _DYLD_INFO:
            exports.update(_trie(data, *data.unpack("II", place + 40)))
        elif command == _EXPORTS_TRIE:
            exports.update(_trie(data, *data.unpack("II", place + 8)))
    return Binary(
        system="darwin",
        machines=frozenset({_MACHINES.get(machine, f"machine {machine:#x}")}),
        exports=frozenset(name.removeprefix("_") for name in exports),
        imports=frozenset(name.removeprefix("_") for name in imports),
        needed=tuple(needed),
        rpaths=tuple(rpaths),
    )


def _commands(data: Bytes, place: int, count: int) -> Iterator[tuple[int, int]]:
    for _ in bounded(count):
        command, size = data.unpack("II", place)
        if size < 8:
            raise BinaryError(f"a load command has {size} bytes")
        yield command & ~_REQUIRED, place
        place += size


def _symbols(data: Bytes, place: int, wide: bool, exports: set[str], imports: set[str]) -> None:
    symbols, count, strings, _ = data.unpack("IIII", place + 8)
    for number in bounded(count):
        name, kind, _, _ = data.unpack("IBBH", symbols + number * (16 if wide else 12))
        if kind & _STAB or not kind & _EXTERNAL or kind & _PRIVATE:
            continue
        (imports if kind & _TYPE == 0 else exports).add(data.text(strings + name))


def _trie(data: Bytes, start: int, size: int) -> Iterator[str]:
    """Yield the names in a tree of prefixes; no node is visited twice."""
    waiting, seen = [(start, "")] if size else [], set()
    while waiting:
        node, prefix = waiting.pop()
        if node in seen or not start <= node < start + size:
            raise BinaryError("its tree of exports is damaged")
        seen.add(node)
        terminal, place = _number(data, node)
        if terminal:
            yield prefix
        place += terminal
        (children,) = data.unpack("B", place)
        place += 1
        for _ in range(children):
            edge = data.text(place)
            place += len(edge.encode()) + 1
            offset, place = _number(data, place)
            if len(prefix) + len(edge) > 4096:
                raise BinaryError("a name of its exports is longer than 4096 characters")
            waiting.append((start + offset, prefix + edge))


def _number(data: Bytes, place: int) -> tuple[int, int]:
    value = shift = 0
    while shift < 64:
        (byte,) = data.unpack("B", place)
        value |= (byte & 0x7F) << shift
        place, shift = place + 1, shift + 7
        if not byte & 0x80:
            return value, place
    raise BinaryError("a number of its tree of exports is too long")
