"""Compile and link shared libraries, for one platform or several.

The same sources give the same bytes: there is no debug information (it would hold paths), files are linked under a
fixed name, and no date is written.  The runtime's objects do not depend on the model; a process compiles them once.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fmu.build.mach_o import export_only
from fmu.build.platforms import Platform
from fmu.build.refusals import refusals
from hybrid_model.native.build.compiler import compiler_identity, is_zig
from hybrid_model.native.build.jobs import Task, run_all
from hybrid_model.native.build.objects import COMMON_FLAGS, GENERATED_FLAGS, STRICT_FLAGS

_LINUX_LINK = "-Wl,-z,defs,-z,noexecstack,-z,relro,-z,now"
_OBJECT_LIMIT = 500

_objects: dict[str, bytes] = {}
_objects_lock = threading.Lock()


@dataclass(frozen=True)
class _Object:
    """A source to be compiled for a platform, the file it becomes, and its key if it is worth keeping."""

    task: Task
    file: Path
    key: str | None


@refusals()
def build_libraries(
    sources: Sequence[Path],
    own_folders: Sequence[Path],
    include_dirs: Sequence[Path],
    compiler: Sequence[str],
    platforms: Sequence[Platform],
    progress: Callable[[str], None] | None = None,
) -> dict[Platform, bytes]:
    """Compile and link for each platform; nothing is left on the disk.

    Parameters
    ----------
    sources : sequence of Path
        C files, absolute, of different names.
    own_folders : sequence of Path
        Folders of headers.  The sources that lie in them are held to strict warnings, and compiled once a process.
    include_dirs : sequence of Path
        Folders of foreign headers, absolute.
    compiler : sequence of str
        The compiler's command.
    platforms : sequence of Platform
        More than one, or another than this machine's, with zig only.
    progress : callable, optional
        Told in a few words what is being done.

    Returns
    -------
    dict of Platform to bytes
        The libraries.

    Raises
    ------
    BuildError
        If there is no such compiler or it fails.
    """
    identity = compiler_identity(compiler)
    # Compilers run in folders of ours: a relative path would not be found there.
    command = [os.path.abspath(shutil.which(compiler[0]) or compiler[0]), *compiler[1:]]
    with tempfile.TemporaryDirectory(prefix="hybrid-fmu-") as name:
        scratch = Path(name).resolve()
        toolchains = {platform: [*command, *_target(command, platform)] for platform in platforms}
        headers = _digest(
            [header for folder in (*own_folders, *include_dirs) for header in sorted(folder.rglob("*.h"))]
        )
        objects: list[_Object] = []
        for platform, toolchain in toolchains.items():
            folder = scratch / platform.name
            folder.mkdir()
            for source in sources:
                objects.append(_object(source, own_folders, include_dirs, toolchain, folder, identity + headers))
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


def _object(
    source: Path,
    own_folders: Sequence[Path],
    include_dirs: Sequence[Path],
    command: Sequence[str],
    folder: Path,
    basis: str,
) -> _Object:
    own = source.parent in own_folders
    # Foreign headers are system headers, so that strict warnings speak of our own code only.
    includes = [flag for place in include_dirs for flag in ("-isystem", str(place))]
    flags = [*COMMON_FLAGS, *(STRICT_FLAGS if own else GENERATED_FLAGS)]
    file = folder / _object_name(source)
    arguments = [
        *command,
        *flags,
        *(f"-I{place}" for place in own_folders),
        *includes,
        "-c",
        str(source),
        "-o",
        _object_name(source),
    ]
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
