"""Print the tables of docs/benchmarks.md: ``make benchmark``."""

from __future__ import annotations

import argparse
import platform
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from .contenders import CONTENDERS
from .measure import ROUNDS, Entry, choose, fastest_scipy, take_times
from .problems import PROBLEMS, ZENO_PROBLEM

MARK = "<!-- tables -->"
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
    parser.add_argument("--write", type=Path, help=f"text file in which to replace what follows the line {MARK}")
    options = parser.parse_args()
    parts = []
    for part in report(options.rounds):
        print(part, flush=True)
        parts.append(part)
    if options.write:
        text, mark, _ = options.write.read_text(encoding="utf-8").partition(MARK)
        if not mark:
            parser.error(f"{options.write} has no line {MARK}: write it where the tables are to be.")
        options.write.write_text(text + mark + "\n" + "\n".join(parts) + "\n", encoding="utf-8")


def report(rounds: int) -> Iterator[str]:
    yield versions()
    for problem in PROBLEMS:
        yield f"\n### {problem.title}\n{sum(map(len, problem.exact.events))} events."
        chosen = [choose(contender, problem, problem.targets) for contender in CONTENDERS if contender.installed]
        for k, target in enumerate(problem.targets):
            entries = [by_target[k] for by_target in chosen]
            take_times(entries, rounds)
            yield f"\nAll event times within {target:.0e} s:\n\n{table(entries)}"
    yield f"\n### {ZENO_PROBLEM.title}\nTolerance {ZENO_TOLERANCE:.0e}.\n\n{zeno_table()}"


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
