"""The fixed-step master: all slaves step together, signals travel at the communication points."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cosim.errors import CosimError
from cosim.masters.start import outputs, require_times, sample, sample_end, start_slaves
from cosim.result import CosimResult
from cosim.system import System


def run_fixed_step(
    system: System, t_stop: float, step: float, *, t_start: float = 0.0, record: Sequence[str] = ()
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
        Outputs, ``slave.output``, to keep at every communication point.

    Returns
    -------
    CosimResult
        Without ticks: clocks need event mode.

    Raises
    ------
    CosimError
        If a slave fails or the times make no sense.
    """
    require_times(t_start, t_stop, step, "communication step")
    if isinstance(record, (bool, str)):
        raise CosimError(f"record is {record!r}: give a list of outputs, for all of them system.output_names.")
    result = CosimResult(t=t_start)
    try:
        start_slaves(system, t_start, t_stop, events=False)
        sample(system, result, t_start, record)
        # Time by index: adding up steps would drift (rule 9).
        count = math.ceil((t_stop - t_start) / step * (1.0 - 1e-14))
        for k in range(count):
            t_next = t_stop if k == count - 1 else t_start + (k + 1) * step
            if not _step_all(system, result, t_next):
                sample_end(system, result, result.t, record)
                break
            sample(system, result, t_next, record)
        result.final = outputs(system)
    finally:
        system.close()
    return result


def _step_all(system: System, result: CosimResult, t_next: float) -> bool:
    for name, slave in system.slaves.items():
        made = slave.step(result.t, t_next)
        result.steps += 1
        if made.terminated:
            result.terminate(name, made.reached, made.terminated)
            return False
    result.t = t_next
    # Read everything before writing anything: the order of slaves must not matter.
    values = [system.slaves[c.source].get(c.output) for c in system.connections]
    for connection, value in zip(system.connections, values, strict=True):
        system.slaves[connection.target].set(connection.input, value)
    return True
