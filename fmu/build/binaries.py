"""Build an exported model with the native runtime, for this machine or for others."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from fmu.archives.writing import replacing
from fmu.build.libraries import build_libraries
from fmu.build.platforms import Platform, chosen_platforms, library_members, this_platform
from fmu.build.refusals import refusals
from fmu.errors import BuildError
from hybrid_model.native.build.compiler import find_compiler, zig_compiler
from hybrid_model.native.engine_files import ENGINE_FOLDERS

OWN_FOLDERS = (*ENGINE_FOLDERS, Path(__file__).resolve().parents[1] / "interface")
"""Folders of the C sources and headers that every FMU carries: the engine, and the interface of the standard."""


def own_files(pattern: str) -> list[Path]:
    """Return the files of `OWN_FOLDERS` whose names match a pattern of the shell, sorted by name."""
    return sorted((file for folder in OWN_FOLDERS for file in folder.glob(pattern)), key=lambda file: file.name)


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
    return [source for source in own_files("*.c") if not source.name.startswith(other)]


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
    libraries = build_libraries(
        _checked(sources), OWN_FOLDERS, _folders(include_dirs), _compiler_for(chosen), chosen, progress
    )
    return library_members(identifier, fmi, libraries, only_here=platforms is None)


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
        C files.  Those of `OWN_FOLDERS` are held to strict warnings; any other one counts as generated.
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
    library = build_libraries(files, OWN_FOLDERS, _folders(include_dirs), command, chosen)[target]
    with replacing(output, mode=0o777) as temporary:
        temporary.write_bytes(library)
    return output


def _compiler_for(platforms: Sequence[Platform]) -> list[str]:
    """Return the system's compiler for this machine alone, else the one that builds for all."""
    try:
        here = tuple(platforms) == (this_platform(),)
    except BuildError:
        here = False
    with refusals():
        return find_compiler() if here else zig_compiler()


def _checked(sources: Sequence[Path]) -> list[Path]:
    # Ours are known by absolute paths already.
    own = frozenset(OWN_FOLDERS)
    files = [source if source.parent in own else source.resolve() for source in map(Path, sources)]
    for file in files:
        if not file.is_file():
            raise BuildError(f"The C source '{file.name}' does not exist; every source must. Remedy: export it first.")
    names = [file.stem for file in files]
    if not names or len(set(names)) != len(names):
        raise BuildError(f"The C sources {sorted(names)} must be at least one and differ in name. Remedy: rename them.")
    return files


def _folders(include_dirs: Iterable[Path]) -> list[Path]:
    return [Path(folder).resolve() for folder in include_dirs]
