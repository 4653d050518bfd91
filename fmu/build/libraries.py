"""Compile and link shared libraries, for one platform or several.

The same sources give the same bytes: objects hold neither paths nor dates, files are linked under a fixed name, and no
date is written. Objects are kept, those of generated files too, see `hybrid_model.native.build.objects`.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fmu.build.mach_o import export_only
from fmu.build.platforms import Platform
from fmu.build.refusals import refusals
from hybrid_model.native.build.compiler import compiler_identity, is_zig
from hybrid_model.native.build.jobs import Task, run_all
from hybrid_model.native.build.kept_files import keep, kept_content
from hybrid_model.native.build.objects import (
    GENERATED_FLAGS,
    Toolchain,
    Unit,
    compile_units,
    kept_units,
    object_name,
)
from hybrid_model.native.build.scratch import ScratchFolder
from hybrid_model.native.engine_files import ENGINE_FOLDERS

_LINUX_LINK = "-Wl,-z,defs,-z,noexecstack,-z,relro,-z,now"


@refusals()
def build_libraries(
    sources: Sequence[Path],
    own_folders: Sequence[Path],
    include_dirs: Sequence[Path],
    compiler: Sequence[str],
    platforms: Sequence[Platform],
    progress: Callable[[str], None] | None = None,
) -> dict[Platform, bytes]:
    """Compile and link for each platform; nothing is left on the disk but what is kept.

    Parameters
    ----------
    sources : sequence of Path
        C files, absolute, of different names.
    own_folders : sequence of Path
        Folders of headers.  The sources that lie in them are held to strict warnings, and their objects kept.
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
    with ScratchFolder() as name:
        scratch = Path(name).resolve()
        toolchains = {platform: Toolchain((*command, *_target(command, platform)), identity) for platform in platforms}
        builds = {}
        for platform, toolchain in toolchains.items():
            folder = scratch / platform.name
            folder.mkdir()
            units = _units(sources, own_folders, include_dirs, toolchain, folder)
            builds[platform] = _Build(platform, units, _link(toolchain.command, platform, sources, scratch))
        made = {platform: build.kept() for platform, build in builds.items()}
        missing = [build for platform, build in builds.items() if made[platform] is None]
        compile_units([unit for build in missing for unit in build.units], scratch, progress)
        if progress is not None and missing:
            # It compiles the C library of Windows, and keeps it.
            hint = " (minutes, the first time)" if any(build.platform.system == "windows" for build in missing) else ""
            progress(f"linking for {', '.join(build.platform.name for build in missing)}{hint}")
        run_all([build.link for build in missing], scratch, progress)
        return {platform: made[platform] or build.linked(command) for platform, build in builds.items()}


@dataclass(frozen=True)
class _Build:
    """What makes one library."""

    platform: Platform
    units: Sequence[Unit]
    link: Task

    @property
    def _key(self) -> str | None:
        """All that the library follows from; None where that cannot be told."""
        keys = [unit.key for unit in self.units]
        return None if None in keys else repr((self.platform, self.link.command[1:], keys))

    def kept(self) -> bytes | None:
        """The library, if the same one was built before."""
        return None if self._key is None else kept_content("library", self._key)

    def linked(self, command: Sequence[str]) -> bytes:
        """The library that has been linked; it is kept."""
        library = (self.link.folder / _library_name(self.platform)).read_bytes()
        if self.platform.system == "darwin" and is_zig(command):
            library = export_only(library, "_fmi")
        if self._key is not None:
            keep("library", self._key, library)
        return library


def _target(command: Sequence[str], platform: Platform) -> list[str]:
    # Without a target zig builds for the very processor of this machine.
    return ["-target", platform.zig_target, "-mcpu=baseline"] if is_zig(command) else []


def _units(
    sources: Sequence[Path],
    own_folders: Sequence[Path],
    include_dirs: Sequence[Path],
    toolchain: Toolchain,
    folder: Path,
) -> list[Unit]:
    """Return what is to be compiled for a platform, in the order of the sources."""
    places = frozenset(own_folders)
    engines = places & frozenset(ENGINE_FOLDERS)
    engine = [source for source in sources if source.parent in engines]
    own = [source for source in sources if source.parent in places - engines]
    # The engine knows no FMI, and its objects serve the runs of this machine too.
    units = kept_units(engine, ENGINE_FOLDERS, toolchain, folder)
    units += kept_units(own, own_folders, toolchain, folder, include_dirs)
    generated = [source for source in sources if source.parent not in places]
    for unit in kept_units(generated, own_folders, toolchain, folder, include_dirs, GENERATED_FLAGS):
        units.append(
            unit if _knows_its_headers(unit.source, (*own_folders, *include_dirs)) else replace(unit, key=None)
        )
    return units


def _knows_its_headers(source: Path, folders: Sequence[Path]) -> bool:
    """Return whether a source asks by name for headers of these folders only, as exported models do."""
    text = source.read_text(encoding="utf-8", errors="replace")
    # One beside the source would come first.
    known = {header.name for folder in folders for header in folder.glob("*.h")}
    known -= {header.name for header in source.parent.glob("*.h")}
    return all(name[:1] == "<" or name.strip(' \t\r"') in known for name in re.findall(r"#\s*include\s*([^\n]*)", text))


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
    objects = [object_name(source) for source in sources]
    arguments = (*command, *flags, *objects, "-lm", "-o", _library_name(platform))
    return Task(
        arguments, scratch / platform.name, f"link the library for {platform.name}", f"built for {platform.name}"
    )
