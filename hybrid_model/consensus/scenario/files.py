"""Scenario files: TOML in, checked scenario out; presets by name."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from hybrid_model.consensus.entries import Entries
from hybrid_model.consensus.messages import ScenarioError, shown
from hybrid_model.consensus.scenario.channel import IDEAL, Channel
from hybrid_model.consensus.scenario.definition import Network, Scenario, Weights, replace_trigger
from hybrid_model.consensus.scenario.own_trigger import read_own_trigger
from hybrid_model.consensus.scenario.read_network import KEYS as NETWORK_KEYS
from hybrid_model.consensus.scenario.read_network import read_network
from hybrid_model.consensus.scenario.read_switching import read_switching
from hybrid_model.consensus.scenario.sources import preset_names, scenario_source
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind, trigger_keys
from hybrid_model.consensus.switching.base import NoSwitching, Switching
from hybrid_model.consensus.weights.kinds import read_weights
from hybrid_model.declare.calls import explained

__all__ = ["load_scenario", "read_scenario", "scenario_entries"]

TOP_KEYS = ("name", "stop_time", "network", "weights", "switching", "trigger", "channel")
CHANNEL_KEYS = ("delay", "loss", "seed", "slots")
MOST_CHANGES = 1e7


@explained(ScenarioError)
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
    if not isinstance(name_or_path, (str, os.PathLike)):
        raise ScenarioError(f"load_scenario was given {shown(name_or_path)}: give the name of a preset, or a path.")
    other = _with_other_trigger(name_or_path)
    if other is not None:
        return replace(replace_trigger(load_scenario(other[0]), other[1]), name=os.fspath(name_or_path))
    source, entries, folder = scenario_source(name_or_path)
    try:
        return read_scenario(entries, folder)
    except ScenarioError as error:
        raise ScenarioError(f"{source}: {error}") from error


def scenario_entries(name_or_path: str | os.PathLike[str]) -> tuple[dict[str, Any], Path]:
    """Return the entries of a preset or a scenario file as parsed, and the folder that names of files count from.

    Parameters
    ----------
    name_or_path : str or path
        As in `load_scenario`; the kind of a trigger behind the name of a preset becomes its ``[trigger] kind``.

    Raises
    ------
    ScenarioError
        If there is no such preset or file, or it is not TOML.
    """
    other = _with_other_trigger(name_or_path)
    if other is not None:
        entries, folder = scenario_entries(other[0])
        trigger = {key: value for key, value in entries["trigger"].items() if key in trigger_keys(other[1])}
        if other[1] is TriggerKind.STATIC:
            trigger.pop("decay", None)
        trigger["kind"] = other[1].value
        return {**entries, "name": os.fspath(name_or_path), "trigger": trigger}, folder
    _, entries, folder = scenario_source(name_or_path)
    return entries, folder


def _with_other_trigger(name_or_path: str | os.PathLike[str]) -> tuple[str, TriggerKind] | None:
    """The preset and the trigger that a name such as ``paper-a-static`` stands for; None for other names."""
    name, names = os.fspath(name_or_path), preset_names()
    base, _, kind = name.rpartition("-")
    if base not in names or name in names or kind not in [member.value for member in TriggerKind]:
        return None
    return base, TriggerKind(kind)


@explained(ScenarioError)
def read_scenario(entries: Mapping[str, Any], folder: str | os.PathLike[str] = ".") -> Scenario:
    """Build a scenario from the parsed entries of a scenario file.

    Parameters
    ----------
    entries : Mapping
        The parsed entries.
    folder : str or path
        Where the names of files in them count from; `load_scenario` gives the folder of the scenario file.

    Raises
    ------
    ScenarioError
        If a key is unknown or missing, or a value has the wrong type or is out of range; the message names the entry.
    """
    top = Entries("the scenario", entries, TOP_KEYS)
    network = read_network(_subtable(top, "network", NETWORK_KEYS))
    edge_count = len(network.edges)
    scenario = Scenario(
        name=top.text("name"),
        stop_time=top.number("stop_time"),
        network=network,
        weights=Weights(read_weights(lambda known: _subtable(top, "weights", known), edge_count, Path(folder))),
        switching=_read_switching(top, network, top.number("stop_time")),
        trigger=_read_trigger(top, Path(folder)),
        channel=_read_channel(top),
    )
    require_affordable(scenario)
    return scenario


def require_affordable(scenario: Scenario) -> None:
    """Refuse a scenario whose run would have to stop more than `MOST_CHANGES` times, whatever its agents do.

    More than can be run is a slip.

    Raises
    ------
    ScenarioError
        Names the key that is to blame.
    """
    end, period = scenario.stop_time, scenario.trigger.period
    changes = [
        (f"[weights] of edge {number}:", *change)
        for number, wave in enumerate(scenario.weights.waveforms, start=1)
        for change in wave.changes(end)
    ]
    changes += [("[switching]", *change) for change in scenario.switching.changes(end)]
    changes += [("[trigger]", "period", end / period)] if period > 0 else []
    for table, key, count in changes:
        if count > MOST_CHANGES:
            raise ScenarioError(
                f"{table} {key} makes about {count:.1g} changes up to stop_time, {end:.6g} s; a run can have at most "
                f"{MOST_CHANGES:.0g}, so change {key} or stop_time."
            )


def _subtable(top: Entries, name: str, known: tuple[str, ...] | None) -> Entries:
    entries = top.raw(name, f"must be a table, written [{name}]")
    if not isinstance(entries, dict):
        raise top.error(name, entries, f"must be a table, written [{name}]")
    return Entries(f"[{name}]", entries, tuple(entries) if known is None else known)


def _read_switching(top: Entries, network: Network, stop_time: float) -> Switching:
    if "switching" not in top:
        return NoSwitching(len(network.edges))
    return read_switching(lambda known: _subtable(top, "switching", known), network, stop_time)


def _read_trigger(top: Entries, folder: Path) -> Trigger:
    # The kind decides which keys are known, so it is read from a table that accepts whatever is given.
    any_kind = _subtable(top, "trigger", None)
    if any_kind.target("kind") is not None:
        return read_own_trigger(any_kind, folder)
    kind = any_kind.choice("kind", TriggerKind)
    defaults = trigger_keys(kind)
    table = _subtable(top, "trigger", ("kind", *defaults))
    return Trigger(kind, **{key: table.number(key, default) for key, default in defaults.items()})


def _read_channel(top: Entries) -> Channel:
    if "channel" not in top:
        return IDEAL
    table = _subtable(top, "channel", CHANNEL_KEYS)
    return Channel(
        delay=table.number("delay", default=0.0),
        loss=table.number("loss", default=0.0),
        seed=table.whole_number("seed") if "seed" in table else IDEAL.seed,
        slots=table.whole_number("slots") if "slots" in table else IDEAL.slots,
    )
