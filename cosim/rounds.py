"""Rounds of calls to all Co-Simulation FMUs of a system, each made in C: a step of all, a reading of all."""

from __future__ import annotations

import ctypes as c
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from fmpy.fmi1 import FMICallException

from cosim.fmu_slave import FmuSlave
from cosim.instances.access import FmuReader
from cosim.slave import Slave
from fmu.importer.instance import Advance, BoundCall
from hybrid_model.errors import BuildError
from hybrid_model.native.build.libraries import source_library
from hybrid_model.schedule.blocks import Termination

Ending = tuple[int, float, Termination]
"""Which slave ended the run, when in s, and why."""
_SOURCE = Path(__file__).with_suffix(".c")


class _StepCall(c.Structure):
    _fields_ = (
        ("function", c.c_void_p),
        ("component", c.c_void_p),
        ("reached", c.c_double),
        ("major", c.c_int32),
        ("status", c.c_int32),
        ("event", c.c_bool),
        ("terminate", c.c_bool),
        ("early", c.c_bool),
    )


class _GetCall(c.Structure):
    _fields_ = (
        ("function", c.c_void_p),
        ("component", c.c_void_p),
        ("references", c.c_void_p),
        ("count", c.c_size_t),
        ("values", c.c_void_p),
        ("length", c.c_size_t),
        ("major", c.c_int32),
        ("status", c.c_int32),
    )


def stepping_round(slaves: Sequence[Slave]) -> Callable[[float, float], Ending | None] | None:
    """Return what steps all slaves from one time to another, as if the `step` of each were called in turn.

    Parameters
    ----------
    slaves : sequence of Slave
        Started, and begun.

    Returns
    -------
    callable or None
        It takes the two times in s, and gives None, or how the run ended; slaves after the one that ended it have not
        been stepped. None if not all are FMUs in this process whose steps may have any length, or if there is no C
        compiler.
    """
    fmus = [slave for slave in slaves if isinstance(slave, FmuSlave) and slave.steps_by_one_call]
    library = _library() if len(fmus) == len(slaves) else None
    if library is None:
        return None
    instances = [fmu.load() for fmu in fmus]
    calls = (_StepCall * len(fmus))()
    for call, instance in zip(calls, instances, strict=True):
        call.function = instance.address(f"fmi{instance.major}DoStep")
        call.component, call.major = instance.fmu.component, instance.major
    said, count, step_all = [fmu.calls.messages for fmu in fmus], len(fmus), library.step_all

    def step(t: float, t_next: float) -> Ending | None:
        for messages in said:
            if messages:
                messages.clear()
        k = -1
        while (k := step_all(calls, k + 1, count, t, t_next - t)) < count:
            call = calls[k]
            told = Advance(call.reached, call.event, call.terminate, call.early)
            reached, _, terminated = fmus[k].answered(t, t_next, call.status, told)
            if terminated:
                return k, reached, terminated
        return None

    return step


def reading_round(readers: Sequence[Callable[[], list[Any]]]) -> Callable[[], list[Any]] | None:
    """Return what calls all readers, and gives what they give one after the other.

    None if they are not all of FMUs in this process, read anything but numbers, or if there is no C compiler.
    """
    of_fmus = [reader for reader in readers if isinstance(reader, FmuReader) and not reader.others]
    library = _library() if len(of_fmus) == len(readers) else None
    if library is None:
        return None
    owners = [(reader, bound) for reader in of_fmus for bound in reader.bound]
    calls = (_GetCall * len(owners))(*(_get_call(reader, bound) for reader, bound in owners))
    at = [place for reader in of_fmus for place in reader.at]
    said, count, get_all = [reader.calls.messages for reader in of_fmus], len(owners), library.get_all

    def read() -> list[Any]:
        for messages in said:
            if messages:
                messages.clear()
        if (k := get_all(calls, count)) < count:
            reader, bound = owners[k]
            reader.calls.answer(_refuse, bound.name, calls[k].status)
        return [values[k] for values, k in at]

    return read


def _get_call(reader: FmuReader, bound: BoundCall) -> _GetCall:
    instance = reader.access.instance
    return _GetCall(
        instance.address(bound.name),
        instance.fmu.component,
        c.addressof(bound.references),
        len(bound.references),
        c.addressof(bound.values),
        len(bound.values),
        instance.major,
    )


def _refuse(name: str, status: int) -> None:
    raise FMICallException(function=name, status=status)


@cache
def _library() -> Any:
    """Return the two functions; None without a compiler."""
    try:
        library = c.CDLL(str(source_library(_SOURCE)))
    except BuildError:
        return None
    library.step_all.argtypes = c.POINTER(_StepCall), c.c_size_t, c.c_size_t, c.c_double, c.c_double
    library.get_all.argtypes = c.POINTER(_GetCall), c.c_size_t
    library.step_all.restype = library.get_all.restype = c.c_size_t
    return library
