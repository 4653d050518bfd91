"""`hybrid-fmu export`: write FMUs."""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import math
import os
import re
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.machinery import ModuleSpec, SourceFileLoader
from pathlib import Path
from types import ModuleType

from cosim.cli.exits import Exit, UsageError, progress, start_values
from fmu.archives.checks import no_device
from fmu.archives.writing import check_target
from fmu.build.platforms import PLATFORMS
from fmu.describe.variables import Fmi
from fmu.errors import ExportError
from fmu.export import export_fmu
from hybrid_model import Automaton
from hybrid_model.declare.automaton import require_made

KINDS = ("cs", "me")
ALL = "all"
_SOURCE = ".py"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = "Write an automaton, or each agent of a scenario, as a native FMU. Prints the files written."
    parser.add_argument(
        "target",
        metavar="TARGET",
        help="module:ClassName or file.py:ClassName, name of a preset, or path of a TOML file",
    )
    parser.add_argument(
        "--fmi", choices=[version.value for version in Fmi], default=Fmi.V3_0.value, help="version of the standard"
    )
    parser.add_argument(
        "--kind",
        choices=KINDS,
        action="append",
        help="cs: co-simulation, me: model exchange; repeatable; default: both",
    )
    parser.add_argument(
        "--platform",
        choices=[*PLATFORMS, ALL],
        action="append",
        help="where the FMU shall run; repeatable; others than this machine's, the default, need the package ziglang",
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the FMUs")
    parser.add_argument(
        "--stop-time", type=_seconds, help="stop time in s that the FMU proposes; default: a scenario's"
    )
    parser.add_argument("--step-size", type=_seconds, help="communication step in s that the FMU proposes")
    parser.add_argument(
        "--start-value",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="start value, parameter or length of a class's instance; repeatable",
    )
    parser.add_argument("--no-clocks", action="store_true", help="no clocks, for importers that know none (FMI 3.0)")
    parser.set_defaults(run=run)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number of seconds above zero")
    return value


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    with _imports_from_here(options.target):
        stop_time, automata = _automata(options.target, start_values(options.start_value))
        files = {name: options.out / f"{_file_name(name)}.fmu" for name in automata}
        for file in files.values():
            check_target(file)
        for count, (name, automaton) in enumerate(automata.items(), 1):
            progress(f"exporting {name} ({count} of {len(automata)})")
            written = export_fmu(
                automaton,
                files[name],
                fmi=options.fmi,
                kinds=tuple(kind for kind in KINDS if kind in (options.kind or KINDS)),
                platforms=_platforms(options.platform),
                stop_time=stop_time if options.stop_time is None else options.stop_time,
                step_size=options.step_size,
                clocks=not options.no_clocks,
                progress=progress,
            )
            print(written)
    return Exit.DONE


def _platforms(names: list[str] | None) -> tuple[str, ...] | None:
    if names is None:
        return None
    return tuple(PLATFORMS) if ALL in names else tuple(name for name in PLATFORMS if name in names)


def _file_name(name: str) -> str:
    # The name of an automaton is free; that of a file must stay in the folder.
    return no_device(re.sub(r"[^\w.+-]", "_", name).lstrip(".") or "_")


def _automata(target: str, starts: dict[str, float]) -> tuple[float | None, dict[str, Automaton]]:
    module, colon, name = target.rpartition(":")
    if not colon or Path(target).suffix == ".toml":
        if starts:
            raise UsageError("--start-value goes with module:ClassName; a scenario has its values in its file.")
        # Of what a class of one's own does not need.
        from hybrid_model.consensus.laws.closed_loop import scenario_agents
        from hybrid_model.consensus.scenario.files import load_scenario

        scenario = load_scenario(target)
        return scenario.stop_time, dict(scenario_agents(scenario))
    found = _found(module, name, target)
    if isinstance(found, Automaton):
        if starts:
            raise UsageError(f"--start-value goes with a class, and {target} is an instance, which has its values.")
        return None, {found.name: found}
    if not (isinstance(found, type) and issubclass(found, Automaton)):
        raise UsageError(f"{target} is not an automaton class: derive it from hybrid_model.HybridAutomaton.")
    try:
        automaton = found(**starts)
    except TypeError as error:
        raise UsageError(f"{target} cannot be made with the start values given: {error}.") from error
    require_made(automaton)
    return None, {automaton.name: automaton}


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
def _imports_from_here(target: str) -> Iterator[None]:
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
