"""``{command-help}`` is what ``hybrid-fmu COMMAND --help`` prints, for every command."""

import contextlib
import io
import os
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from cosim.cli.main import COMMANDS, main

WIDTH = "84"
"""Columns of the text."""


def help_of(command: str) -> str:
    """What the command prints when it is asked for help."""
    os.environ["COLUMNS"] = WIDTH
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.suppress(SystemExit):
        main([command, "--help"])
    return said.getvalue()


class CommandHelp(SphinxDirective):
    """A section for each command."""

    def run(self) -> list[nodes.Node]:
        """See `SphinxDirective`."""
        sections = []
        for name in COMMANDS:
            section = nodes.section(ids=[nodes.make_id(name)], names=[name])
            section += nodes.title("", f"hybrid-fmu {name}")
            section += nodes.literal_block("", help_of(name), language="text")
            sections.append(section)
        return sections


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
