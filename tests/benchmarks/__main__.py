"""Print the tables of docs/benchmarks.md: ``make benchmark``."""

from __future__ import annotations

import argparse
import platform
from importlib import metadata

from .contenders import CONTENDERS
from .measure import ROUNDS, Entry, choose, fastest_scipy, take_times
from .problems import PROBLEMS, ZENO_PROBLEM

ZENO_TOLERANCE = 1e-9
COLUMNS = (
    "contender",
    "rtol",
    "events",
    "extra",
    "event time error in s",
    "end state error",
    "set-up in s",
    "run in s",
    "run / SciPy loop",
)
PACKAGES = ("numpy", "scipy", "pathsim", "scikit-sundae", "casadi", "fmpy")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="timed runs of each contender (default %(default)s)")
    rounds = parser.parse_args().rounds
    print(versions(), flush=True)
    for problem in PROBLEMS:
        print(f"\n## {problem.title}: {sum(map(len, problem.exact.events))} events")
        by_target = list(zip(*[choose(c, problem, problem.targets) for c in CONTENDERS if c.installed], strict=True))
        for target, entries in zip(problem.targets, by_target, strict=True):
            take_times(list(entries), rounds)
            print(f"\nAll event times within {target:.0e} s:\n\n{table(list(entries))}", flush=True)
    print(f"\n## {ZENO_PROBLEM.title}\n\n{zeno_table()}")


def versions() -> str:
    found = {d.metadata["Name"].lower(): d.version for d in metadata.distributions() if d.metadata["Name"]}
    named = [f"{name} {found.get(name, 'not installed')}" for name in PACKAGES]
    return f"Python {platform.python_version()}, {', '.join(named)}; {platform.system()} on {platform.machine()}."


def table(entries: list[Entry]) -> str:
    reference = fastest_scipy(entries)
    rows = [row(*COLUMNS), row(*["---"] * len(COLUMNS))]
    for e in entries:
        s = e.score
        rows.append(
            row(
                e.contender.name,
                f"{e.tolerance:.0e}" + ("" if e.reached else " (target not reached)"),
                f"{s.found} of {s.exact}" + (f" ({s.stopped})" if s.stopped else ""),
                f"{s.extra}",
                f"{s.time_error:.1e}",
                f"{s.state_error:.1e}",
                f"{e.setup:.2g}",
                f"{e.median:.3g}",
                f"{e.ratio(reference):.2f}" if reference else "-",
            )
        )
    rows += [row(c.name, "not installed", *[""] * (len(COLUMNS) - 2)) for c in CONTENDERS if not c.installed]
    return "\n".join(rows)


def zeno_table() -> str:
    columns = ("contender", "impacts", "ends at t in s", "height there in m", "how it ends")
    rows = [row(*columns), row(*["---"] * len(columns))]
    for contender in CONTENDERS:
        if not contender.installed:
            rows.append(row(contender.name, "not installed", "", "", ""))
            continue
        outcome = contender.prepare(ZENO_PROBLEM, ZENO_TOLERANCE)()
        # The particulars of a message are in parentheses.
        how = outcome.ended.split(" (")[0]
        rows.append(row(contender.name, len(outcome.events[0]), f"{outcome.t_end:.6f}", f"{outcome.x_end[0]:.3g}", how))
    return "\n".join(rows)


def row(*cells: object) -> str:
    return f"| {' | '.join(map(str, cells))} |"


if __name__ == "__main__":
    main()
