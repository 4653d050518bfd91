"""Where scenarios come from: presets by name, TOML files by path. Imports little, so that slips are told at once."""

import os
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

from hybrid_model.consensus.entries import suggestion
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.trigger import TriggerKind

__all__ = ["preset_names", "scenario_source"]

_PRESETS = resources.files("hybrid_model.consensus.scenario") / "presets"


def preset_names() -> tuple[str, ...]:
    """Names of the scenarios that come with the package, sorted."""
    return tuple(
        sorted(entry.name.removesuffix(".toml") for entry in _PRESETS.iterdir() if entry.name.endswith(".toml"))
    )


def scenario_source(name_or_path: str | os.PathLike[str]) -> tuple[str, dict[str, Any], Path]:
    """What a scenario is read from, as messages call it; its entries; and the folder of its files."""
    name = os.fspath(name_or_path)
    if not isinstance(name_or_path, str) or name.endswith(".toml") or os.path.dirname(name):
        source = f"the scenario file {Path(name)}"
        return source, _parsed(source, _content(Path(name))), Path(name).parent
    if os.path.isdir(name):
        raise ScenarioError(f"{name} is a folder: give the path of a scenario file in it, which ends in .toml.")
    names = preset_names()
    if name in names:
        return f"preset '{name}'", _parsed(f"preset '{name}'", (_PRESETS / f"{name}.toml").read_bytes()), Path()
    # With the name of a trigger behind it a preset is another scenario.
    known = [*names, *(f"{preset}-{kind.value}" for preset in names for kind in TriggerKind)]
    raise ScenarioError(
        f"there is no preset '{name}'.{suggestion(name, known)} Presets: {', '.join(names)}; "
        "a scenario file is given by a path that ends in .toml."
    )


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        near = "" if path.exists() else suggestion(path.stem, [file.stem for file in path.parent.glob("*.toml")])
        raise ScenarioError(f"the scenario file {path} cannot be read: {error.strerror}.{near}") from error


def _parsed(source: str, content: bytes) -> dict[str, Any]:
    try:
        return tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{source} is not a text in UTF-8: byte {error.start} cannot be decoded.") from error
    except ValueError as error:
        # Of the parser, or of Python for an integer with thousands of digits.
        raise ScenarioError(f"{source} is not valid TOML: {str(error).partition(';')[0]}.") from error
    except RecursionError as error:
        raise ScenarioError(f"{source} is not valid TOML: its tables or lists are nested too deeply.") from error
