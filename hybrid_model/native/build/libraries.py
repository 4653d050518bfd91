"""The libraries that a run in this process loads: the engine, and the maps of one model."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from hybrid_model.native.build.compiler import compiler_identity, find_compiler, is_zig
from hybrid_model.native.build.jobs import Task, run_all
from hybrid_model.native.build.kept_files import kept
from hybrid_model.native.build.objects import (
    COMMON_FLAGS,
    GENERATED_FLAGS,
    STRICT_FLAGS,
    Toolchain,
    compile_units,
    digest,
    kept_units,
)
from hybrid_model.native.build.scratch import ScratchFolder
from hybrid_model.native.engine_files import ENGINE_FOLDERS, RUNS_FOLDERS

MODEL_SYMBOL = "model_of_library"
"""The function of a model's library that returns the address of its ``Model``."""
_EXPORT = f"""
#if defined(_WIN32)
__declspec(dllexport)
#else
__attribute__((visibility("default")))
#endif
const Model *{MODEL_SYMBOL}(void);
const Model *{MODEL_SYMBOL}(void)
{{
    return &model;
}}
"""
_NETWORKS = next(folder for folder in ENGINE_FOLDERS if folder.name == "networks")
_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
_MODEL_FLAGS = (*COMMON_FLAGS, *GENERATED_FLAGS)


def engine_library() -> Path:
    """Return the shared library of the engine, compiled once a machine, compiler and version of the engine.

    Returns
    -------
    Path
        It exports what ``hybrid_model/engine`` marks for it, and nothing else.

    Raises
    ------
    BuildError
        If there is no C compiler, or it fails.
    """
    toolchain = _toolchain()
    folders = (*ENGINE_FOLDERS, *RUNS_FOLDERS)
    sources = [source for folder in folders for source in sorted(folder.glob("*.c"))]

    def make(library: Path) -> None:
        with _folder("engine") as folder:
            objects = _objects(sources, toolchain, folder)
            _link(toolchain, objects, library, "link the engine")

    return kept(f"engine{_SUFFIX}", repr((toolchain, COMMON_FLAGS, _engine_digest("*.[ch]"))), make)


def model_library(source: str) -> Path:
    """Return the shared library of one model.

    Parameters
    ----------
    source : str
        What `hybrid_model.native.model_code.model_code` returns.

    Returns
    -------
    Path
        It exports one function without arguments, `MODEL_SYMBOL`, which returns a ``const Model *``.

    Raises
    ------
    BuildError
        If there is no C compiler, or it fails.
    """
    toolchain = _toolchain()
    # Of the engine a network needs the loops over its tables, other models only headers.
    loops = sorted(_NETWORKS.glob("*.c")) if '#include "network.h"' in source else []

    def make(library: Path) -> None:
        with _folder("model") as folder:
            objects = _objects(loops, toolchain, folder) if loops else []
            file = folder / "model.c"
            file.write_text(source + _EXPORT, encoding="ascii")
            # Compiled and linked by one call.
            flags = [*_MODEL_FLAGS, *(f"-I{place}" for place in ENGINE_FOLDERS)]
            _link(toolchain, [*flags, str(file), *objects], library, "compile the model")

    basis = _engine_digest("*.[ch]" if loops else "*.h")
    return kept(f"model{_SUFFIX}", repr((toolchain, _MODEL_FLAGS, basis, _EXPORT, source)), make)


def source_library(source: Path) -> Path:
    """Return the shared library of one C file that includes nothing of the engine, and marks what it exports.

    Raises
    ------
    BuildError
        If there is no C compiler, or it fails.
    """
    toolchain = _toolchain()

    def make(library: Path) -> None:
        _link(toolchain, [*COMMON_FLAGS, *STRICT_FLAGS, str(source)], library, f"compile {source.name}")

    return kept(f"{source.stem}{_SUFFIX}", repr((toolchain, COMMON_FLAGS, STRICT_FLAGS, digest([source]))), make)


def _toolchain() -> Toolchain:
    command = find_compiler()
    identity = compiler_identity(command)
    # Compilers run in folders of ours: a relative path would not be found there.
    absolute = (os.path.abspath(shutil.which(command[0]) or command[0]), *command[1:])
    # The cache may be one for several machines with processors of one kind.
    return Toolchain((*absolute, *(["-mcpu=baseline"] if is_zig(command) else [])), identity)


def _engine_digest(pattern: str) -> str:
    folders = (*ENGINE_FOLDERS, *RUNS_FOLDERS)
    return digest(file for folder in folders for file in sorted(folder.glob(pattern)))


@contextmanager
def _folder(name: str) -> Iterator[Path]:
    with ScratchFolder() as scratch:
        folder = Path(scratch).resolve() / name
        folder.mkdir()
        yield folder


def _objects(sources: Sequence[Path], toolchain: Toolchain, folder: Path) -> list[str]:
    units = kept_units(sources, (*ENGINE_FOLDERS, *RUNS_FOLDERS), toolchain, folder)
    compile_units(units, folder)
    return [str(unit.file) for unit in units]


def _link(toolchain: Toolchain, inputs: Sequence[str], library: Path, purpose: str) -> None:
    # Apple's own linker has no such option.
    strip = ["-s"] if sys.platform != "darwin" or is_zig(toolchain.command) else []
    arguments = (*toolchain.command, "-shared", *strip, *inputs, "-lm", "-o", str(library))
    run_all([Task(arguments, library.parent, purpose)], library.parent)
