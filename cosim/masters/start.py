"""What all masters do alike: start the slaves, transfer start values, read outputs at the end."""

from __future__ import annotations

import contextlib
import gc
import math
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from cosim.errors import CosimError, TimesError
from cosim.feedthrough import in_order
from cosim.masters.changes import Changes
from cosim.masters.loops import Settling
from cosim.result import CosimResult
from cosim.system import Connection, System
from hybrid_model.declare.real_numbers import is_real

MOST_STEPS = 100_000_000
"""Most steps of one run."""
STEP, INTERVAL = "communication step", "output interval"
"""What messages call the lengths of a run that are chosen."""
GROWTH = 1.5
"""By so much what the process holds may grow from run to run before it is looked through for garbage."""


def require_times(t_start: float, t_stop: float, interval: float | None, what: str) -> None:
    """Refuse times that are not finite or not in order, and steps that are not positive, too short or too many.

    Raises
    ------
    CosimError
        If one is no number.
    TimesError
        With the value and the rule.
    """
    of = "step_size" if what == STEP else "output_interval"
    for value in (t_start, t_stop, 0.0 if interval is None else interval):
        if not is_real(value):
            raise CosimError(f"{value!r} is no time: give a number of seconds.")
    if not (math.isfinite(t_start) and math.isfinite(t_stop) and t_stop > t_start):
        raise TimesError(
            f"the run goes from {t_start} to {t_stop} s: give finite times, the stop after the start.",
            "stop_time",
            "start_time",
        )
    if interval is not None and not (math.isfinite(interval) and interval > 0):
        raise TimesError(f"the {what} is {interval} s: give a positive, finite number.", of)
    latest = max(abs(t_start), abs(t_stop))
    if interval is not None and interval < math.ulp(latest):
        raise TimesError(
            f"the {what} is {interval} s, but floating-point numbers lie {math.ulp(latest):.3g} s apart at t = "
            f"{latest:.9g} s: give a longer one.",
            of,
        )
    if interval is not None and (t_stop - t_start) / interval > MOST_STEPS:
        raise TimesError(
            f"a {what} of {interval} s makes {(t_stop - t_start) / interval:.3g} steps from {t_start:.9g} to "
            f"{t_stop:.9g} s, and at most {MOST_STEPS} are made: give a longer one.",
            of,
            "stop_time",
            "start_time",
        )


def start_slaves(
    system: System,
    t_start: float,
    t_stop: float,
    *,
    events: bool | None,
    changes: Changes,
    latest: Mapping[str, float] = MappingProxyType({}),
) -> None:
    """Bring all slaves through initialization mode: values from outside first, then those along the connections.

    Events are handled by the master or not; None: in event mode by the slaves that have it, and others may end their
    steps early. Some slaves are told a stop time in s that is later (`latest`).

    Raises
    ------
    CosimError
        If the start values do not settle: then they depend on each other in a loop.
    """
    for slave in system.slaves.values():
        wanted = slave.has_event_mode if events is None else events
        slave.start(t_start, latest.get(slave.name, t_stop), events=wanted, early=events is None and not wanted)
    changes.set_start_values()
    known: dict[tuple[str, str], float] = {}
    connections = in_order(system)
    settling, before = Settling(system, connections), list[Any]()
    while True:
        for connection in connections:
            transfer_start(system, connection, known)
        values = [known[_end(c)] for c in connections]
        if settling.is_done(before or [None] * len(values), values):
            break
        before = values
    for slave in system.slaves.values():
        slave.begin()


def transfer_start(system: System, connection: Connection, known: dict[tuple[str, str], float]) -> None:
    """Transfer one start value, if it is news to the input."""
    at = _end(connection)
    value = connection.carried(system.slaves[connection.source].get(connection.output))
    if at not in known or not system.settled(value, known[at]):
        known[at] = value
        system.slaves[connection.target].set(connection.input, value)


def _end(connection: Connection) -> tuple[str, str]:
    return connection.target, connection.input


def sample(system: System, result: CosimResult, t: float, names: Sequence[str]) -> None:
    """Append the named outputs at `t` to the result."""
    result.keep(t, names, [system.get(name) for name in names])


def sample_end(system: System, result: CosimResult, t: float, names: Sequence[str]) -> None:
    """Append the named outputs at `t`, where a slave ended the run, if it is news."""
    if not result.times or result.times[-1] < t:
        sample(system, result, t, names)


def sample_change(system: System, result: CosimResult, t: float, names: Sequence[str]) -> None:
    """Append the named outputs at `t` to the result, if the time or one of them is news."""
    if not result.times or result.times[-1] < t or any(result.signals[n][-1] != system.get(n) for n in names):
        sample(system, result, t, names)


def outputs(system: System) -> dict[str, float]:
    """Return all outputs by ``slave.output``."""
    return {name: system.get(name) for name in system.output_names}


class _Rest:
    """What the process holds besides a run."""

    looked_at = 0
    """How many objects there were after all of them had been looked at last, or at the first run."""


@contextlib.contextmanager
def apart_from_the_rest() -> Iterator[None]:
    """Spare what is there already from the collections of garbage that a run brings about.

    A full collection looks through all that the process holds, the descriptions of all FMUs among it, so an event
    would cost the more the larger its system. What the run makes itself is collected as always. What is thawed counts
    as old, which alone never brings about a full collection, so one follows the runs that have left much.
    """
    if gc.get_freeze_count():  # of somebody else, who is to thaw it
        yield
        return
    gc.freeze()
    try:
        yield
    finally:
        held = gc.get_freeze_count()
        gc.unfreeze()
        _Rest.looked_at = _Rest.looked_at or held
        if held > GROWTH * _Rest.looked_at and gc.isenabled():
            gc.collect()
            _Rest.looked_at = 0
