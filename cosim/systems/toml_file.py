"""Systems in TOML files."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from cosim.errors import MisfitError
from cosim.sources import Linear, Source
from cosim.systems.definition import AUTOMATON, FMU, MASTERS, Component, Experiment, SystemDefinition

_TABLES = ("name", "experiment", "components", "connections", "inputs")
_COMPONENT = (FMU, AUTOMATON, "start", "arguments", "interface")
INTERFACES = ("cs", "me")
LEAST_WHOLE, LARGEST_WHOLE = -(2**63), 2**64 - 1
"""Of the types of FMI."""


def is_system(path: str | Path) -> bool:
    """Return whether a TOML file describes a system; scenarios have no components."""
    try:
        return "components" in _document(path)
    except MisfitError:
        return False


def read_toml(path: str | Path) -> SystemDefinition:
    """Read a system.

    Paths in the file are relative to its folder. The form is in docs/cosimulation.md.

    Raises
    ------
    MisfitError
        If the file is not TOML, an entry is unknown, missing or of the wrong type; with the entry.
    """
    path, document = Path(path), _document(path)
    _require_known(path, "", document, _TABLES)
    folder = path.parent
    components = [_component(path, folder, name, entry) for name, entry in _table(path, document, "components").items()]
    if not components:
        raise MisfitError(f"{path} has no components: give [components.NAME] with fmu or automaton.")
    connections = {
        target: _source(path, target, source) for target, source in _table(path, document, "connections").items()
    }
    inputs = _table(path, document, "inputs")
    _require_known(path, "inputs.", inputs, ("file",))
    return SystemDefinition(
        _text(path, "name", document.get("name", path.stem)),
        components,
        connections,
        _inputs(path, inputs),
        _experiment(path, _table(path, document, "experiment")),
    )


def _document(path: str | Path) -> dict[str, Any]:
    try:
        return tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise MisfitError(f"{path} cannot be read as TOML: {error}") from error


def _source(path: Path, target: str, given: Any) -> Source:
    if isinstance(given, str) or (isinstance(given, list) and all(isinstance(s, str) for s in given)):
        return given
    numbers = {name: given[name] for name in ("factor", "offset") if name in given} if isinstance(given, dict) else {}
    if (
        isinstance(given, dict)
        and isinstance(given.get("from"), str)
        and len(given) == 1 + len(numbers)
        and all(_is_number(value) for value in numbers.values())
    ):
        factor, offset = (
            _finite(path, f"connections.{target!r}.{name}", numbers.get(name, default))
            for name, default in (("factor", 1.0), ("offset", 0.0))
        )
        return Linear(given["from"], factor, offset)
    raise MisfitError(
        f"{path}: connections.{target!r} is {given!r}: give the name of an output, a list of them, or "
        '{ from = "a.y", factor = 2.0, offset = 0.0 }. Names with points are quoted: "b.u" = "a.y".'
    )


def _component(path: Path, folder: Path, name: str, entry: Any) -> Component:
    where = f"components.{name}"
    if not name.strip():
        raise MisfitError(f"{path}: a component is called {name!r}: give it a name, which connections begin with.")
    if not isinstance(entry, dict):
        raise MisfitError(f"{path}: {where} is {entry!r}: give a table.")
    _require_known(path, f"{where}.", entry, _COMPONENT)
    kinds = [kind for kind in (FMU, AUTOMATON) if kind in entry]
    if len(kinds) != 1:
        raise MisfitError(
            f"{path}: {where} has {' and '.join(kinds) or 'neither fmu nor automaton'}: give one of them."
        )
    source = _text(path, f"{where}.{kinds[0]}", entry[kinds[0]])
    if kinds[0] == FMU or source.rpartition(":")[0].endswith(".py"):
        source = str(folder / source)
    interface = entry.get("interface")
    if interface is not None and interface not in INTERFACES:
        raise MisfitError(f"{path}: {where}.interface is {interface!r}: give one of {', '.join(INTERFACES)}.")
    if interface is not None and kinds[0] == AUTOMATON:
        raise MisfitError(
            f"{path}: {where}.interface is {interface!r}, and an automaton runs in this process without one: leave it "
            "out, or export the automaton and name its FMU."
        )
    if kinds[0] == FMU:
        _require_file(path, f"{where}.fmu", entry[FMU], Path(source))
    if kinds[0] == FMU and "arguments" in entry:
        raise MisfitError(f"{path}: {where}.arguments are for the class of an automaton: values of FMUs are in start.")
    start, arguments = (_table(path, entry, key, f"{where}.") for key in ("start", "arguments"))
    for variable, value in start.items():
        _require_value(path, f"{where}.start.{variable}", value)
    return Component(name, kinds[0], source, start, arguments, interface)


def _require_value(path: Path, where: str, value: Any) -> None:
    """Refuse what no variable holds; tables are the matter of those who know the variables."""
    for part in value if isinstance(value, list) else ():
        _require_value(path, where, part)
    if not isinstance(value, (bool, int, float, str, list, dict)):
        raise MisfitError(f"{path}: {where} is {value}: give a number, true or false, text, or a list of them.")
    if isinstance(value, int) and not LEAST_WHOLE <= value <= LARGEST_WHOLE:
        raise MisfitError(f"{path}: {where} is a whole number of more than 64 bits: give a smaller one.")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _finite(path: Path, where: str, value: int | float) -> float:
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise MisfitError(f"{path}: {where} is {number}: give a finite number.")
    return number


def _inputs(path: Path, table: Mapping[str, Any]) -> Path | None:
    if "file" not in table:
        return None
    file = path.parent / _text(path, "inputs.file", table["file"])
    _require_file(path, "inputs.file", table["file"], file)
    return file


def _require_file(path: Path, where: str, given: str, file: Path) -> None:
    if not file.is_file():
        raise MisfitError(
            f"{path}: {where} is {given!r}, and there is no such file: give its path, from the folder of this one."
        )


def _experiment(path: Path, entry: Mapping[str, Any]) -> Experiment:
    known = [field.name for field in fields(Experiment)]
    _require_known(path, "experiment.", entry, known)
    for name, value in entry.items():
        if name == "master" and value not in MASTERS:
            raise MisfitError(f"{path}: experiment.master is {value!r}: give one of {', '.join(MASTERS)}.")
        if name != "master" and not _is_number(value):
            raise MisfitError(f"{path}: experiment.{name} is {value!r}: give a number.")
    numbers: dict[str, Any] = {
        name: _finite(path, f"experiment.{name}", value) for name, value in entry.items() if name != "master"
    }
    for name in ("step_size", "output_interval"):
        if not numbers.get(name, 1.0) > 0.0:
            raise MisfitError(f"{path}: experiment.{name} is {numbers[name]:g}: give seconds, more than 0.")
    if not 0.0 < numbers.get("tolerance", 0.5) < 1.0:
        raise MisfitError(
            f"{path}: experiment.tolerance is {numbers['tolerance']:g}: give a number between 0 and 1, such as 1e-9."
        )
    experiment = Experiment(**numbers, master=entry.get("master"))
    if experiment.stop_time is not None and not experiment.stop_time > (experiment.start_time or 0.0):
        raise MisfitError(
            f"{path}: experiment.stop_time is {experiment.stop_time:g}, and the run starts at "
            f"{experiment.start_time or 0.0:g} s (experiment.start_time): give a stop after the start."
        )
    return experiment


def _table(path: Path, document: Mapping[str, Any], name: str, prefix: str = "") -> dict[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, dict):
        raise MisfitError(f"{path}: {prefix}{name} is {table!r}: give a table.")
    return table


def _text(path: Path, name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise MisfitError(f"{path}: {name} is {value!r}: give text.")
    return value


def _require_known(path: Path, prefix: str, table: Mapping[str, Any], known: Collection[str]) -> None:
    unknown = next((name for name in table if name not in known), None)
    if unknown is not None:
        near = get_close_matches(unknown, known, 1)
        hint = f" Did you mean {near[0]}?" if near else ""
        raise MisfitError(f"{path}: there is no entry {prefix}{unknown}; there are {', '.join(known)}.{hint}")
