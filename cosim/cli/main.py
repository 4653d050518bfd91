"""`hybrid-fmu`: parse the command line, run a command, turn errors into sentences and exit codes."""

from __future__ import annotations

import argparse
import importlib
import io
import os
import sys
from collections.abc import Sequence

from cosim.cli.exits import Exit
from cosim.errors import CosimError, UsageError
from fmu.errors import BuildError, ExportError
from hybrid_model import HybridModelError, __version__
from hybrid_model.consensus.entries import suggestion
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.errors import NamingError

_COMMANDS = {
    "paper": ("paper", "reproduce the paper's simulations in all executions"),
    "simulate": ("simulate", "run a scenario"),
    "certify": ("certify", "bounds of a scenario beside what a run shows"),
    "sweep": ("sweep", "many runs of a scenario with other values, as a table"),
    "export": ("export", "export an automaton or a scenario's agents as FMUs"),
    "cosim": ("cosimulate", "co-simulate a scenario's agents, or run one FMU"),
    "validate": ("validate", "check anybody's FMU"),
}
"""Module of this package, and what it does."""
_INTERRUPTED = 130
"""Status of a command that was interrupted from the keyboard, as shells have it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: those of the process.

    Returns
    -------
    int
        Exit status: 0 done, 1 failed, 2 wrong usage, 3 stopped by a Zeno guard.
    """
    _write_any_name()
    parser = argparse.ArgumentParser(
        prog="hybrid-fmu",
        description="Hybrid automata: run them event-exactly, export them as FMUs, co-simulate them.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    given = sys.argv[1:] if arguments is None else arguments
    called = next((word for word in given if not word.startswith("-")), None)
    if called is not None and called not in _COMMANDS:
        parser.error(
            f"there is no command '{called}'.{suggestion(called, _COMMANDS)} Commands: {', '.join(_COMMANDS)}."
        )
    for name, (module, purpose) in _COMMANDS.items():
        command = commands.add_parser(name, help=purpose, allow_abbrev=False)
        # Some take long to import.
        if name == called:
            importlib.import_module(f"cosim.cli.{module}").add_arguments(command)
    options = parser.parse_args(arguments)
    try:
        return int(options.run(options))
    except (ScenarioError, UsageError, NamingError) as error:
        return _report(error, Exit.USAGE)
    except KeyboardInterrupt:
        return _INTERRUPTED
    except BrokenPipeError:
        # Whoever read the output has seen enough; Python's own attempt to flush it would fail once more.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return int(Exit.DONE)
    except (HybridModelError, ExportError, BuildError, CosimError, OSError) as error:
        return _report(error, Exit.FAILED)


def _write_any_name() -> None:
    """Let letters that the terminal does not have appear as their codes: a finished run must not end there."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _report(error: Exception, status: Exit) -> int:
    print(f"hybrid-fmu: {error}", file=sys.stderr)
    return int(status)


if __name__ == "__main__":
    raise SystemExit(main())
