"""Compiled models that are used again: by the same automaton, and by others whose maps are the same.

What the maps read besides their argument is compared at each use (`hybrid_model.native.free_values`), so a global, an
attribute or an array that has changed meanwhile gives another model.
"""

from __future__ import annotations

import threading
import weakref
from collections import OrderedDict
from collections.abc import Callable

from hybrid_model.declare.automaton import Automaton
from hybrid_model.errors import DeclarationError, TraceError
from hybrid_model.native.free_values.snapshots import Snapshot, current, why_untold
from hybrid_model.native.model_code import run_code
from hybrid_model.native.networks.network import NetworkTrace, trace_any
from hybrid_model.native.run import NativeModel
from hybrid_model.native.trace import Trace

MOST_MODELS = 256
"""So many are kept, those that were used last."""

_of_snapshots: weakref.WeakKeyDictionary[Snapshot, NativeModel] = weakref.WeakKeyDictionary()
_by_key: OrderedDict[bytes, NativeModel] = OrderedDict()
_lock = threading.Lock()


def model_of(automaton: Automaton, check: Callable[[], None], *, stiff: bool = False) -> NativeModel:
    """Return the compiled model of an automaton.

    Parameters
    ----------
    automaton : Automaton
        Whose maps.
    check : callable
        Called where the automaton has not been run before, or its maps may have changed.
    stiff : bool
        Whether the model must have what a method for stiff flows needs; one that has it is kept in place of one that
        has not.

    Raises
    ------
    TraceError
        If its maps cannot be traced.
    BuildError
        If there is no compiler, or it fails.
    """
    taken = current(automaton)
    known = None if taken is None else _of_snapshots.get(taken)
    if known is not None and known.stiff >= stiff:
        return known
    check()
    model = None if taken is None else _recent(taken.key)
    if model is None or model.stiff < stiff:
        model = made_model(automaton, traced_maps(automaton), stiff=stiff)
    # Maps that change what they read by being called are traced again each time.
    if taken is not None and taken.still_holds():
        _keep(taken, model)
    return model


def what_ran(automaton: Automaton) -> str:
    """Return a sentence for a run on a compiled model: that it was, and why it is compiled anew each time if it is."""
    taken = current(automaton)
    if taken is None:
        return f"native: its maps are compiled, and traced anew for each run: {why_untold(automaton)}."
    if _of_snapshots.get(taken) is None:
        return "native: its maps are compiled, and traced anew for each run: they change what they read."
    return "native: its maps are compiled."


def made_model(automaton: Automaton, traced: Trace | NetworkTrace, *, stiff: bool) -> NativeModel:
    """Compile traced maps of an automaton."""
    stiff = stiff or automaton.stiff is True
    source = run_code(traced, jacobian=stiff)
    return NativeModel(source, [info.name for info in automaton.jumps], stiff=stiff)


def traced_maps(automaton: Automaton) -> Trace | NetworkTrace:
    """Return the maps of an automaton that has been checked.

    Raises
    ------
    TraceError
        If they cannot be traced; also for a slip in a map that the run may never call.
    """
    taken = current(automaton)
    if taken is not None and isinstance(taken.trace, Trace | NetworkTrace):
        return taken.trace
    try:
        return trace_any(automaton)
    except DeclarationError as error:
        raise TraceError(str(error)) from error


def kept_trace(automaton: Automaton) -> Trace | NetworkTrace:
    """Return the traced maps of an automaton, see `trace_any`, and leave them with it: a run needs no others then."""
    taken = current(automaton)
    traced = trace_any(automaton)
    if taken is not None and taken.still_holds():
        taken.trace = traced
    return traced


def _recent(key: bytes) -> NativeModel | None:
    with _lock:
        if key in _by_key:
            _by_key.move_to_end(key)
        return _by_key.get(key)


def _keep(taken: Snapshot, model: NativeModel) -> None:
    with _lock:
        _of_snapshots[taken] = model
        _by_key[taken.key] = model
        while len(_by_key) > MOST_MODELS:
            _by_key.popitem(last=False)
