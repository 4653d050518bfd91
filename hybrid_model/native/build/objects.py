"""Object files: compiled as many at a time as there are processors, and kept if they are worth it.

The same source gives the same bytes: there is no debug information, which would hold paths, and no date is written.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hybrid_model.native.build.jobs import Task, run_all
from hybrid_model.native.build.kept_files import keep, kept_contents

COMMON_FLAGS = ("-std=c99", "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off")
STRICT_FLAGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wformat=2")
"""For sources of this project, whose tests add -Werror: a compiler of later years may warn of more."""
GENERATED_FLAGS = ("-O1", "-Wall", "-Wno-unused-function", "-Wno-unused-variable", "-Wno-unused-but-set-variable")
"""A model's maps are straight lines of arithmetic: -O2 takes longer to compile them and runs them no faster."""


@dataclass(frozen=True)
class Toolchain:
    """A compiler's command with the flags for its target, and a text that changes when the compiler does."""

    command: tuple[str, ...]
    identity: str


@dataclass(frozen=True)
class Unit:
    """A source to be compiled to an object file of its name in a folder.

    Attributes
    ----------
    source : Path
        C file, absolute.
    folder : Path
        Where the object goes; the compiler runs there.
    command : tuple of str
        Compiler, target and flags.
    key : str or None
        All that the object follows from, if it is kept.
    """

    source: Path
    folder: Path
    command: tuple[str, ...]
    key: str | None

    @property
    def file(self) -> Path:
        """The object file."""
        return self.folder / object_name(self.source)

    @property
    def task(self) -> Task:
        """The call of the compiler."""
        arguments = (*self.command, "-c", str(self.source), "-o", object_name(self.source))
        return Task(arguments, self.folder, f"compile '{self.source.name}' for {self.folder.name}")


def kept_units(
    sources: Iterable[Path],
    header_folders: Sequence[Path],
    toolchain: Toolchain,
    folder: Path,
    foreign_headers: Sequence[Path] = (),
    flags: Sequence[str] = STRICT_FLAGS,
) -> list[Unit]:
    """Return units of sources that include no other headers than those of the folders named: their objects are kept.

    Parameters
    ----------
    sources : iterable of Path
        C files, absolute, of different names.
    header_folders, foreign_headers : sequence of Path
        Folders of headers, of this project and of others.
    toolchain : Toolchain
        What compiles them.
    folder : Path
        Where objects go.
    flags : sequence of str
        Beside the common ones: strict warnings for sources of this project.
    """
    # Foreign headers are system headers, so that strict warnings speak of our own code only.
    includes = [*(f"-I{place}" for place in header_folders), *(f"-isystem{place}" for place in foreign_headers)]
    flags = (*COMMON_FLAGS, *flags)
    headers = digest(file for place in (*header_folders, *foreign_headers) for file in sorted(place.rglob("*.h")))
    # Where files lie is no part of a key.
    basis = (toolchain.identity, toolchain.command[1:], flags, headers)
    command = (*toolchain.command, *flags, *includes)
    return [Unit(source, folder, command, repr((*basis, digest([source])))) for source in sources]


def compile_units(units: Sequence[Unit], scratch: Path, progress: Callable[[str], None] | None = None) -> None:
    """Make object files: those that are kept are copied, the others compiled.

    Parameters
    ----------
    units : sequence of Unit
        In no particular order.
    scratch : Path
        Folder for the compiler's temporary files, deleted by the caller.
    progress : callable, optional
        Told in a few words what is being done.

    Raises
    ------
    BuildError
        If the compiler cannot be started or fails.
    """
    keyed = [unit for unit in units if unit.key is not None]
    known = kept_contents([(unit.source.stem, str(unit.key)) for unit in keyed])
    found = {unit: content for unit, content in zip(keyed, known, strict=True) if content is not None}
    for unit, content in found.items():
        unit.file.write_bytes(content)
    missing = [unit for unit in units if unit not in found]
    if progress is not None:
        progress(f"compiling {len(missing)} of {len(units)} C files")
    last = {unit.folder: unit for unit in missing}
    labels = {unit: f"compiled for {folder.name}" for folder, unit in last.items()}
    run_all([replace(unit.task, label=labels.get(unit, "")) for unit in missing], scratch, progress)
    for unit in missing:
        if unit.key is not None:
            keep(unit.source.stem, unit.key, unit.file.read_bytes())


def object_name(source: Path) -> str:
    """Return the name of a source's object file, relative to where the compiler runs."""
    # With a folder, because a name may begin like an option.
    return f"./{source.stem}.o"


def digest(files: Iterable[Path]) -> str:
    """Return a text that changes with the names or the content of files."""
    total = hashlib.sha256()
    for file in files:
        content = file.read_bytes()
        total.update(f"{file.name}\0{len(content)}\0".encode() + content)
    return total.hexdigest()
