"""Rules for the binaries: where they lie, what they export, what they need."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import PurePosixPath

from fmu.archives.reading import Archive
from fmu.standard.capabilities import promised
from fmu.standard.functions import required
from fmu.standard.platforms import EXTENSIONS, FMI2, parts_of
from fmu.validate.binaries.binary import read_binary
from fmu.validate.binaries.shared_library import Binary, BinaryError
from fmu.validate.findings import Finding, error, note, quoted, warning
from fmu.validate.reading.description import Description

PLACES = "FMI 2.0.4 section 2.3; FMI 3.0.2 section 2.5.1"
FUNCTIONS = "FMI 2.0.4 sections 2.1, 3.2 and 4.2; FMI 3.0.2 section 2.5"
INTERPOSITION = "ELF lookup: the first definition in the process wins, without a word"
LARGEST = 512 << 20

_RUNTIMES = {
    "Python": re.compile(r"_?Py[A-Z_]\w*"),
    "Java": re.compile(r"JNI_\w+"),
    "Julia": re.compile(r"jl_\w+"),
    "MATLAB": re.compile(r"mx[A-Z]\w+|mex[A-Z]\w+"),
    "R": re.compile(r"Rf_\w+|R_[A-Z]\w+"),
}
_USUAL = re.compile(
    r"lib(c|m|dl|pthread|rt)\.so\.\d+|ld-linux.*|linux-vdso.*|"
    r"(kernel32|ntdll|msvcrt|ucrtbase|user32|advapi32)\.dll|api-ms-win-.*\.dll|"
    r"/usr/lib/libSystem\.B\.dylib",
    re.IGNORECASE,
)


def binary_findings(archive: Archive, description: Description) -> Iterator[Finding]:
    """Yield what is wrong with the binaries, or with their absence."""
    folders: dict[str, list[str]] = {}
    for name in archive.names:
        parts = name.split("/")
        if parts[0] == "binaries" and len(parts) > 2:
            folders.setdefault(parts[1], []).append(name)
        elif parts[0] == "binaries" and len(parts) == 2:
            yield warning("binary.place", f"{name} lies in no folder of a platform: importers do not find it.", PLACES)
    if not folders:
        if not any(name.startswith("sources/") for name in archive.names):
            yield error(
                "binary.none", "The FMU has neither binaries nor sources: it needs at least one of them.", PLACES
            )
        else:
            yield note("binary.none", "The FMU has sources only: importers that do not compile cannot use it.", PLACES)
    for folder, files in sorted(folders.items()):
        yield from _folder(archive, description, folder, files)


def _folder(archive: Archive, description: Description, folder: str, files: list[str]) -> Iterator[Finding]:
    platform = parts_of(folder)
    if platform is None:
        yield warning("binary.platform", f"binaries/{folder} is no platform that the standard names.", PLACES)
        return
    if (folder in FMI2) != (description.major == 2) and (description.major == 3 or _has_name_in_fmi2(platform)):
        yield warning(
            "binary.platform",
            f"binaries/{folder} is a name of the other version: importers of FMI {description.version} pass it.",
            PLACES,
        )
    machine, system, interface = platform
    by_file: dict[str, dict[str, Mapping[str, str]]] = {}
    for kind, attributes in description.interfaces.items():
        name = f"binaries/{folder}/{attributes.get('modelIdentifier', '')}{EXTENSIONS[system]}"
        by_file.setdefault(name, {})[kind] = attributes
    for name, kinds in by_file.items():
        if name not in files:
            yield _missing(archive, name, files, " and ".join(kinds), static=bool(interface))
            continue
        if archive.size(name) > LARGEST:
            yield note("binary.large", f"{name} is larger than {LARGEST} bytes: it has not been looked at.")
            continue
        try:
            binary = read_binary(archive.read(name))
        except BinaryError as problem:
            yield error(
                "binary.damaged", f"{name} cannot be read as a shared library: {problem}. Build it anew.", PLACES
            )
            continue
        yield from _library(name, binary, machine, system)
        yield from _symbols(name, binary, description, kinds)


def _missing(archive: Archive, name: str, files: list[str], kinds: str, *, static: bool) -> Finding:
    """Return what it means that a folder lacks the shared library of some interface types."""
    folder, identifier = name.rpartition("/")[0], PurePosixPath(name).stem
    if static or any(file.startswith(f"{folder}/{identifier}.") and file.endswith((".a", ".lib")) for file in files):
        text = f"{folder} holds a static library for {kinds}: it has not been looked at."
        return note("binary.static", text, PLACES)
    # A folder of other files, where another platform has its binary, is a platform that is not supported.
    misnamed = any(file.endswith(PurePosixPath(name).suffix) for file in files)
    return (error if misnamed or not _supported(archive, identifier) else warning)(
        "binary.missing",
        f"{name} is missing, which {kinds} asks for by its modelIdentifier: importers look for just this name.",
        PLACES,
    )


def _supported(archive: Archive, identifier: str) -> bool:
    """Tell whether some platform has a binary of that name."""
    platforms = [(name.split("/"), parts_of(name.split("/")[1])) for name in archive.names if name.count("/") == 2]
    return any(
        parts[0] == "binaries" and platform is not None and parts[2] == f"{identifier}{EXTENSIONS[platform[1]]}"
        for parts, platform in platforms
    )


def _has_name_in_fmi2(platform: tuple[str, str, str]) -> bool:
    return platform[:2] in FMI2.values()


def _library(name: str, binary: Binary, machine: str, system: str) -> Iterator[Finding]:
    if binary.system != system or machine not in binary.machines:
        found = f"{', '.join(sorted(binary.machines))}-{binary.system}"
        yield error("binary.machine", f"{name} is built for {found}: put it into the folder of its platform.", PLACES)
    # $ORIGIN is what the standard asks of an FMU that brings further libraries.
    foreign = [path for path in binary.rpaths if not path.startswith(("$ORIGIN", "${ORIGIN}", "@loader_path"))]
    if foreign:
        yield warning(
            "binary.rpath",
            f"{name} looks for libraries in {quoted(foreign[0])} first: link without RPATH, or with $ORIGIN.",
            PLACES,
        )
    if "textrel" in binary.flaws:
        yield warning(
            "binary.textrel", f"{name} has relocations in its code: hardened systems refuse it. Compile with -fPIC."
        )
    if "execstack" in binary.flaws:
        yield warning(
            "binary.execstack",
            f"{name} asks for an executable stack: new C libraries refuse it. Link with -z noexecstack.",
        )
    further = [library for library in binary.needed if not _USUAL.fullmatch(library)]
    if further:
        yield note(
            "binary.needed", f"{name} needs the libraries {', '.join(map(quoted, further))} of the machine.", PLACES
        )


def _symbols(
    name: str, binary: Binary, description: Description, kinds: dict[str, Mapping[str, str]]
) -> Iterator[Finding]:
    wanted: dict[str, str] = {}
    for kind, attributes in kinds.items():
        for function in required(description.major, kind):
            wanted.setdefault(function, f"{kind} needs it")
        for function, flag in promised(description.major, attributes).items():
            wanted[function] = f"{kind} says {flag}"
    missing = [function for function in sorted(wanted) if function not in binary.exports]
    if missing:
        shown = ", ".join(f"{function} ({wanted[function]})" for function in missing[:6])
        more = f" and {len(missing) - 6} more" if len(missing) > 6 else ""
        yield error(
            "symbol.missing",
            f"{name} does not export {shown}{more}: importers look up all functions of an interface type when "
            "they load it.",
            FUNCTIONS,
        )
    other = sorted(symbol for symbol in binary.exports if not re.fullmatch(r"fmi[123][A-Z]\w*", symbol))
    if other:
        shown = ", ".join(quoted(symbol, 40) for symbol in other[:6])
        more = f" and {len(other) - 6} more" if len(other) > 6 else ""
        beside = f"{name} exports {shown}{more} beside the FMI functions"
        if binary.system == "linux":
            text = "a function of that name in the host may be called instead. Compile with -fvisibility=hidden."
            yield warning("symbol.exported", f"{beside}: {text}", INTERPOSITION)
        else:  # names are looked up library by library
            yield note("symbol.exported", f"{beside}.")
    for runtime, pattern in _RUNTIMES.items():
        called = sorted(symbol for symbol in binary.imports if pattern.fullmatch(symbol))
        if called:
            yield warning(
                "symbol.runtime",
                f"{name} needs {called[0]} and {len(called) - 1} more functions of {runtime}: it loads only "
                "into a process, or "
                f"on a machine, that has just this {runtime}. Export native code.",
                "FMI 2.0.4 section 2.3; FMI 3.0.2 section 2.5.1: external libraries",
            )
