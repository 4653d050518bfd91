"""C compilers: which one there is, and how to tell it from another."""

from __future__ import annotations

import functools
import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from hybrid_model.errors import BuildError

IMPORTANT_VARIABLES = (
    *("CPATH", "C_INCLUDE_PATH", "LIBRARY_PATH", "GCC_EXEC_PREFIX", "COMPILER_PATH"),
    *("SDKROOT", "DEVELOPER_DIR", "MACOSX_DEPLOYMENT_TARGET"),
)
"""Of the environment: what can change a compiler's results."""
_COMPILER_ITSELF = re.compile(r"(?:[\w.]+-)*(?:gcc|clang|zig)(?:-[\d.]+)?")
"""Names of programs that compile themselves; others, such as ccache and scripts, call somebody."""


def find_compiler() -> list[str]:
    """Find a C compiler for this machine.

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
    value = os.environ.get("CC", "").strip()
    # A path may hold blanks; otherwise they separate arguments.
    chosen = [value] if value and shutil.which(value) else value.split()
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
        return zig_compiler()
    raise BuildError(
        "No C compiler was found: neither CC nor cc, gcc, clang, nor the package ziglang. "
        "Remedy: install a C compiler (for example the package gcc of the system), or: pip install ziglang."
    )


def zig_compiler() -> list[str]:
    """Return the command of the C compiler that builds for all platforms.

    Raises
    ------
    BuildError
        If the package ziglang is not installed.
    """
    if importlib.util.find_spec("ziglang") is None:
        raise BuildError(
            "Building for other platforms than this machine's needs the package ziglang, which is not installed. "
            "Remedy: pip install 'hybrid-fmu[zig]', or: pip install ziglang."
        )
    return [sys.executable, "-m", "ziglang", "cc"]


def is_zig(command: Sequence[str]) -> bool:
    """Return whether a compiler's command is that of zig, which has a target for each platform."""
    return "cc" in command[1:] and any(part == "ziglang" or Path(part).stem == "zig" for part in command)


def compiler_identity(command: Sequence[str]) -> str:
    """Return a text that changes when a compiler does: its command, files, environment, and this kind of machine.

    A compiler that is called by another program, such as ccache or a script, is asked for its version as well, which
    takes some milliseconds.

    Raises
    ------
    BuildError
        If there is no such program, or it cannot be started.
    """
    program = shutil.which(command[0])
    if program is None:
        raise BuildError(
            f"There is no compiler '{command[0]}'. Remedy: check the environment variable CC or the command given."
        )
    called = [shutil.which(word) for word in (*command, "as", "ld") if not word.startswith("-")]
    called.append(_zig_program() if is_zig(command) else None)
    files = tuple(_file_identity(path) for path in called if path is not None)
    variables = tuple((name, os.environ.get(name, "")) for name in IMPORTANT_VARIABLES)
    version = b""
    if not is_zig(command) and (sys.platform == "darwin" or not _COMPILER_ITSELF.fullmatch(Path(files[0][0]).name)):
        # The compilers of macOS are chosen by a program in their place.
        version = _version(tuple(command), files, variables)
    return repr((tuple(command), sys.platform, platform.machine(), files, variables, version))


def _zig_program() -> str | None:
    spec = importlib.util.find_spec("ziglang")
    places = (spec.submodule_search_locations if spec else None) or []
    return next((str(file) for place in places for file in Path(place).glob("zig*") if file.is_file()), None)


def _file_identity(path: str) -> tuple[str, int, int]:
    status = os.stat(path)
    return os.path.realpath(path), status.st_size, status.st_mtime_ns


@functools.lru_cache(maxsize=64)
def _version(command: tuple[str, ...], *_changes: object) -> bytes:
    try:
        done = subprocess.run([*command, "--version"], capture_output=True, stdin=subprocess.DEVNULL, check=False)
    except OSError as error:
        raise not_started(command[0], error) from error
    return done.stdout


def not_started(program: str, error: OSError) -> BuildError:
    """Return the error to raise when a compiler cannot be started."""
    return BuildError(
        f"The compiler '{program}' could not be started: {error.strerror}. Remedy: check the environment variable CC."
    )
