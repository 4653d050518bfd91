"""Running a sweep: what is missing in its table is run in chunks, and rows are written as they come.

A worker may die at any time. What was under way is run again; a run that takes its worker along each time it is alone
is written down as failed, and the rest goes on.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from dataclasses import dataclass, field
from typing import Any

from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.executors import Crew, DaskCluster, Processes
from hybrid_model.consensus.sweeps.one_run import Row, run_points
from hybrid_model.consensus.sweeps.study import Study
from hybrid_model.consensus.sweeps.table import SweepTable

__all__ = ["run_sweep"]

_CHUNK_SECONDS = 0.5
"""What a chunk should take: long beside sending it, short beside what is lost with a worker."""
_MOST = 256
_LONE_ATTEMPTS = 2
"""So often a run is tried alone; then it is its fault that workers die."""

Progress = Callable[[int, int], None]
"""Called with the number of runs that are done, and of all."""


def run_sweep(
    study: Study,
    path: str | os.PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> SweepTable:
    """Run what is missing of a sweep.

    Parameters
    ----------
    study : Study
        What the sweep is.
    path : path
        The file of its table; one that is there already, of the same study, is gone on with.
    workers : int, optional
        Number of processes; default: as many as there are processors.
    scheduler : str, optional
        Address of a Dask scheduler that runs them instead.
    executor : Executor, optional
        Any other executor that runs them instead.
    progress : callable, optional
        Called with the number of runs done and of all, at the start and each time that rows were written.

    Returns
    -------
    SweepTable
        With a row for each run; close it, or use it in a ``with`` statement.

    Raises
    ------
    SweepError
        If the file is another, another process runs the sweep, or there is no such scheduler.
    """
    table = SweepTable(path, study)
    try:
        table.claim()
        missing = table.missing()
        if progress is not None:
            progress(len(study) - len(missing), len(study))
        if missing:
            crew = _crew(workers, scheduler, executor, len(missing))
            try:
                _Execution(table, crew, progress).run(missing)
            finally:
                if isinstance(crew, DaskCluster):
                    crew.close()
    except BaseException:
        table.close()
        raise
    return table


def _crew(workers: int | None, scheduler: str | None, executor: Executor | None, runs: int) -> Crew:
    if executor is not None:
        return _Given(executor)
    if scheduler is not None:
        return DaskCluster(scheduler)
    crew = Processes(workers or 0)
    return crew if crew.workers <= runs else Processes(runs)


@dataclass
class _Chunk:
    """Runs that are sent to a worker together.

    Attributes
    ----------
    runs : list of int
        Their numbers.
    attempts : int
        How often the worker of a single run has died.
    """

    runs: list[int]
    attempts: int = 0


@dataclass(eq=False)
class _Execution:
    table: SweepTable
    crew: Crew
    progress: Progress | None
    size: int = 1
    doubtful: deque[_Chunk] = field(default_factory=deque)
    """Single runs that were under way when a worker died: they are tried alone."""

    def run(self, missing: list[int]) -> None:
        """Run runs."""
        left = deque(missing)
        executor = self.crew.executor()
        under_way: dict[Future[Any], _Chunk] = {}
        try:
            while left or self.doubtful or under_way:
                try:
                    self._send(executor, left, under_way)
                    finished, _ = wait(under_way, return_when=FIRST_COMPLETED)
                    for future in finished:
                        self._take(future, under_way)
                except _Lost as lost:
                    # Nobody knows which of them it was.
                    self._suspect([lost.chunk, *under_way.values()])
                    under_way.clear()
                    self.crew.dismiss(executor)
                    executor = self.crew.executor()
        except BaseException:
            self.crew.dismiss(executor)
            raise
        self.crew.finish(executor)

    def _send(self, executor: Executor, left: deque[int], under_way: dict[Future[Any], _Chunk]) -> None:
        """Keep all workers busy; doubtful runs go one at a time, with nothing beside them."""
        study = self.table.study
        while (self.doubtful or left) and not any(chunk.attempts for chunk in under_way.values()):
            if self.doubtful:
                if under_way:
                    return
                chunk = self.doubtful.popleft()
            elif len(under_way) >= 2 * self.crew.workers:
                return
            else:
                chunk = _Chunk([left.popleft() for _ in range(min(self._share(left), len(left)))])
            try:
                future = executor.submit(run_points, study.frame, [study.values(run) for run in chunk.runs])
            except BrokenExecutor as error:
                raise _Lost(chunk) from error
            under_way[future] = chunk

    def _share(self, left: deque[int]) -> int:
        # Towards the end all workers have something to do.
        return max(1, min(self.size, len(left) // (2 * self.crew.workers)))

    def _take(self, future: Future[Any], under_way: dict[Future[Any], _Chunk]) -> None:
        """Write what a worker sends."""
        chunk = under_way.pop(future)
        try:
            rows, seconds = future.result()
        except (BrokenExecutor, CancelledError) as error:
            raise _Lost(chunk) from error
        except Exception as error:
            if self.crew.has_lost(error):
                raise _Lost(chunk) from error
            raise
        self._write(list(zip(chunk.runs, rows, strict=True)))
        each = seconds / len(rows)
        wanted = int(_CHUNK_SECONDS / each) if each > 0 else _MOST
        self.size = max(1, min(wanted, 4 * self.size, _MOST))

    def _suspect(self, chunks: list[_Chunk]) -> None:
        for chunk in chunks:
            attempts = chunk.attempts + 1
            if chunk.attempts and attempts > _LONE_ATTEMPTS:
                reason = f"its worker died each of the {_LONE_ATTEMPTS} times that it was run alone"
                self._write([(chunk.runs[0], {"failure": reason})])
            else:
                self.doubtful += [_Chunk([run], attempts) for run in chunk.runs]

    def _write(self, rows: list[tuple[int, Row]]) -> None:
        self.table.write(rows)
        if self.progress is not None:
            self.progress(len(self.table), len(self.table.study))


class _Lost(Exception):
    """A chunk did not come back."""

    def __init__(self, chunk: _Chunk) -> None:
        super().__init__()
        self.chunk = chunk


class _Given:
    """An executor of the caller's, of which there is one."""

    def __init__(self, executor: Executor) -> None:
        self._executor, self._is_new = executor, True

    @property
    def workers(self) -> int:
        """See `Crew.workers`."""
        return int(getattr(self._executor, "_max_workers", 1))

    def executor(self) -> Executor:
        """See `Crew.executor`."""
        if not self._is_new:
            raise SweepError(
                "the executor that was given has lost a worker and takes no more runs; rows that are done are in the "
                "table: give a new one, and the sweep goes on."
            )
        self._is_new = False
        return self._executor

    def dismiss(self, executor: Executor) -> None:
        """It is the caller's."""

    def finish(self, executor: Executor) -> None:
        """It is the caller's."""

    def has_lost(self, error: Exception) -> bool:
        """See `Crew.has_lost`."""
        return False
