"""Options of `hybrid-fmu export`."""

from __future__ import annotations

import argparse
import ast
from importlib.util import find_spec
from pathlib import Path

from cosim.cli.options.values import add_json, require_scenario, seconds
from cosim.errors import UsageError
from fmu.build.platforms import PLATFORMS
from fmu.describe.variables import Fmi

DESCRIPTION = "Write an automaton, or each agent of a scenario, as a native FMU. Prints the files written."
EXAMPLES = (
    "hybrid-fmu export ball.py:Ball --out fmus",
    "hybrid-fmu export paper-a --fmi 2.0 --platform all --out fmus",
    "hybrid-fmu export hybrid_model.models:BouncingBall --start-value e=0.5 --out fmus",
)
KINDS = ("cs", "me")
ALL = "all"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "target",
        metavar="TARGET",
        help="module:ClassName or file.py:ClassName, name of a preset, or path of a TOML file",
    )
    parser.add_argument(
        "--fmi",
        choices=[version.value for version in Fmi],
        default=Fmi.V3_0.value,
        help="version of the standard (default: %(default)s)",
    )
    parser.add_argument(
        "--kind",
        choices=KINDS,
        action="append",
        help="cs: co-simulation, me: model exchange; repeatable (default: both)",
    )
    parser.add_argument(
        "--platform",
        choices=[*PLATFORMS, ALL],
        action="append",
        help="where the FMU shall run; repeatable; others than this machine's, the default, need the package ziglang",
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the FMUs")
    parser.add_argument(
        "--stop-time", type=seconds, metavar="S", help="stop time in s that the FMU proposes (default: a scenario's)"
    )
    parser.add_argument(
        "--step-size", type=seconds, metavar="S", help="communication step in s that the FMU proposes (default: none)"
    )
    parser.add_argument(
        "--start-value",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="start value, parameter or length of a class's instance; repeatable",
    )
    parser.add_argument("--no-clocks", action="store_true", help="no clocks, for importers that know none (FMI 3.0)")
    add_json(parser, "the files written")


def require_named(options: argparse.Namespace) -> None:
    """Refuse what is neither a class nor a scenario."""
    target = options.target
    if Path(target).suffix.lower() == ".fmu":
        raise UsageError(f"{target} is an FMU already: 'hybrid-fmu cosim {target}' runs it.")
    if target.removesuffix(":").endswith(".py"):
        raise _no_class(target.removesuffix(":"))
    if ":" not in target or Path(target).suffix.lower() == ".toml":
        _require_no_class_meant(target)
        require_scenario(argparse.Namespace(scenario=target))


def _require_no_class_meant(target: str) -> None:
    """Refuse what is nearly a class: ``plant.Tank`` for ``plant.py:Tank``, ``plant``, or the name of a model."""
    if Path(target).exists() or not all(map(str.isidentifier, target.split("."))):
        return
    if Path(f"{target}.py").is_file():
        raise _no_class(f"{target}.py")
    module, _, name = target.removesuffix(".py").rpartition(".")
    if Path(f"{module.removesuffix('.py')}.py").is_file():
        raise UsageError(f"{target} is no scenario: for a class write {module.removesuffix('.py')}.py:{name}.")
    if module and find_spec(module.partition(".")[0]) is not None:
        if name[:1].islower():
            raise _no_class(target)
        raise UsageError(f"{target} is no scenario: for a class write {module}:{name}.")
    if target[:1].isupper():
        from hybrid_model import models

        if target in models.__all__:
            raise UsageError(f"{target} is no scenario: for the model write hybrid_model.models:{target}.")


def _no_class(module: str) -> UsageError:
    return UsageError(f"{module} names no class: write {module}:ClassName{_classes(Path(module))}.")


def _classes(file: Path) -> str:
    """The end of a sentence that names the classes that a file has, without running it."""
    try:
        body = ast.parse(file.read_bytes()).body
    except (OSError, ValueError, SyntaxError):
        return ""
    names = [node.name for node in body if isinstance(node, ast.ClassDef)]
    return f"; it has {', '.join(names)}" if names else ""
