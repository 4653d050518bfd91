"""Scenario files: TOML in, checked scenario out; presets by name."""

import os
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

from hybrid_model.consensus.channel_data import IDEAL
from hybrid_model.consensus.scenario_data import (
    Channel,
    Network,
    Scenario,
    Trigger,
    TriggerKind,
    Underlying,
    WeightKind,
    Weights,
    replace_trigger,
)
from hybrid_model.consensus.switching import NoSwitching, PeriodicSwitching, Switching
from hybrid_model.consensus.tables import ScenarioError, Table, suggestion
from hybrid_model.consensus.trigger_data import trigger_keys
from hybrid_model.consensus.weights import ConstantWeight, GatedSine, Waveform, WeightMap

__all__ = [
    "Channel",
    "Network",
    "NoSwitching",
    "PeriodicSwitching",
    "Scenario",
    "ScenarioError",
    "Switching",
    "Trigger",
    "TriggerKind",
    "Underlying",
    "WeightKind",
    "Weights",
    "load_scenario",
    "preset_names",
    "read_scenario",
    "replace_trigger",
]

_PRESETS = resources.files("hybrid_model.consensus") / "presets"


def preset_names() -> tuple[str, ...]:
    """Names of the scenarios that come with the package, sorted."""
    return tuple(
        sorted(entry.name.removesuffix(".toml") for entry in _PRESETS.iterdir() if entry.name.endswith(".toml"))
    )


def load_scenario(name_or_path: str | os.PathLike[str]) -> Scenario:
    """Load a preset by its name or a scenario file by its path.

    Parameters
    ----------
    name_or_path : str or path
        The name of a preset (`preset_names`), also followed by ``-static`` or ``-dynamic`` for the same scenario with
        that trigger; or the path of a TOML file, recognised by its suffix or by a folder in front.

    Raises
    ------
    ScenarioError
        If there is no such preset or file, the file is not TOML, or it breaks a rule; the message names the entry.
    """
    name = os.fspath(name_or_path)
    if not isinstance(name_or_path, str) or name.endswith(".toml") or os.path.dirname(name):
        return _load_file(Path(name))
    names = preset_names()
    base, _, kind = name.rpartition("-")
    if name in names:
        return _parse(f"preset '{name}'", (_PRESETS / f"{name}.toml").read_bytes())
    if base in names and kind in [member.value for member in TriggerKind]:
        return replace(replace_trigger(load_scenario(base), kind), name=name)
    raise ScenarioError(
        f"there is no preset '{name}'.{suggestion(name, names)} Presets: {', '.join(names)}; "
        "a scenario file is given by a path that ends in .toml."
    )


def read_scenario(entries: Mapping[str, Any]) -> Scenario:
    """Build a scenario from the parsed entries of a scenario file.

    Raises
    ------
    ScenarioError
        If a key is unknown or missing, or a value has the wrong type or is out of range; the message names the entry.
    """
    top = Table("the scenario", entries, ("name", "stop_time", "network", "weights", "switching", "trigger", "channel"))
    network = _read_network(_subtable(top, "network", ("agents", "edges", "initial", "gain", "underlying")))
    edge_count = len(network.edges)
    return Scenario(
        name=top.text("name"),
        stop_time=top.number("stop_time"),
        network=network,
        weights=_read_weights(top, edge_count),
        switching=_read_switching(top, edge_count),
        trigger=_read_trigger(top),
        channel=_read_channel(top),
    )


def _load_file(path: Path) -> Scenario:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ScenarioError(f"the scenario file {path} cannot be read: {error.strerror}.") from error
    return _parse(f"the scenario file {path}", content)


def _parse(source: str, content: bytes) -> Scenario:
    try:
        entries = tomllib.loads(content.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise ScenarioError(f"{source} is not a text in UTF-8: byte {error.start} cannot be decoded.") from error
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{source} is not valid TOML: {error}.") from error
    try:
        return read_scenario(entries)
    except ScenarioError as error:
        raise ScenarioError(f"{source}: {error}") from error


def _subtable(top: Table, name: str, known: tuple[str, ...]) -> Table:
    entries = top.raw(name, f"must be a table, written [{name}]")
    if not isinstance(entries, dict):
        raise top.error(name, entries, f"must be a table, written [{name}]")
    return Table(f"[{name}]", entries, known)


def _read_network(table: Table) -> Network:
    edges = table.whole_number_lists("edges")
    for number, edge in enumerate(edges, start=1):
        if len(edge) != 2:
            raise table.error(f"edges[{number}]", list(edge), "must be a pair of agents, such as [1, 2]")
    return Network(
        agents=table.whole_number("agents"),
        edges=tuple((edge[0], edge[1]) for edge in edges),
        initial=table.numbers("initial"),
        gain=table.number("gain", default=1.0),
        underlying=table.choice("underlying", Underlying, default=Underlying.LISTED),
    )


def _read_weights(top: Table, edge_count: int) -> Weights:
    keys = {
        WeightKind.CONSTANT: ("kind", "value"),
        WeightKind.GATED_SINE: ("kind", "map", "gate_rate", "sine_rate", "duty_percent", "phase"),
    }
    # The kind decides which keys are known, so it is read from a table that accepts them all.
    any_kind = _subtable(top, "weights", tuple(dict.fromkeys(key for names in keys.values() for key in names)))
    kind = any_kind.choice("kind", WeightKind)
    table = _subtable(top, "weights", keys[kind])
    if kind is WeightKind.CONSTANT:
        return Weights(_each_edge(ConstantWeight, zip(table.per_edge("value", edge_count), strict=True)))
    weight_map = table.choice("map", WeightMap, default=WeightMap.SQUARE)
    columns = [table.per_edge(key, edge_count) for key in ("gate_rate", "sine_rate", "duty_percent")]
    phases = table.per_edge("phase", edge_count, default=0.0)
    return Weights(_each_edge(GatedSine, zip(*columns, phases, (weight_map,) * edge_count, strict=True)))


def _each_edge(waveform: Callable[..., Waveform], rows: "zip[Any]") -> tuple[Waveform, ...]:
    waveforms = []
    for number, row in enumerate(rows, start=1):
        try:
            waveforms.append(waveform(*row))
        except ValueError as error:
            raise ScenarioError(f"[weights] of edge {number}: {error}") from error
    return tuple(waveforms)


def _read_switching(top: Table, edge_count: int) -> Switching:
    if "switching" not in top:
        return NoSwitching(edge_count)
    table = _subtable(top, "switching", ("dwell", "active"))
    dwell, active = table.number("dwell"), table.whole_number_lists("active")
    try:
        return PeriodicSwitching(dwell, active, edge_count)
    except ValueError as error:
        raise ScenarioError(f"[switching] {error}") from error


def _read_trigger(top: Table) -> Trigger:
    keys = {kind: ("kind", *trigger_keys(kind)) for kind in TriggerKind}
    any_kind = _subtable(top, "trigger", tuple(dict.fromkeys(key for names in keys.values() for key in names)))
    kind = any_kind.choice("kind", TriggerKind)
    table = _subtable(top, "trigger", keys[kind])
    return Trigger(kind, **{key: table.number(key, default) for key, default in trigger_keys(kind).items()})


def _read_channel(top: Table) -> Channel:
    if "channel" not in top:
        return IDEAL
    table = _subtable(top, "channel", ("delay", "loss", "seed", "slots"))
    return Channel(
        delay=table.number("delay", default=0.0),
        loss=table.number("loss", default=0.0),
        seed=table.whole_number("seed") if "seed" in table else IDEAL.seed,
        slots=table.whole_number("slots") if "slots" in table else IDEAL.slots,
    )
