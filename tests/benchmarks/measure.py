"""Scores against the exact events, the loosest tolerance that reaches a target, and paired timing."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .contenders import Contender
from .problems import Outcome

ROUNDS = 9
"""Timed runs of every contender, in turns: a disturbance meets all of them."""


@dataclass(frozen=True)
class Score:
    """How a run compares with the exact one.

    Attributes
    ----------
    found, extra, exact : int
        Events found, events that do not exist, and events that there are.
    time_error : float
        Largest error of the found events' times in s.
    state_error : float
        Largest error of a state where the run ended.
    stopped : str
        Why the run ended before its time; else empty.
    """

    found: int
    extra: int
    exact: int
    time_error: float
    state_error: float
    stopped: str

    @property
    def complete(self) -> bool:
        return not self.stopped and self.found == self.exact and self.extra == 0

    @property
    def rank(self) -> tuple[float, ...]:
        """Smaller is better: all events first, their times next."""
        return (self.exact - self.found + self.extra, self.time_error)


def score(outcome: Outcome, exact: Outcome) -> Score:
    """Match events one to one, agent by agent, within half of that agent's shortest exact gap."""
    found, extra, errors = 0, 0, [0.0]
    for times, truth in zip(outcome.events, exact.events, strict=True):
        left = list(times)
        window = np.diff(truth).min() / 2 if len(truth) > 1 else 0.5
        for event in truth:
            nearest = min(left, key=lambda t, event=event: abs(t - event), default=np.inf)
            if abs(nearest - event) <= window:
                left.remove(nearest)
                errors.append(abs(nearest - event))
        extra += len(left)
        found += len(times) - len(left)
    state_error = float(np.abs(outcome.x_end - exact.x_end).max())
    stopped = "" if outcome.ended == exact.ended else f"{outcome.ended} at t = {outcome.t_end:.4g} s"
    return Score(found, extra, sum(map(len, exact.events)), float(max(errors)), state_error, stopped)


@dataclass
class Entry:
    """A contender on one problem at one target.

    Attributes
    ----------
    tolerance : float
        The loosest at which it reaches the target; if it never does, that of its best run.
    reached : bool
        Whether it reaches the target.
    setup : float
        Wall time in s to prepare the run.
    seconds : list of float
        CPU time in s of each timed run.
    """

    contender: Contender
    tolerance: float
    reached: bool
    score: Score
    run: Callable[[], Outcome]
    setup: float
    seconds: list[float] = field(default_factory=list)

    @property
    def median(self) -> float:
        return float(np.median(self.seconds))

    def ratio(self, other: Entry) -> float:
        """Median of the ratios to another's runs, round by round."""
        return float(np.median(np.array(self.seconds) / np.array(other.seconds)))


def choose(contender: Contender, problem: Any, targets: tuple[float, ...]) -> list[Entry]:
    """Find the loosest tolerance for each target, given loosest target first."""
    tried: list[Entry] = []
    chosen: list[Entry] = []
    tolerances = iter(contender.tolerances)
    for target in targets:
        while not any(_reaches(entry.score, target) for entry in tried):
            tolerance = next(tolerances, None)
            if tolerance is None:
                break
            start = time.perf_counter()
            run = contender.prepare(problem, tolerance)
            setup = time.perf_counter() - start
            tried.append(Entry(contender, tolerance, False, score(run(), problem.exact), run, setup))
        enough = [entry for entry in tried if _reaches(entry.score, target)]
        entry = enough[0] if enough else min(tried, key=lambda entry: entry.score.rank)
        chosen.append(Entry(contender, entry.tolerance, bool(enough), entry.score, entry.run, entry.setup))
    return chosen


def _reaches(result: Score, target: float) -> bool:
    return result.complete and result.time_error <= target


def take_times(entries: list[Entry], rounds: int = ROUNDS) -> None:
    """Time all entries in turns, forwards and backwards by round."""
    for k in range(rounds):
        for entry in entries if k % 2 == 0 else entries[::-1]:
            start = time.process_time()
            entry.run()
            entry.seconds.append(time.process_time() - start)


def fastest_scipy(entries: list[Entry]) -> Entry | None:
    """The entry that ratios refer to: SciPy's faster method of those that reach the target."""
    able = [e for e in entries if e.reached and e.contender.module == "with_scipy"]
    return min(able, key=lambda e: e.median, default=None)
