"""A network run part by part on the engine in C: hybrid_model/engine/runs/parts_exports.c, called by ctypes."""

from __future__ import annotations

import ctypes
import enum
import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.native.build.libraries import engine_library
from hybrid_model.native.run import Ending, NativeModel, NativeRun, Options

_INTERFACE = 4
"""Of `parts_interface` in parts_exports.c."""
_BANKS = (Kind.STATE, Kind.DISCRETE, Kind.INPUT, Kind.PARAMETER, Kind.OUTPUT)
"""In the order of the engine's banks."""
NO_JUMP = 2**32 - 1
"""In the place of a jump's number: what a part sends has changed, or been sent for the first time, without a jump."""

Numbers = npt.NDArray[np.uint32]
Rows = npt.NDArray[np.uint64]


class NetworkAdvance(enum.IntEnum):
    """How far a network has come: on its way, at the target, or to its end."""

    GOING = 0
    REACHED = 1
    ENDED = 2
    REFUSED = 3
    STIFF = 4
    NOT_FINITE = 5


@dataclass(frozen=True, eq=False)
class PartGroup:
    """Parts with the same maps.

    Attributes
    ----------
    model : NativeModel
        Their maps.
    signals : tuple of (Kind, int)
        The scalars that leave them: discrete states and outputs, by their places in the vector of their kind.
    starts : tuple of ndarray, shapes (parts, size)
        Continuous states, discrete states, inputs and parameters of each part, one row a part.
    """

    model: NativeModel
    signals: tuple[tuple[Kind, int], ...]
    starts: tuple[FloatArray, FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class PartWires:
    """Wires between parts as compressed rows.

    Attributes
    ----------
    first : ndarray of uint64, shape (parts + 1,)
        Of the wires that leave part i, those from ``first[i]`` to ``first[i + 1] - 1``.
    signals, targets, inputs : ndarray of uint32, shape (wires,)
        Of each wire: which of its part's signals it carries, the part it goes to, and the place of the input there.
    """

    first: Rows
    signals: Numbers
    targets: Numbers
    inputs: Numbers


@dataclass(frozen=True, eq=False)
class EventColumns:
    """Events in the order in which they happened.

    Attributes
    ----------
    t : ndarray of float, shape (events,)
        Times in s.
    part, jump : ndarray of uint32, shape (events,)
        Numbers of the part and of its jump, or `NO_JUMP`.
    values : ndarray of float, shape (events, signals)
        What the part sends from then on; not a number behind its last signal.
    """

    t: FloatArray
    part: Numbers
    jump: Numbers
    values: FloatArray


@dataclass(frozen=True)
class NetworkEnd:
    """Why a network has ended: the part, how, the part's own ending, the time in s, and the particulars.

    For a value that is not finite these are the input that was sent it, by its place among the part's, and the value.
    """

    part: int
    how: NetworkAdvance
    ending: Ending
    t: float
    message: str
    input: int
    value: float


class _Events(ctypes.Structure):
    _fields_ = [
        ("count", ctypes.c_size_t),
        ("width", ctypes.c_size_t),
        *((name, ctypes.c_void_p) for name in ("times", "parts", "jumps", "values")),
    ]


class _End(ctypes.Structure):
    _fields_ = [
        ("part", ctypes.c_uint32),
        ("end", ctypes.c_int),
        ("ending", ctypes.c_int),
        ("t", ctypes.c_double),
        ("message", ctypes.c_char_p),
        ("input", ctypes.c_uint32),
        ("value", ctypes.c_double),
    ]


@functools.cache
def _library() -> ctypes.CDLL:
    """Return the engine, with the types of its functions."""
    library = ctypes.CDLL(str(engine_library()))
    network, size, number, pointer = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double, ctypes.c_void_p
    signatures: dict[str, tuple[object, list[object]]] = {
        "parts_create": (network, [size, pointer, pointer, pointer, size, pointer]),
        "parts_options": (ctypes.POINTER(Options), [network, size]),
        "parts_wires": (None, [network, pointer, pointer, pointer, pointer]),
        "parts_place": (None, [network, size, pointer]),
        "parts_start": (ctypes.c_int, [network, number, number, ctypes.c_int]),
        "parts_begin": (ctypes.c_int, [network]),
        "parts_adopt": (ctypes.c_int, [network, ctypes.c_uint32, pointer]),
        "parts_log_instants": (None, [network]),
        "parts_require_finite": (None, [network]),
        "parts_advance": (ctypes.c_int, [network, number, size]),
        "parts_approach": (ctypes.c_int, [network, number, size]),
        "parts_next_instant": (ctypes.c_int, [network, number]),
        "parts_handle": (ctypes.c_int, [network]),
        "parts_receive": (ctypes.c_int, [network, ctypes.c_uint32, ctypes.c_int, size, number]),
        "parts_look_until": (None, [network, ctypes.c_uint32, number]),
        "parts_peek": (pointer, [network, ctypes.c_uint32, ctypes.c_int]),
        "parts_problem": (ctypes.c_char_p, [network, ctypes.c_uint32]),
        "parts_next_event": (number, [network]),
        "parts_steps": (size, [network]),
        "parts_time": (number, [network]),
        "parts_take_events": (None, [network, ctypes.POINTER(_Events)]),
        "parts_end": (None, [network, ctypes.POINTER(_End)]),
        "parts_read": (None, [network, size, ctypes.c_int, pointer]),
        "parts_read_part": (None, [network, ctypes.c_uint32, ctypes.c_int, pointer]),
        "parts_memory": (size, [network]),
        "parts_free": (None, [network]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    assert library.parts_interface() == _INTERFACE
    return library


class NativeNetwork:
    """Parts that meet at events, run by the scheduler in C.

    Parameters
    ----------
    groups : sequence of PartGroup
        Parts with equal maps.
    group_of : ndarray of uint32, shape (parts,)
        The group of each part; the parts of a group are its rows in order. Their order is the order of simultaneous
        jumps.
    wires : PartWires
        Signals between them.

    Raises
    ------
    MemoryError
        If there is no memory for it.
    """

    def __init__(self, groups: Sequence[PartGroup], group_of: Numbers, wires: PartWires) -> None:
        self.groups, self._group_of, self._wires = tuple(groups), np.ascontiguousarray(group_of, np.uint32), wires
        models = (ctypes.c_void_p * max(1, len(groups)))(*(group.model.pointer for group in groups))
        counts = (ctypes.c_size_t * max(1, len(groups)))(*(len(group.signals) for group in groups))
        sent = [(_BANKS.index(kind), place) for group in groups for kind, place in group.signals]
        self._signals = np.array(sent, np.uint32).reshape(-1, 2)
        parts, signals = (self._group_of.ctypes.data, self._signals.ctypes.data)
        self._network = _library().parts_create(len(groups), models, counts, signals, len(group_of), parts)
        if not self._network:
            raise MemoryError(f"no memory for a network of {len(group_of)} parts")
        columns = (wires.first, wires.signals, wires.targets, wires.inputs)
        _library().parts_wires(self._network, *(column.ctypes.data for column in columns))

    def __del__(self) -> None:
        network, self._network = getattr(self, "_network", None), None
        if network:
            _library().parts_free(network)

    def options(self, group: int) -> Options:
        """Return the options of a group, to be set before the start."""
        found: Options = _library().parts_options(self._network, group).contents
        return found

    def set_options(self, group: int, options: Options) -> None:
        """Give a group the options of another run."""
        _library().parts_options(self._network, group)[0] = options

    def start(self, start: float, stop: float, *, computed: bool) -> bool:
        """Put all parts at `start`, with their start maps if `computed`; no map is evaluated beyond `stop`, in s."""
        for k, group in enumerate(self.groups):
            rows = [np.ascontiguousarray(values, dtype=np.float64) for values in group.starts]
            pointers = (ctypes.c_void_p * len(rows))(*(row.ctypes.data for row in rows))
            _library().parts_place(self._network, k, pointers)
        return bool(_library().parts_start(self._network, start, stop, computed))

    def begin(self) -> bool:
        """Take what is due at the start; False if the run is over at once."""
        return bool(_library().parts_begin(self._network))

    def adopt(self, part: int, run: NativeRun) -> None:
        """Have a part go on from where a run of the same model is that has begun; `handle` begins with it."""
        if not _library().parts_adopt(self._network, part, run.address):
            raise ValueError(f"part {part} of the network has another model than the run that it is to go on from")

    def log_instants(self) -> None:
        """Keep of each event the time of its instant, which all that jump there share, and not what is sent.

        In the place of the values of an event is whether it is the one that its part had come to that instant for.
        """
        _library().parts_log_instants(self._network)

    def require_finite(self) -> None:
        """Have the run end where a part is sent a value that is not finite."""
        _library().parts_require_finite(self._network)

    def advance(self, target: float, events: int) -> NetworkAdvance:
        """Go on to the target, in s, or come back earlier after about so many events."""
        return NetworkAdvance(_library().parts_advance(self._network, target, events))

    def approach(self, target: float, events: int) -> NetworkAdvance:
        """Do the same, but leave what is due at the target to `handle`, and do not bring all parts there."""
        return NetworkAdvance(_library().parts_approach(self._network, target, events))

    def next_instant(self, limit: float) -> NetworkAdvance:
        """Go to the next instant with events, at most to `limit` in s, and leave them to `handle`; REACHED: none."""
        return NetworkAdvance(_library().parts_next_instant(self._network, limit))

    def handle(self) -> bool:
        """Let happen what is due now; False if the run is over."""
        return bool(_library().parts_handle(self._network))

    def receive(self, part: int, kind: Kind, index: int, value: float) -> bool:
        """Give a part a value now, for `handle` to follow from; False if the run is over."""
        return bool(_library().parts_receive(self._network, part, _BANKS.index(kind), index, value))

    def look_until(self, part: int, time: float) -> None:
        """Say when a part is given something: it does not look beyond that time, in s."""
        _library().parts_look_until(self._network, part, time)

    def peek(self, part: int, kind: Kind, index: int) -> float | None:
        """Return a scalar of a part as it is now; None if it cannot be computed, then `problem` says why."""
        place = _library().parts_peek(self._network, part, _BANKS.index(kind))
        return None if not place else float(ctypes.c_double.from_address(place + 8 * index).value)

    def problem(self, part: int) -> str:
        """Why a value of a part could not be computed."""
        return str(_library().parts_problem(self._network, part).decode())

    @property
    def next_event(self) -> float:
        """In s: nothing happens before; infinite if nothing is foreseen."""
        return float(_library().parts_next_event(self._network))

    @property
    def steps(self) -> int:
        """Steps that all parts have made."""
        return int(_library().parts_steps(self._network))

    @property
    def time(self) -> float:
        """In s: all events up to it have happened."""
        return float(_library().parts_time(self._network))

    @property
    def memory(self) -> int:
        """Bytes of the parts and the queue."""
        return int(_library().parts_memory(self._network))

    def take_events(self) -> EventColumns:
        """Return the events since they were taken last."""
        found = _Events()
        _library().parts_take_events(self._network, ctypes.byref(found))
        count, width = found.count, found.width
        columns = (np.empty(count), np.empty(count, np.uint32), np.empty(count, np.uint32), np.empty((count, width)))
        for column, place in zip(columns, (found.times, found.parts, found.jumps, found.values), strict=True):
            if column.nbytes:
                ctypes.memmove(column.ctypes.data, place, column.nbytes)
        return EventColumns(*columns)

    @property
    def end(self) -> NetworkEnd:
        """Why the run is over."""
        found = _End()
        _library().parts_end(self._network, ctypes.byref(found))
        how, ending = NetworkAdvance(found.end), Ending(found.ending)
        particulars = found.message.decode(), int(found.input), float(found.value)
        return NetworkEnd(int(found.part), how, ending, float(found.t), *particulars)

    def read(self, group: int, kind: Kind) -> FloatArray:
        """Return the vectors of a kind of all parts of a group as they are, shape (parts, size)."""
        bank = _BANKS.index(kind)
        values = np.empty(self.groups[group].starts[bank].shape)
        _library().parts_read(self._network, group, bank, values.ctypes.data)
        return values

    def read_part(self, part: int, kind: Kind) -> FloatArray:
        """Return the vector of a kind of a part as it is."""
        bank = _BANKS.index(kind)
        values = np.empty(self.groups[self._group_of[part]].starts[bank].shape[1])
        _library().parts_read_part(self._network, part, bank, values.ctypes.data)
        return values
