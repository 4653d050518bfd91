"""`hybrid-fmu`: parse the command line, run a command, turn errors into sentences and exit codes."""

from __future__ import annotations

import argparse
import difflib
import importlib
import io
import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from cosim.cli.exits import Exit
from cosim.errors import UsageError

COMMANDS = {
    "paper": ("paper", "reproduce the paper's simulations in all executions"),
    "simulate": ("simulate", "run a scenario"),
    "certify": ("certify", "bounds of a scenario beside what a run shows"),
    "sweep": ("sweep", "many runs of a scenario with other values, as a table"),
    "export": ("export", "export an automaton or a scenario's agents as FMUs"),
    "cosim": ("cosimulate", "run an FMU, a system of several, or a scenario's agents as FMUs"),
    "validate": ("validate", "check anybody's FMU"),
    "app": ("app", "an interactive page with sliders, in a browser"),
    "doctor": ("doctor", "what this machine has: compilers, cache, extras, platforms"),
    "completion": ("completion", "completion of commands and options for a shell"),
}
"""Module of this package and of `cosim.cli.options`, and what it does."""
STATUSES = "Exit status: 0 done, 1 failed, 2 wrong usage, 3 stopped by a Zeno guard, 130 interrupted from the keyboard."
EXAMPLES = ("hybrid-fmu paper", "hybrid-fmu simulate paper-a", "hybrid-fmu export file.py:ClassName --out fmus")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: those of the process.

    Returns
    -------
    int
        Exit status: 0 done, 1 failed, 2 wrong usage, 3 stopped by a Zeno guard, 130 interrupted from the keyboard.
    """
    try:
        _write_any_name()
        given = sys.argv[1:] if arguments is None else list(arguments)
        called = next((word for word in given if not word.startswith("-")), None)
        options = parser_of((called,) if called in COMMANDS else (), called).parse_args(given)
        module = COMMANDS[options.command][0]
        # What is wrong with a name shows before the imports that take long.
        getattr(importlib.import_module(f"cosim.cli.options.{module}"), "require_named", bool)(options)
        status = int(importlib.import_module(f"cosim.cli.{module}").run(options))
        sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        print("hybrid-fmu: interrupted.", file=sys.stderr)
        return int(Exit.INTERRUPTED)
    except BrokenPipeError:
        # Whoever read the output has seen enough; Python's own attempt to flush it would fail once more.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return int(Exit.DONE)
    except Exception as error:
        # Most of what may be raised is imported by whoever raises it.
        from cosim.cli.exits import sentence_of, status_of

        failed = status_of(error)
        if failed is None:
            raise
        print(f"hybrid-fmu: {sentence_of(error)}", file=sys.stderr)
        return int(failed)


def parser_of(complete: Sequence[str], called: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of the command line.

    Parameters
    ----------
    complete : sequence of str
        Commands that have their options; others are names in a list.
    called : str, optional
        The command that was called; one that there is not ends the process with a suggestion.
    """
    parser = _Parser(
        prog="hybrid-fmu",
        description="Hybrid automata: run them event-exactly, export them as FMUs, co-simulate them.",
        epilog=f"{_epilog(EXAMPLES)}\n'hybrid-fmu COMMAND --help' lists the options of a command, with examples.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND", dest="command")
    if called is not None and called not in COMMANDS:
        near = difflib.get_close_matches(called, COMMANDS, n=1)
        meant = f" Did you mean '{near[0]}'?" if near else ""
        parser.error(f"there is no command '{called}'.{meant} Commands: {', '.join(COMMANDS)}.")
    for name, (module, purpose) in COMMANDS.items():
        known = importlib.import_module(f"cosim.cli.options.{module}") if name in complete else None
        command = commands.add_parser(
            name,
            help=purpose,
            description=getattr(known, "DESCRIPTION", f"{purpose[0].upper()}{purpose[1:]}."),
            epilog=_epilog(known.EXAMPLES) if known else None,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        if known:
            known.add_arguments(command)
    return parser


def _epilog(examples: Sequence[str]) -> str:
    return "\n".join(["examples:", *(f"  {example}" for example in examples), "", STATUSES])


class _Parser(argparse.ArgumentParser):
    """Answers what it does not know, or a value that an option cannot have, by one sentence, as all that is refused."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Refuse what is left over, by the command that it was given to."""
        found, rest = super().parse_known_args(args, namespace)
        if rest:
            raise UsageError(self._not_taken(rest[0]))
        return found, rest

    def _not_taken(self, word: str) -> str:
        if word.startswith("-"):
            known = [option for action in self._actions for option in action.option_strings]
            # Without the dashes, which all have in common.
            near = difflib.get_close_matches(word.lstrip("-"), [option.lstrip("-") for option in known], n=1)
            meant = f" Did you mean '--{near[0]}'?" if near else ""
            return f"'{self.prog}' has no option '{word}'.{meant} '{self.prog} --help' lists those that there are."
        taken = [str(action.metavar) for action in self._actions if not action.option_strings]
        if not taken:
            return f"'{self.prog}' takes no argument but options, and '{word}' is one: leave it out."
        remedy = "put them into a folder, or into a system's .toml" if "SYSTEM" in taken else "call it once for each"
        return f"'{self.prog}' takes one {' and one '.join(taken)}, and '{word}' is one more: {remedy}."

    def error(self, message: str) -> NoReturn:
        """Refuse what was typed."""
        if not message.startswith("argument "):
            super().error(message)
        option, _, what = message.removeprefix("argument ").partition(": ")
        raise UsageError(f"{option} {what}." if what.startswith("'") else f"{option}: {what}.")


class _Version(argparse.Action):
    """Prints the version: it is in a package that takes longer to import than the rest of the command line."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from hybrid_model import __version__

        print(f"{parser.prog} {__version__}")
        parser.exit()


def _write_any_name() -> None:
    """Let letters that the terminal does not have appear as their codes: a finished run must not end there."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


if __name__ == "__main__":
    raise SystemExit(main())
