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
from hybrid_model.errors import TraceError
from hybrid_model.native.driven import Driven
from hybrid_model.native.free_values.snapshots import Snapshot, current, why_untold
from hybrid_model.native.model_code import run_code
from hybrid_model.native.networks.network import NetworkTrace, trace_any
from hybrid_model.native.run import NativeModel
from hybrid_model.native.trace import Trace

MOST_MODELS = 256
"""So many are kept, those that were used last."""

MOST_DRIVEN = 16
"""With so many functions of time as inputs, one automaton has models that are kept."""

_of_snapshots: weakref.WeakKeyDictionary[Snapshot, dict[bytes, NativeModel]] = weakref.WeakKeyDictionary()
_by_key: OrderedDict[bytes, NativeModel] = OrderedDict()
_lock = threading.Lock()


def model_of(
    automaton: Automaton, check: Callable[[], None], *, stiff: bool = False, driven: Driven | None = None
) -> NativeModel:
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
    driven : Driven, optional
        Its inputs, where they follow functions of time.

    Raises
    ------
    TraceError
        If its maps cannot be traced, or those of a large network are to follow functions of time.
    BuildError
        If there is no compiler, or it fails.
    """
    taken, inputs = current(automaton), b"" if driven is None else driven.key
    known = None if taken is None else _of_snapshots.get(taken, {}).get(inputs)
    if known is not None and known.stiff >= stiff:
        return known
    check()
    model = None if taken is None else _recent(taken.key + inputs)
    if model is None or model.stiff < stiff:
        traced = traced_maps(automaton)
        if driven is not None:
            if isinstance(traced, NetworkTrace):
                raise TraceError("inputs of a large network follow functions of time in Python only.")
            traced = driven.driving(traced)
        model = made_model(automaton, traced, stiff=stiff)
    # Maps that change what they read by being called are traced again each time.
    if taken is not None and taken.still_holds():
        _keep(taken, inputs, model)
    return model


def what_ran(automaton: Automaton) -> str:
    """Return a sentence for a run on a compiled model: that it was, and why it is compiled anew each time if it is."""
    taken = current(automaton)
    if taken is None:
        return f"native: its maps are compiled, and traced anew for each run: {why_untold(automaton)}."
    if taken not in _of_snapshots:
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
        If they cannot be traced.
    DeclarationError
        For a slip in any map: in one, too, that the run may never call.
    """
    taken = current(automaton)
    if taken is not None and isinstance(taken.trace, Trace | NetworkTrace):
        return taken.trace
    return trace_any(automaton)


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


def _keep(taken: Snapshot, inputs: bytes, model: NativeModel) -> None:
    with _lock:
        models = _of_snapshots.setdefault(taken, {})
        if len(models) >= MOST_DRIVEN:
            models.clear()
        models[inputs] = model
        _by_key[taken.key + inputs] = model
        while len(_by_key) > MOST_MODELS:
            _by_key.popitem(last=False)
