"""The fixed-step master: all slaves step together, signals travel at the communication points."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from cosim.errors import CosimError, TimesError
from cosim.masters.changes import Changes, Given
from cosim.masters.loops import Settling
from cosim.masters.start import INTERVAL, STEP, outputs, require_times, sample_end, start_slaves
from cosim.masters.treatments import by_fixed_steps
from cosim.result import CosimResult, Ended, Watch
from cosim.rounds import Ending, stepping_round
from cosim.system import System, require_system
from hybrid_model.declare.calls import explained

ORDERS = ("jacobi", "gauss-seidel")
ROUNDING = 1e-9
"""Relative rounding of a number of steps."""
SLIVER = 1e-9
"""Part of a step that is too short for a step of its own: by so much a change may be before a communication point."""


@explained(CosimError)
def run_fixed_step(
    system: System,
    t_stop: float,
    step: float,
    *,
    t_start: float = 0.0,
    record: Sequence[str] = (),
    output_interval: float | None = None,
    inputs: Mapping[str, Given] | None = None,
    watch: Watch | None = None,
    order: str = "jacobi",
) -> CosimResult:
    """Run a system with a fixed communication step; slaves handle their events inside.

    This is what most tools do. An event inside a step reaches the other slaves at the next communication point only.

    Parameters
    ----------
    system : System
        Slaves and connections.
    t_stop, t_start : float
        Times in s.
    step : float
        Communication step in s; the last one is shorter if it does not divide the run.
    record : sequence of str
        Outputs, ``slave.output``, to keep: before signals are exchanged, so as each slave gave them.
    output_interval : float, optional
        Keep them at multiples of this time in s, which is a multiple of the step, and at the end; default: at every
        communication point.
    inputs : mapping, optional
        ``"slave.variable"`` -> number or `hybrid_model.Signal`, for inputs that nothing drives and tunable parameters.
        A signal is asked at the start and at its breakpoints, which end a step where all slaves take steps of any
        length, and have two rows where they change outputs at once; else its values arrive at the next communication
        point. A `Curve` is asked at each communication point.
    watch : callable, optional
        Told of the run after each row; see `CosimResult.watch`.
    order : {"jacobi", "gauss-seidel"}
        Whether all slaves step with the signals of the last communication point, or each with what those before it in
        the system have come to in this step. In a system with `loop_iterations` signals then go round loops until they
        settle, with the inputs from outside of that time, before they are kept.

    Returns
    -------
    CosimResult
        Without ticks: clocks need event mode.

    Raises
    ------
    CosimError
        If a slave fails.
    TimesError
        If the times make no sense, or the last step is shorter, and a slave takes steps of one length only.
    MisfitError
        If a name of `inputs` cannot be set.
    """
    require_system("run_fixed_step", system)
    require_times(t_start, t_stop, step, STEP)
    require_times(t_start, t_stop, output_interval, INTERVAL)
    if isinstance(record, (bool, str)):
        raise CosimError(f"record is {record!r}: give a list of outputs, for all of them system.output_names.")
    count = math.ceil((t_stop - t_start) / step * (1.0 - 1e-14))
    _require_constant(system, t_stop - t_start, count, step)
    every = 1 if output_interval is None else _steps_between(output_interval, step)
    changes = Changes(system, inputs or {}, t_start)
    if order not in ORDERS:
        raise CosimError(f"the order is {order!r}: give one of {', '.join(ORDERS)}.")
    alone = not system.connections
    treatment = {slave.name: by_fixed_steps(slave, step, alone=alone) for slave in system.slaves.values()}
    result = CosimResult(t=t_start, watch=watch, treatment=treatment)
    try:
        start_slaves(system, t_start, t_stop, events=False, changes=changes)
        points = _Points(system, record)
        result.keep(t_start, record, points.read())
        step_all = _stepping(system, hand_on=order == "gauss-seidel")
        split = SLIVER * step if all(slave.variable_step for slave in system.slaves.values()) else math.inf
        # Time by index: adding up steps would drift (rule 9).
        for k in range(1, count + 1):
            grid = t_stop if k == count else t_start + k * step
            while (due := changes.next_time(grid)) is not None and due < grid - split and step_all(result, due):
                _change(system, changes, points, result)
            if result.ended is not Ended.HORIZON or not step_all(result, grid):
                sample_end(system, result, result.t, record)
                break
            keeps = k % every == 0 or k == count
            if due is not None:
                _change(system, changes, points, result)
            elif system.loop_iterations:
                changes.arrive(grid)
                points.keep(result, points.settle(grid), keeps)
            else:
                points.keep(result, points.read(), keeps)
                points.exchange()
                changes.arrive(grid)
        result.final = outputs(system)
    finally:
        system.close()
    return result


def _change(system: System, changes: Changes, points: _Points, result: CosimResult) -> None:
    """Take what changes from outside where the run is, and keep the rows before it and, if it shows, behind it."""
    t = result.t
    changes.follow(t, before=True)
    before = points.read()
    points.keep(result, before)
    if system.loop_iterations:
        changes.arrive(t)
        after = points.settle(t)
    else:
        points.exchange()
        changes.arrive(t)
        after = points.read()
        points.exchange()
    points.keep(result, after, after != before)


def _stepping(system: System, *, hand_on: bool) -> Callable[[CosimResult, float], bool]:
    """Return what steps all slaves to a time, and whether the run goes on."""
    slaves = list(system.slaves.values())
    in_one_round = None if hand_on else stepping_round(slaves)

    def by_turns(t: float, t_next: float) -> Ending | None:
        for k, slave in enumerate(slaves):
            reached, _, terminated = slave.step(t, t_next)
            if terminated:
                return k, reached, terminated
            if hand_on:
                for wire in system.from_slave(slave.name):
                    system.slaves[wire.target].set(wire.input, wire.carried(slave.get(wire.output)))
        return None

    step_slaves = in_one_round or by_turns

    def step_all(result: CosimResult, t_next: float) -> bool:
        ended = step_slaves(result.t, t_next)
        if ended is None:
            result.steps += len(slaves)
            result.t = t_next
            return True
        k, reached, terminated = ended
        result.steps += k + 1
        result.terminate(slaves[k].name, reached, terminated)
        return False

    return step_all


class _Points:
    """The signals of a system that has been started, at the communication points."""

    def __init__(self, system: System, record: Sequence[str]) -> None:
        self._system = system
        # One read for both: each costs a call of each FMU.
        self._read = system.reader([*record, *(f"{c.source}.{c.output}" for c in system.connections)])
        self._recorded, self._names = len(record), record
        self._inputs = [(system.slaves[c.target], c.input) for c in system.connections]
        self._converted = [(k, c.carried) for k, c in enumerate(system.connections) if c.converts]
        self._values: list[Any] = []
        self._sent: list[Any] = [None] * len(self._inputs)

    def read(self) -> list[Any]:
        """Read everything before anything is written, for the order of slaves must not matter; return the recorded."""
        values = self._read()
        if not self._inputs:
            return values
        self._values = values[self._recorded :]
        for k, carried in self._converted:
            self._values[k] = carried(self._values[k])
        return values[: self._recorded]

    def keep(self, result: CosimResult, recorded: list[Any], keeps: bool = True) -> None:
        """Append a row where the run is, if that is wished."""
        if keeps:
            result.keep(result.t, self._names, recorded)

    def settle(self, t: float) -> list[Any]:
        """Carry signals round loops at `t` in s until they stand; return the recorded, which solve the loops.

        Raises
        ------
        CosimError
            If they do not settle.
        """
        settling, recorded = Settling(self._system, self._system.connections, t), self.read()
        while True:
            self.exchange()
            recorded = self.read()
            if settling.is_done(self._sent, self._values):
                return recorded

    def exchange(self) -> None:
        """Write what was read to the inputs; one that holds its value already is left alone."""
        values = self._values
        if values == self._sent:  # as in a system without connections
            return
        for (slave, name), value, before in zip(self._inputs, values, self._sent, strict=True):
            if value != before:
                slave.set(name, value)
        self._sent = values


def _require_constant(system: System, length: float, count: int, step: float) -> None:
    """Refuse a shorter last step if a slave takes steps of one length only."""
    rigid = next((name for name, slave in system.slaves.items() if not slave.variable_step), None)
    if rigid is not None and abs(length - count * step) > ROUNDING * length:
        raise TimesError(
            f"{rigid} takes steps of one length only (canHandleVariableCommunicationStepSize is false), but a run of "
            f"{length:.9g} s is no multiple of {step:.9g} s: end it {(count - 1) * step:.9g} or {count * step:.9g} s "
            "after its start, or choose another step.",
            "stop_time",
            "step_size",
            "start_time",
        )


def _steps_between(interval: float, step: float) -> int:
    every = round(interval / step)
    if every < 1 or abs(every * step - interval) > ROUNDING * interval:
        raise TimesError(
            f"the output interval is {interval} s, which is no multiple of the communication step, {step} s: give one.",
            "output_interval",
            "step_size",
        )
    return every
