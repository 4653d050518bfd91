"""Every code block of the README and of the pages runs, page by page, as a reader would run it."""

import argparse
import importlib
import re
import sys
import tomllib
from pathlib import Path

import matplotlib.pyplot
import pytest
from page_code import Reader, blocks

from cosim.cli.main import COMMANDS
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.scenario.files import read_scenario

ROOT = Path(__file__).parents[2]
PAGES = [page for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))] if blocks(page)]
LANGUAGES = {"c", "python", "pycon", "sh", "toml"}
ANY_SCENARIO = {
    "name": "example",
    "stop_time": 10.0,
    "network": {"agents": 3, "edges": [[1, 2], [2, 3], [3, 1]], "initial": [1.0, 0.0, 0.5]},
    "weights": {"kind": "constant", "value": 1.0},
    "trigger": {"kind": "static", "threshold": 0.2},
}


def name_of(page):
    return page.stem


@pytest.fixture
def reader(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    before = set(sys.modules)
    matplotlib.use("Agg")

    def read_tables(tables):
        assert closed_loop(read_scenario(ANY_SCENARIO | tomllib.loads(tables), tmp_path)).parts

    yield Reader(tmp_path, read_tables)
    matplotlib.pyplot.close("all")
    for name in set(sys.modules) - before:
        if str(tmp_path) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_the_code_of_a_page_runs(page, reader, capsys):
    for block in blocks(page):
        assert block.language in LANGUAGES | {"yaml"}, f"line {block.line}"
        if block.why is None:
            reader.do(block)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_that_are_not_run_have_options_that_exist(page):
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    for block in blocks(page):
        for words in block.commands if block.language == "sh" else ():
            if words[0] == "make":
                assert words[1] in targets
            elif words[0] == "hybrid-fmu":
                parser = argparse.ArgumentParser(exit_on_error=False, allow_abbrev=False)
                importlib.import_module(f"cosim.cli.options.{COMMANDS[words[1]][0]}").add_arguments(parser)
                parser.parse_args(words[2:])
