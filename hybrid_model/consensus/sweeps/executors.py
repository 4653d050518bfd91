"""What executes a sweep: processes of this machine, or a Dask cluster; both as a `concurrent.futures.Executor`."""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
import threading
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any, Protocol

from hybrid_model.consensus.sweeps.errors import SweepError

__all__ = ["Crew", "DaskCluster", "Processes"]

_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Matrices of a few rows are slower on many threads, and may be rounded in another way."""


class Crew(Protocol):
    """What makes executors: anew after a worker's death has broken one."""

    @property
    def workers(self) -> int:
        """How many runs go on at once."""

    def executor(self) -> Executor:
        """Return a new executor."""

    def dismiss(self, executor: Executor) -> None:
        """End an executor at once, and what it does."""

    def finish(self, executor: Executor) -> None:
        """End an executor that has nothing to do."""

    def has_lost(self, error: Exception) -> bool:
        """Whether an error that a run came back with says that its worker was lost."""


@dataclass(frozen=True)
class Processes:
    """Processes of this machine.

    Attributes
    ----------
    workers : int
        How many; default: as many as there are processors for this process.
    """

    workers: int = 0

    def __post_init__(self) -> None:
        """Count the processors."""
        if self.workers < 0:
            raise SweepError(f"workers is {self.workers}; give a number of processes, or leave it out.")
        if self.workers == 0:
            available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
            object.__setattr__(self, "workers", available)

    def executor(self) -> Executor:
        """See `Crew.executor`."""
        for name in _ONE_THREAD:
            os.environ.setdefault(name, "1")
        # Not forked: a copy of this process would have its locks, but not its threads.
        context = multiprocessing.get_context("spawn")
        return ProcessPoolExecutor(self.workers, mp_context=context, initializer=_begin_worker)

    def dismiss(self, executor: Executor) -> None:
        """See `Crew.dismiss`."""
        processes: Any = getattr(executor, "_processes", None) or {}
        executor.shutdown(wait=False, cancel_futures=True)
        for process in list(processes.values()):
            process.terminate()

    def finish(self, executor: Executor) -> None:
        """See `Crew.finish`."""
        executor.shutdown(wait=True)

    def has_lost(self, error: Exception) -> bool:
        """See `Crew.has_lost`."""
        return False


def _begin_worker() -> None:
    """Make a worker end when the process that began it does, also where that is killed and cannot say so."""
    parent = multiprocessing.parent_process()
    # An interrupt from the keyboard reaches all processes of a terminal; the one that began them ends them.
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


class DaskCluster:
    """A Dask cluster that is there already.

    Parameters
    ----------
    address : str
        Of its scheduler, such as ``tcp://127.0.0.1:8786`` or, with certificates in Dask's own configuration,
        ``tls://...``.

    Raises
    ------
    SweepError
        If Dask is not installed, or nobody answers.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError as error:
            raise SweepError(
                'a scheduler needs Dask: install it with pip install "hybrid-fmu[dask]", or leave the scheduler out.'
            ) from error
        if not re.fullmatch(r"\S+:\d{1,5}|inproc://\S+", address):
            raise SweepError(f"'{address}' is no address of a Dask scheduler: write tcp://HOST:PORT.")
        try:
            # Untyped, as all of Dask is.
            make: Any = Client
            self._client: Any = make(address, timeout=10, set_as_default=False)
        except (OSError, ValueError, TypeError, RuntimeError) as error:
            raise SweepError(f"no Dask scheduler answers at {address}: {error}.") from error
        self.address = address

    @property
    def workers(self) -> int:
        """Threads of all workers that are there now; 1 while there is none."""
        return max(1, sum(map(int, self._client.nthreads().values())))

    def executor(self) -> Executor:
        """See `Crew.executor`."""
        # Runs that were submitted twice, after a failure, are two runs.
        executor: Executor = self._client.get_executor(pure=False)
        return executor

    def dismiss(self, executor: Executor) -> None:
        """See `Crew.dismiss`."""
        executor.shutdown(wait=False)

    def finish(self, executor: Executor) -> None:
        """See `Crew.finish`."""
        executor.shutdown(wait=True)

    def has_lost(self, error: Exception) -> bool:
        """See `Crew.has_lost`."""
        from distributed import KilledWorker

        return isinstance(error, KilledWorker)

    def close(self) -> None:
        """Leave the cluster, which goes on."""
        self._client.close()
