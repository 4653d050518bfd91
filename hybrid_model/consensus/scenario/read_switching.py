"""Reading the table ``[switching]`` of a scenario file; docs/scenarios.md lists the keys of each kind."""

import enum
from collections.abc import Callable

from hybrid_model.consensus.entries import Entries
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Network
from hybrid_model.consensus.switching.base import Switching, validate_active
from hybrid_model.consensus.switching.cycle import SwitchingCycle
from hybrid_model.consensus.switching.random_sequences import (
    Order,
    jointly_connected_sequence,
    markov_sequence,
    random_dwell_sequence,
)
from hybrid_model.consensus.switching.sequence import SwitchingSequence

__all__ = ["SWITCHING_KEYS", "SwitchingKind", "read_switching"]


class SwitchingKind(enum.Enum):
    """The families of switching that a scenario file can name."""

    PERIODIC = "periodic"
    SEQUENCE = "sequence"
    RANDOM_DWELL = "random-dwell"
    MARKOV = "markov"
    JOINTLY_CONNECTED = "jointly-connected"


_DRAWN = ("shortest", "longest", "seed", "duration", "repeat")

SWITCHING_KEYS = {
    SwitchingKind.PERIODIC: ("kind", "dwell", "active"),
    SwitchingKind.SEQUENCE: ("kind", "dwell", "active", "repeat"),
    SwitchingKind.RANDOM_DWELL: ("kind", "active", "order", *_DRAWN),
    SwitchingKind.MARKOV: ("kind", "active", "transition", "first", *_DRAWN),
    SwitchingKind.JOINTLY_CONNECTED: ("kind", "window", "graphs", "spare", "seed", "duration", "repeat"),
}
"""The keys that each kind knows."""


def read_switching(make_table: Callable[[tuple[str, ...]], Entries], network: Network, stop_time: float) -> Switching:
    """Read the switching; without a kind it is periodic.

    Parameters
    ----------
    make_table : callable
        Makes the table from the keys that it may have.
    network : Network
        Whose edges switch.
    stop_time : float
        What a random sequence covers unless it is given a duration [s].

    Raises
    ------
    ScenarioError
        If a key is unknown or missing, or a value is of the wrong type or out of range; the message names it.
    """
    any_kind = make_table(tuple(dict.fromkeys(key for keys in SWITCHING_KEYS.values() for key in keys)))
    kind = any_kind.choice("kind", SwitchingKind, default=SwitchingKind.PERIODIC)
    table = make_table(SWITCHING_KEYS[kind])
    try:
        return _READERS[kind](table, network, stop_time)
    except ScenarioError:
        raise
    except ValueError as error:
        raise ScenarioError(f"[switching] {error}") from error


def _periodic(table: Entries, network: Network, stop_time: float) -> Switching:
    return SwitchingCycle(table.number("dwell"), _active(table, network), len(network.edges))


def _sequence(table: Entries, network: Network, stop_time: float) -> Switching:
    active = _active(table, network)
    dwells = table.per_item("dwell", len(active), "graphs in active")
    return SwitchingSequence(dwells, active, len(network.edges), table.flag("repeat", default=False))


def _random_dwell(table: Entries, network: Network, stop_time: float) -> Switching:
    return random_dwell_sequence(
        _active(table, network),
        len(network.edges),
        shortest=table.number("shortest"),
        longest=table.number("longest"),
        duration=_duration(table, stop_time),
        seed=table.whole_number("seed"),
        order=table.choice("order", Order, default=Order.CYCLIC),
        repeat=table.flag("repeat", default=False),
    )


def _markov(table: Entries, network: Network, stop_time: float) -> Switching:
    active = _active(table, network)
    shortest = table.number("shortest")
    return markov_sequence(
        active,
        len(network.edges),
        transition=table.rows("transition", len(active), of_what="graphs in active", shared=False),
        shortest=shortest,
        longest=table.number("longest", default=shortest),
        duration=_duration(table, stop_time),
        seed=table.whole_number("seed"),
        first=table.whole_number("first") if "first" in table else 1,
        repeat=table.flag("repeat", default=False),
    )


def _jointly_connected(table: Entries, network: Network, stop_time: float) -> Switching:
    return jointly_connected_sequence(
        network.agents,
        network.edges,
        window=table.number("window"),
        graphs=table.whole_number("graphs"),
        spare=table.number("spare", default=0.0),
        duration=_duration(table, stop_time),
        seed=table.whole_number("seed"),
        repeat=table.flag("repeat", default=False),
    )


def _active(table: Entries, network: Network) -> tuple[tuple[int, ...], ...]:
    """The graphs, checked before the lists that must be as long."""
    active = table.whole_number_lists("active")
    validate_active(active, len(network.edges))
    return active


def _duration(table: Entries, stop_time: float) -> float:
    duration = table.number("duration", default=stop_time)
    if duration < stop_time and not table.flag("repeat", default=False):
        raise table.error(
            "duration",
            duration,
            f"must be at least stop_time, {stop_time:.6g} s, unless the sequence has repeat = true",
        )
    return duration


_READERS: dict[SwitchingKind, Callable[[Entries, Network, float], Switching]] = {
    SwitchingKind.PERIODIC: _periodic,
    SwitchingKind.SEQUENCE: _sequence,
    SwitchingKind.RANDOM_DWELL: _random_dwell,
    SwitchingKind.MARKOV: _markov,
    SwitchingKind.JOINTLY_CONNECTED: _jointly_connected,
}
