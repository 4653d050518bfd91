"""What `hybrid_model.simulate` takes beside a loop over SciPy: ``python -m benchmarks.run_cost``.

The ball, the paper's example and nine textbook models (`tests/support/textbook_models.py`); then what a run in a new
process takes beyond its imports.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from oracles import exact_textbook
from textbook_models import TEXTBOOK

import hybrid_model as hm
from hybrid_model.declare.variables import Kind

from . import textbook_loops, with_scipy
from .__main__ import row, versions
from .measure import Score, score
from .problems import PAPER_DYNAMIC, Ball, Outcome
from .with_hybrid_fmu import automaton_of, event_names

MARKS = ("<!-- runs -->", "<!-- end of runs -->")
ROUNDS = 9
TARGET = 1e-9
TOLERANCES = tuple(10.0**-k for k in range(4, 14))
NEW_PROCESS = """
import sys, time
sys.path[:0] = {folders}
import numpy, hybrid_model as hm, hybrid_model.native.simulation
begun = time.process_time(), time.perf_counter()
from new_model import New
hm.simulate(New(), 1.0, engine="native")
print(*(end - start for end, start in zip((time.process_time(), time.perf_counter()), begun)))
"""
NEW_MODEL = """
import hybrid_model as hm
class New(hm.HybridAutomaton):
    h = hm.State(1.0)
    v = hm.State(0.0)
    def flow_map(self, s): return {{"h": s.v, "v": -{gravity}}}
    def flow_set(self, s): return s.h
    def jump_set(self, s): return hm.least(-s.h, -s.v)
    def jump_map(self, s): return {{"h": 0.0, "v": -0.5 * s.v}}
"""


@dataclass(frozen=True)
class Textbook:
    """A textbook model as a problem of the benchmarks."""

    title: str
    targets: tuple[float, ...] = (TARGET,)

    @property
    def t_end(self):
        return TEXTBOOK[self.title][1]

    def automaton(self):
        return TEXTBOOK[self.title][0]()

    @cached_property
    def names(self):
        return [jump.name for jump in self.automaton().jumps]

    @cached_property
    def exact(self):
        return self.outcome(*getattr(exact_textbook, self.title)(self.t_end))

    def outcome(self, events, x_end):
        """Sort events by name."""
        times = [np.array([t for name, t in events if name == wanted]) for wanted in self.names]
        return Outcome(times, np.asarray(x_end), self.t_end)

    def scipy(self, tolerance, method):
        loop = getattr(textbook_loops, self.title)
        options = {"method": method, "rtol": tolerance, "atol": tolerance / 100}
        return lambda: self.outcome(*loop(self.t_end, options))


@dataclass
class Runs:
    """A contender on a problem.

    Attributes
    ----------
    seconds : list of float
        CPU time in s of each timed run.
    """

    run: Callable[[], Any]
    score: Score
    setting: str
    seconds: list[float] = field(default_factory=list)

    @property
    def median(self):
        return float(np.median(self.seconds))

    def ratio(self, other):
        """Median of the ratios round by round."""
        return float(np.median(np.array(self.seconds) / np.array(other.seconds)))


def loop(problem, method) -> Runs | None:
    """Return the loop over SciPy at the loosest tolerance that reaches the target, if one does."""
    for tolerance in TOLERANCES:
        prepare = problem.scipy if isinstance(problem, Textbook) else partial(with_scipy.prepare, problem)
        run = prepare(tolerance, method=method)
        found = score(run(), problem.exact)
        if found.complete and found.time_error <= problem.targets[-1]:
            return Runs(run, found, f"{method} {tolerance:.0e}")
    return None


def own(problem, *, anew: bool) -> Runs:
    """Return `simulate` with its default options, of one automaton or of one that is made for each run."""
    textbook = isinstance(problem, Textbook)
    make = problem.automaton if textbook else lambda: automaton_of(problem)
    names = problem.names if textbook else event_names(problem)
    made = make()
    states = [variable.name for variable in made.of_kind(Kind.STATE)]
    if not textbook and not isinstance(problem, Ball):
        states = [f"agent{i}.x" for i in range(1, problem.scenario.network.agents + 1)]

    def run():
        arc = hm.simulate(make() if anew else made, problem.t_end)
        events = [arc.event_times(name) for name in names]
        return Outcome(events, np.concatenate([np.atleast_1d(arc.end[name]) for name in states]), float(arc.end.t))

    return Runs(run, score(run(), problem.exact), f"{hm.Solver.rtol:.0e}")


def take_times(contenders: list[Runs], rounds: int) -> None:
    """Time all in turns, forwards and backwards by round; short runs several times."""
    for k in range(rounds):
        for contender in contenders if k % 2 == 0 else contenders[::-1]:
            start, count = time.process_time(), 0
            # The clock of CPU time ticks in microseconds or worse; a run takes some hundred.
            while (spent := time.process_time() - start) < 0.01:
                contender.run()
                count += 1
            contender.seconds.append(spent / count)


def run_table(rounds: int) -> str:
    """Return the table of runs."""
    columns = ("model", "jumps", "SciPy loop: method, rtol", "time error in s", "ms")
    columns += ("`simulate`: time error in s", "ms", "ratio", "made anew: ms", "ratio")
    lines = [row(*columns), row(*["---"] * len(columns))]
    for problem in (PAPER_DYNAMIC, Ball(), *map(Textbook, TEXTBOOK)):
        loops = [found for method in ("DOP853", "LSODA") if (found := loop(problem, method))]
        ours = [own(problem, anew=anew) for anew in (False, True)]
        take_times([*loops, *ours], rounds)
        best = min(loops, key=lambda found: found.median)
        cells = [problem.title.split(",")[0].replace("_", " "), best.score.exact, best.setting]
        cells += [f"{best.score.time_error:.0e}", f"{1e3 * best.median:.3g}", _told(ours[0].score)]
        for contender in ours:
            cells += [f"{1e3 * contender.median:.3g}", f"{contender.ratio(best):.3f}"]
        lines.append(row(*cells))
        print(lines[-1], file=sys.stderr, flush=True)
    return "\n".join(lines)


def _told(found: Score) -> str:
    return f"{found.time_error:.0e}" if found.complete else f"{found.found} found, {found.extra} extra"


def first_run(rounds: int) -> list[tuple[float, float]]:
    """Return CPU and wall time in s of first runs of new models in new processes, beyond the imports.

    The engine is kept from the first of them, which is not timed; each model is another one.
    """
    found = []
    for k in range(rounds + 1):
        with tempfile.TemporaryDirectory() as folder:
            with open(os.path.join(folder, "new_model.py"), "w", encoding="utf-8") as file:
                file.write(NEW_MODEL.format(gravity=9.0 + time.time() % 1.0))
            program = NEW_PROCESS.format(folders=[folder, *sys.path])
            printed = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
            cpu, wall = map(float, printed.stdout.split())
            if k:
                found.append((cpu, wall))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.run_cost", description=__doc__)
    parser.add_argument(
        "--write", type=Path, help=f"text file in which to replace what stands between the lines {MARKS}"
    )
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="timed runs of each contender (default %(default)s)")
    options = parser.parse_args()
    cpu, wall = np.median(first_run(options.rounds), axis=0)
    parts = [
        versions(),
        "",
        run_table(options.rounds),
        "",
        f"First run of a new model in a new process, engine kept, beyond the imports: {cpu:.2f} s of CPU in it, "
        f"{wall:.2f} s of wall time with its compiler.",
    ]
    print(*parts, sep="\n")
    if options.write:
        _put(options.write, "\n".join(parts))


def _put(path: Path, told: str) -> None:
    text = path.read_text(encoding="utf-8")
    before, first, rest = text.partition(MARKS[0])
    _, second, after = rest.partition(MARKS[1])
    if not second:
        raise SystemExit(f"{path} has no lines {MARKS[0]} and {MARKS[1]}: write them where the table is to be.")
    path.write_text(f"{before}{first}\n{told}\n{second}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
