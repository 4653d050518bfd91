"""Compile an exported model with the native runtime and package it as an FMU.

The compiler is called with argument lists, never through a shell.  The same sources give the same bytes: there is no
debug information (it would hold paths), and archives have fixed dates and sorted names.
"""

import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

RUNTIME = Path(__file__).resolve().parent / "runtime"
"""Folder of the runtime's C sources and headers."""

COMMON_FLAGS = ("-std=c99", "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off")
STRICT_FLAGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wformat=2", "-Werror")
GENERATED_FLAGS = ("-Wall", "-Wno-unused-function", "-Wno-unused-variable", "-Wno-unused-but-set-variable")
ARCHIVE_DATE = (1980, 1, 1, 0, 0, 0)


class BuildError(RuntimeError):
    """An FMU could not be compiled or packaged; the message says why and what to do."""


def runtime_sources() -> list[Path]:
    """Return the runtime's C files, sorted by name.

    Returns
    -------
    list of Path
        To be compiled together with the generated ``model.c``.
    """
    return sorted(RUNTIME.glob("*.c"))


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


def find_compiler() -> list[str]:
    """Find a C compiler.

    Returns
    -------
    list of str
        The command to which arguments are appended: the value of the environment variable ``CC`` if it is set,
        else the first of ``cc``, ``gcc``, ``clang`` on the path, else the C compiler of the package ziglang.

    Raises
    ------
    BuildError
        If ``CC`` names no executable, or if there is no compiler at all.
    """
    chosen = os.environ.get("CC", "").split()
    if chosen:
        if shutil.which(chosen[0]) is None:
            raise BuildError(
                f"The environment variable CC is '{' '.join(chosen)}', but there is no program '{chosen[0]}'. "
                "Remedy: let CC name an installed C compiler, or unset it."
            )
        return chosen
    for name in ("cc", "gcc", "clang"):
        path = shutil.which(name)
        if path is not None:
            return [path]
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc"]
    raise BuildError(
        "No C compiler was found: neither CC nor cc, gcc, clang, nor the package ziglang. "
        "Remedy: install a C compiler (for example the package gcc of the system), or: pip install ziglang."
    )


def _run(command: Sequence[str], folder: Path, task: str) -> None:
    """Run a command in a folder; its output becomes the error's message."""
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace", check=False)
    except OSError as error:
        raise BuildError(
            f"The compiler '{command[0]}' could not be started to {task}: {error.strerror}. "
            "Remedy: check the environment variable CC."
        ) from error
    if done.returncode != 0:
        report = (done.stderr or done.stdout).strip()[-4000:]
        raise BuildError(
            f"The compiler '{command[0]}' failed to {task} (status {done.returncode}). "
            f"Remedy: correct what its report says:\n{report}"
        )


def _is_runtime(source: Path) -> bool:
    return source.parent == RUNTIME


@contextmanager
def _replacing(target: Path) -> Iterator[Path]:
    """Yield a temporary path beside the target that replaces it on success and disappears on failure."""
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def compile_fmu(
    sources: Sequence[Path],
    include_dirs: Iterable[Path],
    output: Path,
    compiler: Sequence[str] | None = None,
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
        The compiler's command; found by `find_compiler` if not given.

    Returns
    -------
    Path
        The library, that is `output`.

    Raises
    ------
    BuildError
        If a source is missing, two have the same name, there is no compiler, or it fails.
    """
    files = [Path(source).resolve() for source in sources]
    for file in files:
        if not file.is_file():
            raise BuildError(f"The C source '{file.name}' does not exist; every source must. Remedy: export it first.")
    names = [file.stem for file in files]
    if not names or len(set(names)) != len(names):
        raise BuildError(f"The C sources {sorted(names)} must be at least one and differ in name. Remedy: rename them.")
    command = list(compiler) if compiler is not None else find_compiler()
    # Foreign headers are system headers, so that strict warnings speak of our own code only.
    includes = [flag for folder in include_dirs for flag in ("-isystem", str(Path(folder).resolve()))]
    with tempfile.TemporaryDirectory(prefix="hybrid-fmu-") as name:
        folder = Path(name)
        for file in files:
            warnings = STRICT_FLAGS if _is_runtime(file) else GENERATED_FLAGS
            arguments = [*COMMON_FLAGS, *warnings, f"-I{RUNTIME}", *includes, "-c", str(file), "-o", f"{file.stem}.o"]
            _run([*command, *arguments], folder, f"compile '{file.name}'")
        # Names of files would otherwise stay in the symbol table.
        strip = [] if sys.platform == "darwin" else ["-s"]
        objects = [f"{stem}.o" for stem in names]
        _run([*command, "-shared", *strip, *objects, "-lm", "-o", "library"], folder, f"link '{output.name}'")
        with _replacing(output) as temporary:
            shutil.copyfile(folder / "library", temporary)
        output.chmod(output.stat().st_mode | 0o111)
    return output


def _entries(content: Path | Mapping[str, bytes | Path]) -> dict[str, bytes]:
    """Return the bytes of each archive member by its name."""
    if isinstance(content, Path):
        if not content.is_dir():
            raise BuildError(f"The folder '{content}' to be packaged does not exist. Remedy: export into it first.")
        files = [path for path in content.rglob("*") if path.is_file()]
        return {path.relative_to(content).as_posix(): path.read_bytes() for path in files}
    return {name: item.read_bytes() if isinstance(item, Path) else item for name, item in content.items()}


def _check_name(name: str) -> None:
    parts = name.split("/")
    if name == "" or "\\" in name or ":" in name or any(part in ("", ".", "..") for part in parts):
        raise BuildError(
            f"The archive member '{name}' is not a plain relative path; an FMU must stay within its folder. "
            "Remedy: use names like 'binaries/x86_64-linux/Model.so'."
        )


def package(content: Path | Mapping[str, bytes | Path], fmu_path: Path) -> Path:
    """Write an FMU archive with fixed dates and sorted names, all at once or not at all.

    Parameters
    ----------
    content : Path or mapping of str to bytes or Path
        A folder, or the members' names (with ``/``) and what they hold: bytes, or the path of a file.
    fmu_path : Path
        The archive to write.  What was there stays until the new one is complete.

    Returns
    -------
    Path
        The archive, that is `fmu_path`.

    Raises
    ------
    BuildError
        If ``modelDescription.xml`` is missing, a name is not a plain relative path, or a file cannot be read.
    """
    try:
        members = _entries(content)
    except OSError as error:
        raise BuildError(
            f"'{error.filename}' cannot be read for the FMU '{fmu_path.name}': {error.strerror}. "
            "Remedy: check that the file exists and may be read."
        ) from error
    for name in members:
        _check_name(name)
    if "modelDescription.xml" not in members:
        raise BuildError(
            f"The FMU '{fmu_path.name}' has no modelDescription.xml; every FMU needs one at its top. "
            "Remedy: add the model description to the content."
        )
    with (
        _replacing(fmu_path) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive,
    ):
        for name in sorted(members):
            entry = zipfile.ZipInfo(name, ARCHIVE_DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = (0o100755 if name.startswith("binaries/") else 0o100644) << 16
            archive.writestr(entry, members[name])
    return fmu_path
