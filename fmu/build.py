"""Compile an exported model with the native runtime, for this machine or for others.

The same sources give the same bytes: there is no debug information (it would hold paths), files are linked under a
fixed name, and no date is written.  The runtime's objects do not depend on the model; a process compiles them once.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fmu.compiler import Task, compiler_identity, find_compiler, is_zig, run_all, zig_compiler
from fmu.errors import BuildError
from fmu.macho import export_only
from fmu.package import ARCHIVE_DATE, check_target, package, replacing
from fmu.platforms import PLATFORMS, Platform, chosen_platforms, library_members, this_platform

__all__ = [
    "ARCHIVE_DATE",
    "COMMON_FLAGS",
    "GENERATED_FLAGS",
    "PLATFORMS",
    "RUNTIME",
    "STRICT_FLAGS",
    "BuildError",
    "binaries",
    "check_target",
    "compile_fmu",
    "find_compiler",
    "fmi_headers",
    "package",
    "runtime_sources",
]

RUNTIME = Path(__file__).resolve().parent / "runtime"
"""Folder of the runtime's C sources and headers."""

COMMON_FLAGS = ("-std=c99", "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off")
STRICT_FLAGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wformat=2", "-Werror")
GENERATED_FLAGS = ("-Wall", "-Wno-unused-function", "-Wno-unused-variable", "-Wno-unused-but-set-variable")

_LINUX_LINK = "-Wl,-z,defs,-z,noexecstack,-z,relro,-z,now"
_OBJECT_LIMIT = 500

_objects: dict[str, bytes] = {}
_objects_lock = threading.Lock()


def runtime_sources(fmi: str = "3.0") -> list[Path]:
    """Return the runtime's C files for one version of the standard, sorted by name.

    Parameters
    ----------
    fmi : {"2.0", "3.0"}
        Version whose functions the library is to have.

    Returns
    -------
    list of Path
        To be compiled together with the generated ``model.c``.
    """
    other = "fmi3" if fmi == "2.0" else "fmi2"
    return [source for source in sorted(RUNTIME.glob("*.c")) if not source.name.startswith(other)]


def fmi_headers() -> Path:
    """Return the folder of the FMI header files, which come with fmpy.

    Returns
    -------
    Path
        Folder that holds ``fmi3Functions.h``.

    Raises
    ------
    BuildError
        If fmpy or its header files are missing.
    """
    spec = importlib.util.find_spec("fmpy")
    for place in (spec.submodule_search_locations or []) if spec else []:
        folder = Path(place) / "c-code"
        if (folder / "fmi3Functions.h").is_file():
            return folder
    raise BuildError(
        "The FMI header file fmi3Functions.h was not found; it comes with the package fmpy. Remedy: pip install fmpy."
    )


def binaries(
    sources: Sequence[Path],
    include_dirs: Iterable[Path],
    identifier: str,
    *,
    fmi: str,
    platforms: Iterable[str] | None = None,
    progress: Callable[[str], None] | None = None,
) -> dict[str, bytes]:
    """Compile C sources for platforms and name the libraries as members of an FMU's archive.

    The system's compiler builds for this machine alone.  As soon as another platform is wanted, the package ziglang
    builds for all of them, this machine's included, so that the file runs on other and older machines.

    Parameters
    ----------
    sources : sequence of Path
        C files, as for `compile_fmu`.
    include_dirs : iterable of Path
        Folders for header files.
    identifier : str
        The model identifier, which libraries are named after.
    fmi : str
        ``"2.0"`` or ``"3.0"``, which name the folders of platforms differently.
    platforms : iterable of str, optional
        Names as in FMI 3, for example ``x86_64-linux``; this machine's if not given.
    progress : callable, optional
        Told in a few words what is being done.

    Returns
    -------
    dict of str to bytes
        Archive members below ``binaries/``.

    Raises
    ------
    BuildError
        As for `compile_fmu`; if a platform is unknown; or if ziglang is needed and not installed.
    """
    chosen = chosen_platforms(platforms)
    libraries = _build(_checked(sources), _folders(include_dirs), _compiler_for(chosen), chosen, progress)
    return library_members(identifier, fmi, libraries)


def compile_fmu(
    sources: Sequence[Path],
    include_dirs: Iterable[Path],
    output: Path,
    compiler: Sequence[str] | None = None,
    platform: str | None = None,
) -> Path:
    """Compile C sources to a shared library that exports the FMI functions and nothing else.

    Parameters
    ----------
    sources : sequence of Path
        C files.  Those of the runtime's folder are held to strict warnings; any other one counts as generated.
    include_dirs : iterable of Path
        Folders for header files, in addition to the runtime's own.
    output : Path
        The library to write; it appears only when it is complete.
    compiler : sequence of str, optional
        The compiler's command; if not given, found by `find_compiler` for this machine, that of ziglang for others.
    platform : str, optional
        Name as in FMI 3; this machine's if not given.

    Returns
    -------
    Path
        The library, that is `output`.

    Raises
    ------
    BuildError
        If a source is missing, two have the same name, there is no compiler, it fails, or `output` cannot be written.
    """
    [target] = chosen = chosen_platforms(None if platform is None else [platform])
    files = _checked(sources)
    command = list(compiler) if compiler is not None else _compiler_for(chosen)
    library = _build(files, _folders(include_dirs), command, chosen)[target]
    with replacing(output, mode=0o777) as temporary:
        temporary.write_bytes(library)
    return output


def _compiler_for(platforms: Sequence[Platform]) -> list[str]:
    """Return the system's compiler for this machine alone, else the one that builds for all."""
    try:
        here = tuple(platforms) == (this_platform(),)
    except BuildError:
        here = False
    return find_compiler() if here else zig_compiler()


def _checked(sources: Sequence[Path]) -> list[Path]:
    files = [Path(source).resolve() for source in sources]
    for file in files:
        if not file.is_file():
            raise BuildError(f"The C source '{file.name}' does not exist; every source must. Remedy: export it first.")
    names = [file.stem for file in files]
    if not names or len(set(names)) != len(names):
        raise BuildError(f"The C sources {sorted(names)} must be at least one and differ in name. Remedy: rename them.")
    return files


def _folders(include_dirs: Iterable[Path]) -> list[Path]:
    return [Path(folder).resolve() for folder in include_dirs]


@dataclass(frozen=True)
class _Object:
    """A source to be compiled for a platform, the file it becomes, and its key if it is worth keeping."""

    task: Task
    file: Path
    key: str | None


def _build(
    sources: Sequence[Path],
    include_dirs: Sequence[Path],
    compiler: Sequence[str],
    platforms: Sequence[Platform],
    progress: Callable[[str], None] | None = None,
) -> dict[Platform, bytes]:
    """Compile and link for each platform; nothing is left on the disk."""
    identity = compiler_identity(compiler)
    # Compilers run in folders of ours: a relative path would not be found there.
    command = [os.path.abspath(shutil.which(compiler[0]) or compiler[0]), *compiler[1:]]
    with tempfile.TemporaryDirectory(prefix="hybrid-fmu-") as name:
        scratch = Path(name).resolve()
        toolchains = {platform: [*command, *_target(command, platform)] for platform in platforms}
        headers = _digest([header for folder in (RUNTIME, *include_dirs) for header in sorted(folder.rglob("*.h"))])
        objects: list[_Object] = []
        for platform, toolchain in toolchains.items():
            folder = scratch / platform.name
            folder.mkdir()
            for source in sources:
                objects.append(_object(source, include_dirs, toolchain, folder, identity + headers))
        _compile(objects, scratch, progress)
        if progress is not None:
            # It compiles the C library of Windows, and keeps it.
            hint = " (minutes, the first time)" if any(platform.system == "windows" for platform in platforms) else ""
            progress(f"linking for {', '.join(platform.name for platform in platforms)}{hint}")
        links = [_link(toolchain, platform, sources, scratch) for platform, toolchain in toolchains.items()]
        run_all(links, scratch, progress)
        return {platform: _library(toolchain, platform, scratch) for platform, toolchain in toolchains.items()}


def _target(command: Sequence[str], platform: Platform) -> list[str]:
    # Without a target zig builds for the very processor of this machine.
    return ["-target", platform.zig_target, "-mcpu=baseline"] if is_zig(command) else []


def _object(source: Path, include_dirs: Sequence[Path], command: Sequence[str], folder: Path, basis: str) -> _Object:
    own = source.parent == RUNTIME
    # Foreign headers are system headers, so that strict warnings speak of our own code only.
    includes = [flag for place in include_dirs for flag in ("-isystem", str(place))]
    flags = [*COMMON_FLAGS, *(STRICT_FLAGS if own else GENERATED_FLAGS)]
    file = folder / _object_name(source)
    arguments = [*command, *flags, f"-I{RUNTIME}", *includes, "-c", str(source), "-o", _object_name(source)]
    task = Task(tuple(arguments), folder, f"compile '{source.name}' for {folder.name}")
    # The arguments hold the source's path, and so its name.
    key = hashlib.sha256(repr((basis, arguments, _digest([source]))).encode()).hexdigest() if own else None
    return _Object(task, file, key)


def _digest(files: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        content = file.read_bytes()
        digest.update(f"{file.name}\0{len(content)}\0".encode() + content)
    return digest.hexdigest()


def _compile(objects: Sequence[_Object], scratch: Path, progress: Callable[[str], None] | None) -> None:
    """Make the object files: those that this process has made before are copied, the others compiled."""
    with _objects_lock:
        known = {entry.key: _objects[entry.key] for entry in objects if entry.key in _objects}
    missing = [entry for entry in objects if entry.key not in known]
    if progress is not None:
        progress(f"compiling {len(missing)} of {len(objects)} C files")
    last = {entry.task.folder: entry.file for entry in missing}
    labels = {file: f"compiled for {folder.name}" for folder, file in last.items()}
    run_all([replace(entry.task, label=labels.get(entry.file, "")) for entry in missing], scratch, progress)
    for entry in objects:
        if entry.key in known:
            entry.file.write_bytes(known[entry.key])
    made = {entry.key: entry.file.read_bytes() for entry in missing if entry.key is not None}
    with _objects_lock:
        if len(_objects) > _OBJECT_LIMIT:
            _objects.clear()
        _objects.update(made)


def _object_name(source: Path) -> str:
    # With a folder, because a name may begin like an option.
    return f"./{source.stem}.o"


def _library_name(platform: Platform) -> str:
    # Linkers of Windows and macOS write the name into the library.
    return f"model{platform.extension}"


def _link(command: Sequence[str], platform: Platform, sources: Sequence[Path], scratch: Path) -> Task:
    zig = is_zig(command)
    # Names of files would otherwise stay in the symbol table; Apple's own linker has no such option.
    flags = ["-shared", *(["-s"] if zig or platform.system != "darwin" else [])]
    if platform.system == "linux":
        # zig refuses text relocations without being asked.
        flags.append(_LINUX_LINK if zig else f"{_LINUX_LINK},-z,text")
    elif platform.system == "windows":
        flags.append("-Wl,-Brepro" if zig else "-Wl,--no-insert-timestamp")
    objects = [_object_name(source) for source in sources]
    arguments = (*command, *flags, *objects, "-lm", "-o", _library_name(platform))
    return Task(
        arguments, scratch / platform.name, f"link the library for {platform.name}", f"built for {platform.name}"
    )


def _library(command: Sequence[str], platform: Platform, scratch: Path) -> bytes:
    library = (scratch / platform.name / _library_name(platform)).read_bytes()
    return export_only(library, "_fmi") if platform.system == "darwin" and is_zig(command) else library
