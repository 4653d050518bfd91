"""Object files of sources that seldom change: compiled as many at a time as there are processors, and kept."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from hybrid_model.native.build.jobs import Task, run_all
from hybrid_model.native.build.kept_files import find, keep

COMMON_FLAGS = ("-std=c99", "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off")
STRICT_FLAGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wformat=2", "-Werror")
GENERATED_FLAGS = ("-Wall", "-Wno-unused-function", "-Wno-unused-variable", "-Wno-unused-but-set-variable")


def kept_objects(
    sources: Sequence[Path],
    own_folders: Sequence[Path],
    include_dirs: Sequence[Path],
    command: Sequence[str],
    identity: str,
    scratch: Path,
    progress: Callable[[str], None] | None = None,
) -> dict[Path, Path]:
    """Return the object file of each source.

    Parameters
    ----------
    sources : sequence of Path
        C files of different names, held to strict warnings.
    own_folders, include_dirs : sequence of Path
        Folders of headers: of the project, and foreign ones.
    command : sequence of str
        The compiler's command, with the flags for its target.
    identity : str
        Changes when the compiler does.
    scratch : Path
        Folder for temporary files, deleted by the caller.
    progress : callable, optional
        Told the labels of tasks as they end.

    Returns
    -------
    dict of Path to Path
        Source -> object file, not to be changed.

    Raises
    ------
    BuildError
        If the compiler cannot be started or fails.
    """
    # Foreign headers are system headers, so that strict warnings speak of our own code only.
    includes = [*(f"-I{place}" for place in own_folders), *(f"-isystem{place}" for place in include_dirs)]
    flags = [*COMMON_FLAGS, *STRICT_FLAGS]
    headers = digest(header for folder in (*own_folders, *include_dirs) for header in sorted(folder.glob("*.h")))
    # Paths are no part of a key: there is no debug information that would hold them.
    keys = {source: repr((identity, flags, headers, digest([source]))) for source in sources}
    objects = {source: find(f"{source.stem}.o", key) for source, key in keys.items()}
    missing = [source for source, file in objects.items() if file is None]
    tasks = [
        Task(
            (*command, *flags, *includes, "-c", str(source), "-o", f"./{source.stem}.o"),
            scratch,
            f"compile '{source.name}'",
        )
        for source in missing
    ]
    if tasks:
        run_all(tasks, scratch, progress)
    made = {
        source: keep(f"{source.stem}.o", keys[source], (scratch / f"{source.stem}.o").read_bytes())
        for source in missing
    }
    return {source: file if file is not None else made[source] for source, file in objects.items()}


def digest(files: Iterable[Path]) -> str:
    """Return a text that changes with the names or the content of files."""
    total = hashlib.sha256()
    for file in files:
        content = file.read_bytes()
        total.update(f"{file.name}\0{len(content)}\0".encode() + content)
    return total.hexdigest()
