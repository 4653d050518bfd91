"""What a user names as ``module:Name`` or ``file.py:Name``: found, imported, and told apart from what fails."""

from __future__ import annotations

import difflib
import importlib
import importlib.util
import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import ModuleType

from hybrid_model.errors import ImportFailedError, NamingError

__all__ = ["imports_from", "is_target", "named_object"]

_SOURCE = ".py"


def is_target(text: str) -> bool:
    """Whether a text has the form ``module:Name`` or ``file.py:Name``; that of a scenario file has not."""
    return ":" in text and Path(text).suffix != ".toml"


def named_object(target: str, folder: str | os.PathLike[str] = "") -> object:
    """Import what a user named.

    Importing runs the code of the module.

    Parameters
    ----------
    target : str
        ``module:Name``, or ``file.py:Name`` with the path of a file.
    folder : str or path
        Where the path of a file counts from; by default the current folder.

    Raises
    ------
    NamingError
        If there is no such module, file or name.
    ImportFailedError
        If the module is there and fails when it is imported.
    """
    module, _, name = target.rpartition(":")
    if not name or not module:
        form = f"{module}:ClassName" if module else "module:ClassName or file.py:ClassName"
        raise NamingError(f"{target} names no {'class' if module else 'module'}: write {form}.")
    if module.endswith(_SOURCE):
        module = os.path.normpath(os.path.join(folder, module))
    try:
        return getattr(_imported(module), name)
    except FileNotFoundError as error:
        if error.filename != module:
            raise _failed(module, error) from error
        raise NamingError(f"{target} cannot be found: there is no file {module}. Give file.py:ClassName.") from error
    except (AttributeError, ModuleNotFoundError, ValueError, TypeError) as error:
        # A module that is there may fail with the same errors.
        if not _is_about_the_target(error, module, name):
            raise _failed(module, error) from error
        there = _suggested(error, name)
        raise NamingError(f"{target} cannot be found: {error}. {there or 'Give module:ClassName.'}") from error
    except (Exception, SystemExit) as error:
        raise _failed(module, error) from error


def _suggested(error: Exception, name: str) -> str:
    """A sentence with the class that was meant, or all classes of the module."""
    module = error.obj if isinstance(error, AttributeError) else None
    own = getattr(module, "__name__", None)
    inside = [key for key, it in vars(module or object).items() if isinstance(it, type) and it.__module__ == own]
    names = [*inside, *getattr(module, "__all__", ())]
    near = difflib.get_close_matches(name, names, n=1)
    return f"Did you mean '{near[0]}'?" if near else f"Its classes: {', '.join(names[:10])}." if names else ""


@contextmanager
def imports_from(target: str) -> Iterator[None]:
    """Find modules in the current folder too, as ``python -m`` does, and beside a file that is named."""
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
    try:
        loader.exec_module(loaded)
    except BaseException:
        # As Python's own import: what is half made is not found by its name.
        del sys.modules[name]
        raise
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


def _failed(module: str, error: BaseException) -> ImportFailedError:
    frames = traceback.extract_tb(error.__traceback__)
    own = [
        frame for frame in frames if frame.filename not in (__file__, importlib.__file__) and "<" not in frame.filename
    ]
    place = f" ({own[0].filename}, line {own[0].lineno})" if own else ""
    more = f"python {module}" if module.endswith(_SOURCE) else f'python -c "import {module}"'
    return ImportFailedError(
        f"The module '{module}' cannot be imported, because it fails with {type(error).__name__}: {error}{place}. "
        f"Remedy: correct it; '{more}' shows more."
    )
