"""PE shared libraries (Microsoft PE format specification): export directory and import tables."""

from __future__ import annotations

from collections.abc import Iterator

from fmu.validate.binaries.shared_library import Binary, BinaryError, Bytes, bounded

_MACHINES = {0x14C: "x86", 0x8664: "x86_64", 0x1C4: "aarch32", 0xAA64: "aarch64"}
_DLL = 0x2000


def read(content: bytes) -> Binary:
    """Read a PE file; see `fmu.validate.binaries.binary.read_binary`."""
    data = Bytes(content)
    (header,) = data.unpack("I", 0x3C)
    if content[header : header + 4] != b"PE\0\0":
        raise BinaryError("it is a program of DOS")
    machine, sections = data.unpack("HH", header + 4)
    optional_size, flags = data.unpack("HH", header + 20)
    if not flags & _DLL:
        raise BinaryError("it is a Windows program, no DLL")
    optional = header + 24
    wide = data.unpack("H", optional)[0] == 0x20B
    directories = optional + (112 if wide else 96)
    (count,) = data.unpack("I", directories - 4)
    table = [data.unpack("II", directories + 8 * number)[0] if number < count else 0 for number in range(14)]
    spans = [data.unpack("IIII", optional + optional_size + 40 * number + 8) for number in range(sections)]
    reader = _Mapped(data, spans)
    exports = set(_exports(reader, table[0])) if table[0] else set()
    imported = [*_imports(reader, table[1], wide)] if table[1] else []
    delayed = [*_delayed(reader, table[13])] if table[13] else []
    return Binary(
        system="windows",
        machines=frozenset({_MACHINES.get(machine, f"machine {machine:#x}")}),
        exports=frozenset(exports),
        imports=frozenset(name for _, names in imported for name in names),
        needed=tuple(library for library, _ in imported) + tuple(delayed),
    )


class _Mapped:
    """A file read by the addresses its parts have in memory."""

    def __init__(self, data: Bytes, sections: list[tuple[int, ...]]) -> None:
        self.data, self.sections = data, sections

    def offset(self, address: int) -> int:
        for size, start, raw_size, raw in self.sections:
            if start <= address < start + max(size, raw_size):
                return raw + address - start
        raise BinaryError(f"the address {address:#x} is in no section")

    def unpack(self, form: str, address: int) -> tuple[int, ...]:
        return self.data.unpack(form, self.offset(address))

    def text(self, address: int) -> str:
        return self.data.text(self.offset(address))


def _exports(reader: _Mapped, directory: int) -> Iterator[str]:
    count, _, names = reader.unpack("III", directory + 24)
    for number in bounded(count):
        yield reader.text(reader.unpack("I", names + 4 * number)[0])


def _imports(reader: _Mapped, directory: int, wide: bool) -> Iterator[tuple[str, list[str]]]:
    for number in bounded(10_000):
        lookup, _, _, library, thunks = reader.unpack("IIIII", directory + 20 * number)
        if library == 0:
            return
        yield reader.text(library), list(_thunks(reader, lookup or thunks, wide))


def _thunks(reader: _Mapped, address: int, wide: bool) -> Iterator[str]:
    for number in bounded(100_000):
        (thunk,) = reader.unpack("Q" if wide else "I", address + number * (8 if wide else 4))
        if thunk == 0:
            return
        if not thunk >> (63 if wide else 31):
            yield reader.text((thunk & 0x7FFFFFFF) + 2)


def _delayed(reader: _Mapped, directory: int) -> Iterator[str]:
    for number in bounded(10_000):
        _, library = reader.unpack("II", directory + 32 * number)
        if library == 0:
            return
        yield reader.text(library)
