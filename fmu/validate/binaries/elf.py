"""ELF shared libraries (System V ABI, chapters 4 and 5): the dynamic section as the loader reads it."""

from __future__ import annotations

from collections.abc import Iterator

from fmu.validate.binaries.shared_library import Binary, BinaryError, Bytes, bounded, first

_MACHINES = {3: "x86", 20: "ppc32", 21: "ppc64", 40: "aarch32", 62: "x86_64", 183: "aarch64", 243: "riscv"}
_LOAD, _DYNAMIC, _GNU_STACK = 1, 2, 0x6474E551
_NEEDED, _HASH, _STRTAB, _SYMTAB, _RPATH, _TEXTREL, _RUNPATH, _FLAGS = 1, 4, 5, 6, 15, 22, 29, 30
_GNU_HASH = 0x6FFFFEF5
_DF_TEXTREL = 0x4
_LINKER = {"_init", "_fini", "_edata", "_end", "__bss_start", "__bss_start__", "_bss_end__", "__bss_end__", "__end__"}
"""Names that linkers, not authors, export."""


def read(content: bytes) -> Binary:
    """Read an ELF file; see `fmu.validate.binaries.binary.read_binary`."""
    if len(content) < 20:
        raise BinaryError("it ends within its header")
    wide, order = content[4] == 2, "<" if content[5] == 1 else ">"
    data = Bytes(content, order)
    kind, machine = data.unpack("HH", 16)
    if kind != 3:
        raise BinaryError(f"it is an ELF file of kind {kind}, no shared library")
    segments = list(_segments(data, wide))
    dynamic = list(_dynamic(data, wide, segments))
    table = first(iter(dynamic))
    exports, imports = _symbols(data, wide, segments, table)
    strings = _offset(segments, table.get(_STRTAB, 0))
    named = {
        tag: tuple(data.text(strings + value) for key, value in dynamic if key == tag)
        for tag in (_NEEDED, _RPATH, _RUNPATH)
    }
    flaws = []
    if _TEXTREL in table or table.get(_FLAGS, 0) & _DF_TEXTREL:
        flaws.append("textrel")
    stacks = [flags for kind, flags, *_ in segments if kind == _GNU_STACK]
    if any(flags & 1 for flags in stacks) or (not stacks and machine in (3, 62)):
        flaws.append("execstack")
    return Binary(
        system="linux",
        machines=frozenset({_architecture(machine, wide)}),
        exports=frozenset(exports) - _LINKER,
        imports=frozenset(imports),
        needed=named[_NEEDED],
        rpaths=tuple(folder for text in (*named[_RPATH], *named[_RUNPATH]) for folder in text.split(":")),
        flaws=tuple(flaws),
    )


def _architecture(machine: int, wide: bool) -> str:
    name = _MACHINES.get(machine, f"machine {machine}")
    return f"riscv{64 if wide else 32}" if name == "riscv" else name


def _segments(data: Bytes, wide: bool) -> Iterator[tuple[int, int, int, int, int]]:
    """Yield kind, flags, offset, address and size in the file of each segment."""
    (start,) = data.unpack("Q" if wide else "I", 32 if wide else 28)
    size, count = data.unpack("HH", 54 if wide else 42)
    for number in range(count):
        place = start + number * size
        if wide:
            kind, flags, offset, address, _, length = data.unpack("IIQQQQ", place)
        else:
            kind, offset, address, _, length, _, flags = data.unpack("IIIIIII", place)
        yield kind, flags, offset, address, length


def _offset(segments: list[tuple[int, int, int, int, int]], address: int) -> int:
    for kind, _, offset, start, length in segments:
        if kind == _LOAD and start <= address < start + length:
            return offset + address - start
    raise BinaryError(f"the address {address:#x} is in no segment")


def _dynamic(data: Bytes, wide: bool, segments: list[tuple[int, int, int, int, int]]) -> Iterator[tuple[int, int]]:
    places = [(offset, length) for kind, _, offset, _, length in segments if kind == _DYNAMIC]
    if not places:
        raise BinaryError("it has no dynamic section")
    offset, length = places[0]
    size = 16 if wide else 8
    for number in bounded(length // size):
        tag, value = data.unpack("QQ" if wide else "II", offset + number * size)
        if tag == 0:
            return
        yield tag, value


def _symbols(
    data: Bytes, wide: bool, segments: list[tuple[int, int, int, int, int]], table: dict[int, int]
) -> tuple[set[str], set[str]]:
    exports: set[str] = set()
    imports: set[str] = set()
    if _SYMTAB not in table or _STRTAB not in table:
        return exports, imports
    symbols, strings = _offset(segments, table[_SYMTAB]), _offset(segments, table[_STRTAB])
    for number in bounded(_symbol_count(data, wide, segments, table)):
        place = symbols + number * (24 if wide else 16)
        if wide:
            name, info, other, section = data.unpack("IBBH", place)
        else:
            name, _, _, info, other, section = data.unpack("IIIBBH", place)
        binding, visibility = info >> 4, other & 3
        if name == 0 or binding not in (1, 2, 10):
            continue
        if section == 0:
            imports.add(data.text(strings + name))
        elif visibility in (0, 3):
            exports.add(data.text(strings + name))
    return exports, imports


def _symbol_count(
    data: Bytes, wide: bool, segments: list[tuple[int, int, int, int, int]], table: dict[int, int]
) -> int:
    if _HASH in table:
        return data.unpack("II", _offset(segments, table[_HASH]))[1]
    if _GNU_HASH not in table:
        raise BinaryError("it has no hash table of its symbols")
    # The table covers the exports, which come last; the largest bucket leads to the last chain.
    start = _offset(segments, table[_GNU_HASH])
    buckets, hidden, bloom, _ = data.unpack("IIII", start)
    first_bucket = start + 16 + bloom * (8 if wide else 4)
    last = max((data.unpack("I", first_bucket + 4 * number)[0] for number in bounded(buckets)), default=0)
    if last < hidden:
        return hidden
    chains = first_bucket + 4 * buckets
    while not data.unpack("I", chains + 4 * (last - hidden))[0] & 1:
        last += 1
    return last + 1
