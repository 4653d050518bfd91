"""The libraries that a run in this process loads: the engine, and the maps of one model."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from hybrid_model.native.build.compiler import compiler_identity, find_compiler, is_zig
from hybrid_model.native.build.jobs import Task, run_all
from hybrid_model.native.build.kept_files import kept
from hybrid_model.native.build.objects import COMMON_FLAGS, GENERATED_FLAGS, digest, kept_objects
from hybrid_model.native.engine_files import ENGINE_FOLDERS

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
    command, identity = _toolchain()
    sources = [source for folder in ENGINE_FOLDERS for source in sorted(folder.glob("*.c"))]

    def make(library: Path) -> None:
        with tempfile.TemporaryDirectory(prefix="hybrid-fmu-") as name:
            scratch = Path(name).resolve()
            objects = kept_objects(sources, ENGINE_FOLDERS, (), command, identity, scratch)
            _link(command, [str(file) for file in objects.values()], library, scratch, "link the engine")

    return kept(f"engine{_SUFFIX}", repr((identity, COMMON_FLAGS, _engine_digest())), make)


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
    command, identity = _toolchain()
    loops = '#include "network.h"' in source

    def make(library: Path) -> None:
        with tempfile.TemporaryDirectory(prefix="hybrid-fmu-") as name:
            scratch = Path(name).resolve()
            (scratch / "model.c").write_text(source + _EXPORT, encoding="ascii")
            objects = (
                kept_objects(sorted(_NETWORKS.glob("*.c")), ENGINE_FOLDERS, (), command, identity, scratch)
                if loops
                else {}
            )
            # Compiled and linked by one call.
            flags = [*_MODEL_FLAGS, *(f"-I{folder}" for folder in ENGINE_FOLDERS)]
            inputs = [*flags, str(scratch / "model.c"), *(str(file) for file in objects.values())]
            _link(command, inputs, library, scratch, "compile the model")

    # Of the engine a model has the headers, and the loops if it is a network.
    basis = _engine_digest(sources=loops)
    return kept(f"model{_SUFFIX}", repr((identity, _MODEL_FLAGS, basis, _EXPORT, source)), make)


def _toolchain() -> tuple[list[str], str]:
    command = find_compiler()
    identity = compiler_identity(command)
    # Compilers run in folders of ours: a relative path would not be found there.
    absolute = [os.path.abspath(shutil.which(command[0]) or command[0]), *command[1:]]
    # The cache may be one for several machines with processors of one kind.
    return [*absolute, *(["-mcpu=baseline"] if is_zig(command) else [])], identity


def _engine_digest(*, sources: bool = True) -> str:
    return digest(file for folder in ENGINE_FOLDERS for file in sorted(folder.glob("*.[ch]" if sources else "*.h")))


def _link(command: Sequence[str], inputs: Sequence[str], library: Path, scratch: Path, purpose: str) -> None:
    strip = [] if sys.platform == "darwin" and not is_zig(command) else ["-s"]
    run_all([Task((*command, "-shared", *strip, *inputs, "-lm", "-o", str(library)), scratch, purpose)], scratch)
