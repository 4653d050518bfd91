"""Snapshots of what the maps of an automaton read besides their argument: whether a kept trace still holds."""

from __future__ import annotations

import weakref
from hashlib import blake2b

import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.variables import Variable
from hybrid_model.native.free_values.classes import KEPT
from hybrid_model.native.free_values.containers import content
from hybrid_model.native.free_values.objects import describe
from hybrid_model.native.free_values.reading import Reading, UntoldError


class Snapshot:
    """What the maps of an automaton read besides their argument, as it was when the snapshot was taken.

    It holds what was read, and so the automaton: `current` keeps it with that. The key holds nothing.

    Attributes
    ----------
    key : bytes
        Two automata with one key have maps that trace to the same expressions of their variables. Start values and
        values of parameters are not part of it, unless a map gets at them by the declarations.
    trace : object
        What was traced with it and is wanted again, if anything; it may hold the automaton.
    """

    def __init__(self, reading: Reading) -> None:
        self.trace: object = None
        self._watch = reading.watch
        text = repr(reading.records).encode("utf-8", "surrogatepass")
        self.key = blake2b(text, digest_size=20).digest()

    def still_holds(self) -> bool:
        """Whether nothing that was read has changed. In doubt it has: a new snapshot may have the same key."""
        return self._watch.still_holds()


class _Kept:
    """The snapshot that is left with an automaton; copies of the automaton in files and other processes have none."""

    def __init__(self, owner: weakref.ref[Automaton] | None = None) -> None:
        self.owner = owner
        self.snapshot: Snapshot | None = None

    def __reduce__(self) -> tuple[type[_Kept], tuple[()]]:
        return _Kept, ()


def snapshot(automaton: Automaton) -> Snapshot | None:
    """Take a snapshot of what the maps of an automaton read besides their argument.

    Parameters
    ----------
    automaton : Automaton
        Whose maps.

    Returns
    -------
    Snapshot or None
        None if it cannot be told what they read: then a trace is good for one run only.

    Notes
    -----
    Take it before the trace; if it does not hold after that, the maps change what they read, and the trace is good for
    one run only.
    """
    try:
        return Snapshot(_reading(automaton))
    except UntoldError:
        return None


def current(automaton: Automaton) -> Snapshot | None:
    """Return the snapshot left with an automaton if it still holds; otherwise take one, and leave it there.

    Parameters
    ----------
    automaton : Automaton
        Whose maps.

    Returns
    -------
    Snapshot or None
        As `snapshot`.
    """
    attributes = getattr(automaton, "__dict__", None)
    if not isinstance(attributes, dict):
        return snapshot(automaton)
    kept = attributes.get(KEPT)
    # A copy of an automaton has what was kept for the original.
    if not isinstance(kept, _Kept) or kept.owner is None or kept.owner() is not automaton:
        kept = attributes[KEPT] = _Kept(weakref.ref(automaton))
    if kept.snapshot is None or not kept.snapshot.still_holds():
        # The old one goes first, as it would hold on to what it has read.
        kept.snapshot = None
        kept.snapshot = snapshot(automaton)
    return kept.snapshot


def why_untold(automaton: Automaton) -> str | None:
    """Return why `snapshot` gives None for an automaton, as the end of a sentence; None if it gives a snapshot."""
    try:
        _reading(automaton)
    except UntoldError as reason:
        return str(reason)
    return None


def _reading(automaton: Automaton) -> Reading:
    reading = Reading()
    reading.records.append(reading.token(automaton))
    variables: list[Variable] = []
    while reading.open:
        value = reading.open.popleft()
        describe(reading, value)
        if type(value) is Variable:
            variables.append(value)
    if reading.start_values:
        for variable in variables:
            start = content(reading, np.asarray(variable.start))
            reading.record(reading.number(variable), variable.unit, variable.description, *start)
    reading.close()
    return reading
