"""One run on the engine in C, in this process: hybrid_model/engine/runs/exports.c, called by ctypes."""

from __future__ import annotations

import ctypes
import enum
import functools
from collections.abc import Sequence

import numpy as np

from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.native.build.libraries import MODEL_SYMBOL, engine_library, model_library
from hybrid_model.record.row_flows import Rows
from hybrid_model.record.run_record import RunStatistics

_INTERFACE = 3
"""Of `run_interface` in exports.c."""

_KINDS = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER)
"""In the order of the engine's banks."""


class Options(ctypes.Structure):
    """The engine's `EngineOptions` (hybrid_model/engine/engine.h)."""

    _fields_ = [
        (name, ctypes.c_double)
        for name in (
            *("relative_tolerance", "absolute_tolerance", "longest_step", "barrier", "event_tolerance"),
            *("jumps_at_once", "jumps_in_window", "spread", "window", "remainder", "most_jumps"),
            *("steps_at_once", "look_ahead_steps", "look_ahead_work", "pauses", "stiff"),
        )
    ]


_COUNTS = ("steps", "rejected", "evaluations", "jumps", "probes", "jacobians")


class _Statistics(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint64) for name in _COUNTS]


class Record(enum.IntEnum):
    """What is kept of a run."""

    NOTHING = 0
    JUMPS = 1
    ALL = 2


class Advance(enum.IntEnum):
    """How an advance ended."""

    REACHED = 0
    EVENT_AT_TARGET = 1
    ENDED = 3
    PAUSED = 4


class Ending(enum.IntEnum):
    """Why a run is over."""

    NOT = 0
    ZENO = 1
    BLOCKED = 2
    NOT_FINITE = 3
    FAILED = 4
    JUMPS = 5


@functools.cache
def _engine() -> ctypes.CDLL:
    """Return the engine, with the types of its functions."""
    library = ctypes.CDLL(str(engine_library()))
    engine, size, number = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double
    count = ctypes.POINTER(size)
    signatures: dict[str, tuple[object, list[object]]] = {
        "run_create": (engine, [ctypes.c_void_p]),
        "run_options": (ctypes.POINTER(Options), [engine]),
        "run_start": (ctypes.c_int, [engine, ctypes.c_void_p, number, number, ctypes.c_int]),
        "run_advance": (ctypes.c_int, [engine, number, ctypes.c_int]),
        "run_set": (None, [engine, ctypes.c_int, size, number]),
        "run_values": (ctypes.c_void_p, [engine, ctypes.c_int]),
        "run_rows": (ctypes.c_void_p, [engine, ctypes.c_int, count, count]),
        "run_statistics": (ctypes.POINTER(_Statistics), [engine]),
        "run_ending": (ctypes.c_int, [engine]),
        "run_shows_stiffness": (ctypes.c_int, [engine]),
        "run_time": (number, [engine]),
        "run_message": (ctypes.c_char_p, [engine]),
        "run_free": (None, [engine]),
        "run_evaluate": (size, [engine, ctypes.c_int, size, ctypes.c_void_p, ctypes.c_void_p]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    assert library.run_interface() == _INTERFACE
    return library


class NativeModel:
    """A model that is loaded into this process.

    Parameters
    ----------
    source : str
        Its C code, see `hybrid_model.native.model_code.run_code`.
    jumps : sequence of str
        Names of its jumps.
    stiff : bool
        Whether it has what a method for stiff flows needs.

    Raises
    ------
    BuildError
        If there is no compiler, or it fails.
    """

    def __init__(self, source: str, jumps: Sequence[str], *, stiff: bool) -> None:
        self.jumps, self.stiff = tuple(jumps), stiff
        self._library = ctypes.CDLL(str(model_library(source)))
        address = getattr(self._library, MODEL_SYMBOL)
        address.restype = ctypes.c_void_p
        self.pointer = address()
        _engine()


class NativeRun:
    """An engine that runs a model.

    Parameters
    ----------
    model : NativeModel
        What runs.

    Raises
    ------
    MemoryError
        If there is no memory for it.
    """

    def __init__(self, model: NativeModel) -> None:
        self.model, self._library = model, _engine()
        self._states = self._discrete = 0
        self._engine = self._library.run_create(model.pointer)
        if not self._engine:
            raise MemoryError("no memory for the engine of a run")
        self.options: Options = self._library.run_options(self._engine).contents

    def __del__(self) -> None:
        engine, self._engine = getattr(self, "_engine", None), None
        if engine:
            self._library.run_free(engine)

    def start(self, values: Sequence[FloatArray], start: float, stop: float, record: Record) -> bool:
        """Begin at `start`, in s; maps are not evaluated beyond `stop`. False if the run is over at once.

        Parameters
        ----------
        values : sequence of ndarray
            Continuous states, discrete states, inputs, parameters.
        """
        self._states, self._discrete = (len(value) for value in values[:2])
        vectors = [np.ascontiguousarray(value, dtype=np.float64) for value in values]
        pointers = (ctypes.c_void_p * len(vectors))(*(vector.ctypes.data for vector in vectors))
        return bool(self._library.run_start(self._engine, pointers, start, stop, record))

    def advance(self, target: float, *, take: bool = True) -> Advance:
        """Go on to the target, in s, and take the jumps that are due there unless inputs are to change first."""
        return Advance(self._library.run_advance(self._engine, target, take))

    def set(self, kind: Kind, index: int, value: float) -> None:
        """Set a scalar."""
        self._library.run_set(self._engine, _KINDS.index(kind), index, value)

    @property
    def time(self) -> float:
        """In s."""
        return float(self._library.run_time(self._engine))

    @property
    def shows_stiffness(self) -> bool:
        """Whether the steps of an explicit method have shown that the flow is stiff."""
        return bool(self._library.run_shows_stiffness(self._engine))

    @property
    def ending(self) -> Ending:
        """Why the run is over."""
        return Ending(self._library.run_ending(self._engine))

    @property
    def message(self) -> str:
        """The particulars."""
        return str(self._library.run_message(self._engine).decode())

    @property
    def statistics(self) -> RunStatistics:
        """What the run has cost so far."""
        found = self._library.run_statistics(self._engine).contents
        return RunStatistics(*(int(getattr(found, name)) for name in _COUNTS))

    def rows(self, *, events_only: bool) -> Rows:
        """Return a copy of what has been recorded: all, or the jumps alone."""
        jumps, names = self._rows(1), self.model.jumps
        if events_only:
            reached = _copied(self._library.run_values(self._engine, 0), (self._states,))
            return Rows.of_events(jumps, self.time, reached, self._discrete, names)
        return Rows(self._rows(0), jumps, self._states, self._discrete, names)

    def _rows(self, kind: int) -> FloatArray:
        count, width = ctypes.c_size_t(), ctypes.c_size_t()
        place = self._library.run_rows(self._engine, kind, ctypes.byref(count), ctypes.byref(width))
        return _copied(place, (count.value, width.value))


def _copied(place: int | None, shape: tuple[int, ...]) -> FloatArray:
    """Return the numbers that lie at an address."""
    numbers = np.empty(shape)
    if numbers.size and place:
        ctypes.memmove(numbers.ctypes.data, place, numbers.nbytes)
    return numbers
