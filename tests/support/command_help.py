"""What ``hybrid-fmu COMMAND --help`` prints, for every command; run as a program it writes docs/commands.md anew."""

import contextlib
import io
import os
from pathlib import Path

from cosim.cli.main import COMMANDS, main

PAGE = Path(__file__).parents[2] / "docs" / "commands.md"
WIDTH = "84"
"""Columns of the text."""
HEAD = """# Commands
What each command prints when it is asked with `--help`. How they are used is on the pages of their subjects:
`docs/sweeps.md`, `docs/cosimulation.md`, `docs/validate.md`, `docs/scenarios.md`, `docs/fmus.md`.
"""


def help_of(command: str) -> str:
    """What the command prints when it is asked for help."""
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = WIDTH
    try:
        with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.suppress(SystemExit):
            main([command, "--help"])
    finally:
        del os.environ["COLUMNS"]
        if before is not None:
            os.environ["COLUMNS"] = before
    return said.getvalue()


def page() -> str:
    """The page: a section for each command."""
    return "\n".join([HEAD, *(f"## hybrid-fmu {name}\n```text\n{help_of(name)}```\n" for name in COMMANDS)])


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
