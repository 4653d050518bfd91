"""The run of one part of a network made again from its events, for a record of its flows."""

from __future__ import annotations

import ctypes
import enum
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import SimulationError
from hybrid_model.native.build.libraries import engine_library
from hybrid_model.native.run import NativeRun, Record
from hybrid_model.record.row_flows import Rows


class Happening(enum.IntEnum):
    """What happened to a part: it jumped, received a value over a wire, or was given one at a time that was known."""

    JUMPED = 0
    RECEIVED = 1
    GIVEN_INPUT = 2
    GIVEN_PARAMETER = 3


EVENT = np.dtype([("t", np.float64), ("value", np.float64), ("number", np.uint32), ("kind", np.uint32)])
"""An event of a part: a jump with its number, or an input or a parameter with its number and the value that it got."""


def replayed(
    run: NativeRun,
    starts: Sequence[FloatArray],
    span: tuple[float, float],
    events: npt.NDArray[np.void],
) -> tuple[Rows, npt.NDArray[np.uint64]]:
    """Flow from event to event.

    Parameters
    ----------
    run : NativeRun
        Of the part's model, with the options of the network's run.
    starts : sequence of ndarray
        Continuous states, discrete states, inputs and parameters at the start.
    span : (float, float)
        Start and end in s.
    events : structured ndarray of `EVENT`
        In order.

    Returns
    -------
    Rows
        The flows and jumps, breakpoints included.
    ndarray of int
        How many jumps there were before each event.

    Raises
    ------
    SimulationError
        If a flow cannot be made again.
    """
    library = ctypes.CDLL(str(engine_library()))
    library.run_replay.restype = ctypes.c_size_t
    vectors = [np.ascontiguousarray(value, dtype=np.float64) for value in starts]
    pointers = (ctypes.c_void_p * len(vectors))(*(vector.ctypes.data for vector in vectors))
    before = np.zeros(len(events), np.uint64)
    engine = ctypes.c_void_p(run.address)
    start, end = (ctypes.c_double(t) for t in span)
    begun = library.run_replay_begin(engine, pointers, start, end, ctypes.c_int(Record.ALL))
    place = ctypes.c_void_p(events.ctypes.data), ctypes.c_void_p(before.ctypes.data)
    count = ctypes.c_size_t(len(events))
    if not begun or library.run_replay(engine, count, *place, end) <= len(events):
        raise SimulationError(f"the run of a part cannot be made again from its events: {run.problem}")
    return run.recorded(len(vectors[0]), len(vectors[1])), before
