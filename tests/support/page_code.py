"""The code blocks of a page in Markdown, and what runs them: as a reader would, from top to bottom in one folder.

A block's language says what it is. ``python`` runs in the names that the blocks before it have left; one that begins
with ``# name.py`` is that file, as one of ``c`` that begins with ``/* name.c */`` is. ``pycon`` is a doctest, ``sh``
are commands, ``toml`` that begins with ``# name.toml`` is that file, else tables of a scenario. ``text`` is no code.
``<!-- not run: why -->`` before a block leaves it out.
"""

import doctest
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt

WHY = re.compile(r"<!-- not run: (.+) -->\s*")
FILE = re.compile(r"(?:# |/\* )([\w.-]+\.(?:py|toml|yaml|csv|c))(?: \*/)?\n")


@dataclass(frozen=True)
class Block:
    """A code block: its line on the page, and why it is not run if it is not."""

    line: int
    language: str
    code: str
    why: str | None

    @property
    def file(self):
        """The file that the block is, by its first line; None if it is none."""
        found = FILE.match(self.code)
        return found[1] if found else None

    @property
    def commands(self):
        """The commands of a block of the shell, each as its words."""
        lines = self.code.replace("\\\n", " ").splitlines()
        return [words for words in (shlex.split(line, comments=True) for line in lines) if words]


def blocks(page):
    """The blocks of a page that are code; what Sphinx makes of directives, in braces, is none."""
    found, why = [], None
    for token in MarkdownIt().parse(page.read_text(encoding="utf-8")):
        if token.type in ("fence", "code_block") and token.info != "text" and not token.info.startswith("{"):
            found.append(Block(token.map[0] + 2, token.info, token.content, why))
        told = WHY.fullmatch(token.content) if token.type == "html_block" else None
        why = told and told[1]
    return found


class Reader:
    """Somebody who does what a page says, in a folder of their own.

    Parameters
    ----------
    folder : Path
        The present folder while blocks run.
    read_tables : callable
        Reads tables of a scenario file.
    """

    def __init__(self, folder: Path, read_tables):
        self.folder, self.read_tables = folder, read_tables
        self.names = {"__name__": "__main__"}

    def do(self, block):
        """Run a block; AssertionError or its own error if it does not do what it says."""
        if block.file:
            (self.folder / block.file).write_text(block.code, encoding="utf-8")
        elif block.language == "python":
            exec(compile(block.code, f"<line {block.line}>", "exec"), self.names)
        elif block.language == "pycon":
            self.check_session(block)
        elif block.language == "toml":
            self.read_tables(block.code)
        else:
            for words in block.commands:
                self.call(words)

    def check_session(self, block):
        test = doctest.DocTestParser().get_doctest(block.code, self.names, "page", None, block.line)
        said = []
        runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
        runner.run(test, out=said.append, clear_globs=False)
        self.names |= test.globs
        assert not said, "".join(said)

    def call(self, words):
        if words[0] == "hybrid-fmu":
            from cosim.cli.main import main

            assert main(words[1:]) == 0, words
            return
        program = {"python": [sys.executable], "fmpy": [sys.executable, "-m", "fmpy"]}[words[0]]
        done = subprocess.run([*program, *words[1:]], capture_output=True, text=True, check=False)
        assert done.returncode == 0, (words, done.stderr)
