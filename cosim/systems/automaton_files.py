"""Automata by the name of their class, in modules and in files."""

from __future__ import annotations

import importlib
import importlib.util
import os
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

from cosim.errors import UsageError
from fmu.errors import ExportError
from hybrid_model import Automaton
from hybrid_model.declare.automaton import require_made

_SOURCE = ".py"


def find_automaton(target: str, starts: Mapping[str, Any]) -> Automaton:
    """Return an automaton.

    Parameters
    ----------
    target : str
        ``module:ClassName`` or ``file.py:ClassName``; instances as well.
    starts : mapping
        What the class is called with.

    Raises
    ------
    UsageError
        If there is none of that name, or it is no automaton.
    ExportError
        If its module fails when it is imported.
    """
    module, _, name = target.rpartition(":")
    found = _found(module, name, target)
    if isinstance(found, Automaton):
        if starts:
            raise UsageError(f"--start-value goes with a class, and {target} is an instance, which has its values.")
        return found
    if not (isinstance(found, type) and issubclass(found, Automaton)):
        raise UsageError(f"{target} is not an automaton class: derive it from hybrid_model.HybridAutomaton.")
    try:
        automaton = found(**starts)
    except TypeError as error:
        raise UsageError(f"{target} cannot be made with the start values given: {error}.") from error
    require_made(automaton)
    return automaton


def _found(module: str, name: str, target: str) -> object:
    try:
        return getattr(_imported(module), name)
    except FileNotFoundError as error:
        if error.filename != module:
            raise _failed(module, error) from error
        raise UsageError(f"{target} cannot be found: there is no file {module}. Give file.py:ClassName.") from error
    except (AttributeError, ModuleNotFoundError, ValueError, TypeError) as error:
        # A module that is there may fail with the same errors.
        if not _is_about_the_target(error, module, name):
            raise _failed(module, error) from error
        raise UsageError(f"{target} cannot be found: {error}. Give module:ClassName.") from error
    except (Exception, SystemExit) as error:
        raise _failed(module, error) from error


def _imported(module: str) -> ModuleType:
    """Import a module by its name, or from a file."""
    if not module.endswith(_SOURCE):
        return importlib.import_module(module)
    # A file may have the name of a module that is in use here.
    name = f"{Path(module).stem}{'_file' * (Path(module).stem in sys.modules)}"
    loader = SourceFileLoader(name, module)
    loaded = importlib.util.module_from_spec(ModuleSpec(name, loader, origin=module))
    # Dataclasses look their module up by its name.
    sys.modules[name] = loaded
    loader.exec_module(loaded)
    return loaded


def _is_about_the_target(error: Exception, module: str, name: str) -> bool:
    if isinstance(error, ModuleNotFoundError):
        return f"{module}.".startswith(f"{error.name}.")
    if isinstance(error, AttributeError):
        return error.name == name and isinstance(error.obj, ModuleType) and _is_file_or_name(error.obj, module)
    return not module or module.startswith(".")


def _is_file_or_name(found: ModuleType, module: str) -> bool:
    """Whether a module is the one that was asked for, by its name or by its file."""
    return module == (found.__spec__.origin if found.__spec__ and module.endswith(_SOURCE) else found.__name__)


def _failed(module: str, error: BaseException) -> ExportError:
    frames = traceback.extract_tb(error.__traceback__)
    own = [
        frame for frame in frames if frame.filename not in (__file__, importlib.__file__) and "<" not in frame.filename
    ]
    place = f" ({own[0].filename}, line {own[0].lineno})" if own else ""
    more = f"python {module}" if module.endswith(_SOURCE) else f'python -c "import {module}"'
    return ExportError(
        f"The module '{module}' cannot be imported, because it fails with {type(error).__name__}: {error}{place}. "
        f"Remedy: correct it; '{more}' shows more."
    )


@contextmanager
def imports_from_here(target: str) -> Iterator[None]:
    """Find modules in the current folder too, as ``python -m`` does, and beside a file that is exported from."""
    module = target.rpartition(":")[0]
    folders = [os.getcwd(), *([str(Path(module).absolute().parent)] if module.endswith(_SOURCE) else [])]
    sys.path[:0] = folders
    importlib.invalidate_caches()
    try:
        yield
    finally:
        for folder in folders:
            if folder in sys.path:
                sys.path.remove(folder)
