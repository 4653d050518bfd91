"""Options of `hybrid-fmu completion`."""

from __future__ import annotations

import argparse

DESCRIPTION = "Print the completion of commands, options and files for a shell."
EXAMPLES = (
    "hybrid-fmu completion bash > ~/.local/share/bash-completion/completions/hybrid-fmu",
    "hybrid-fmu completion zsh > ~/.zfunc/_hybrid-fmu",
)
SHELLS = ("bash", "zsh", "fish", "tcsh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("shell", metavar="SHELL", choices=SHELLS, help=f"one of {', '.join(SHELLS)}")
