"""One run on the engine in C, in this process: hybrid_model/engine/runs/exports.c, called by ctypes."""

from __future__ import annotations

import contextlib
import ctypes
import enum
import functools
from collections.abc import Iterator, Sequence

import numpy as np

from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.native.build.libraries import MODEL_SYMBOL, engine_library, model_library
from hybrid_model.record.row_flows import Rows
from hybrid_model.record.run_record import RunStatistics

_INTERFACE = 5
"""Of `run_interface` in exports.c."""

_KINDS = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER, Kind.OUTPUT)
"""In the order of the engine's banks."""
_OUTPUTS = 1
"""Of `run_evaluate` in exports.c."""


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


class Update(ctypes.Structure):
    """What one event iteration gave: `RunUpdate` in exports.c."""

    _fields_ = [("jump", ctypes.c_size_t), ("again", ctypes.c_int), ("over", ctypes.c_int), ("next", ctypes.c_double)]


class View(enum.IntEnum):
    """What is read: the start values, or the run as it is."""

    START = 1
    LIVE = 2


class Record(enum.IntEnum):
    """What is kept of a run."""

    NOTHING = 0
    JUMPS = 1
    ALL = 2


class Advance(enum.IntEnum):
    """How an advance ended."""

    REACHED = 0
    EVENT_AT_TARGET = 1
    EVENT_BEFORE = 2
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
        "run_place": (None, [engine, ctypes.c_void_p, number, number]),
        "run_begin": (ctypes.c_int, [engine, ctypes.c_int]),
        "run_update": (None, [engine, number, ctypes.c_int, ctypes.POINTER(Update)]),
        "run_step": (ctypes.c_int, [engine, number, ctypes.c_int]),
        "run_read": (ctypes.c_void_p, [engine, ctypes.c_int, ctypes.c_int]),
        "run_block_size": (size, [engine]),
        "run_save": (None, [engine, ctypes.c_void_p]),
        "run_restore": (None, [engine, ctypes.c_void_p]),
        "run_problem": (ctypes.c_char_p, [engine]),
        "run_rows": (ctypes.c_void_p, [engine, ctypes.c_int, count, count]),
        "run_statistics": (ctypes.POINTER(_Statistics), [engine]),
        "run_ending": (ctypes.c_int, [engine]),
        "run_shows_stiffness": (ctypes.c_int, [engine]),
        "run_can_be_stiff": (ctypes.c_int, [engine]),
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

    def outputs(self, tables: Sequence[FloatArray], width: int) -> FloatArray | None:
        """Return so many outputs at points, of whose t, x, z, u and p there is a row each; None where one fails."""
        run, found = NativeRun(self), np.empty((len(tables[0]), width))
        with _pointers(tables) as pointers:
            count = _engine().run_evaluate(run.address, _OUTPUTS, len(found), pointers, found.ctypes.data)
        return found if count == len(found) else None


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
        with _pointers(values) as pointers:
            return bool(self._library.run_start(self._engine, pointers, start, stop, record))

    def place(self, values: Sequence[FloatArray], start: float, stop: float) -> None:
        """Take values and the span of a run that is not recorded; `begin` begins it. See `start`."""
        with _pointers(values) as pointers:
            self._library.run_place(self._engine, pointers, start, stop)

    def begin(self, *, inside: bool) -> bool:
        """Begin a run that has been placed; False if it is over at once. `inside`: take the jumps that are due."""
        return bool(self._library.run_begin(self._engine, inside))

    def update(self, stop: float, *, predicts: bool) -> Update:
        """Take the jump that is due, if one is, and look ahead for the next event, at most to `stop` in s."""
        update = Update()
        self._library.run_update(self._engine, stop, predicts, ctypes.byref(update))
        return update

    def step(self, target: float, *, inside: bool) -> Advance:
        """Go on to the target, in s, or to the first event before it unless events are taken inside."""
        return Advance(self._library.run_step(self._engine, target, inside))

    def read(self, view: View, kind: Kind, index: int) -> float | None:
        """Return a scalar; None if it cannot be computed, then `problem` says why."""
        place = self._library.run_read(self._engine, view, _KINDS.index(kind))
        return None if not place else float(ctypes.c_double.from_address(place + 8 * index).value)

    def save(self) -> ctypes.Array[ctypes.c_char]:
        """Return all that evolves."""
        block = ctypes.create_string_buffer(self._library.run_block_size(self._engine))
        self._library.run_save(self._engine, block)
        return block

    def restore(self, block: ctypes.Array[ctypes.c_char]) -> None:
        """Return to what was saved."""
        self._library.run_restore(self._engine, block)

    @property
    def problem(self) -> str:
        """Why the last call that failed did so."""
        return str(self._library.run_problem(self._engine).decode())

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
    def can_be_stiff(self) -> bool:
        """Whether there is a method for the flow if it is stiff."""
        return bool(self._library.run_can_be_stiff(self._engine))

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

    @property
    def address(self) -> int:
        """Of the engine."""
        return int(self._engine)

    def recorded(self, states: int, discrete: int) -> Rows:
        """Return a copy of all that has been recorded of a run with so many states."""
        return Rows(self._rows(0), self._rows(1), states, discrete, self.model.jumps)

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


@contextlib.contextmanager
def _pointers(values: Sequence[FloatArray]) -> Iterator[ctypes.Array[ctypes.c_void_p]]:
    """Give the addresses of vectors for the time of a call."""
    vectors = [np.ascontiguousarray(value, dtype=np.float64) for value in values]
    yield (ctypes.c_void_p * len(vectors))(*(vector.ctypes.data for vector in vectors))


def _copied(place: int | None, shape: tuple[int, ...]) -> FloatArray:
    """Return the numbers that lie at an address."""
    numbers = np.empty(shape)
    if numbers.size and place:
        ctypes.memmove(numbers.ctypes.data, place, numbers.nbytes)
    return numbers
