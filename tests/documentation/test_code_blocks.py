"""Every code block of the README and of the pages runs, page by page, as a reader would run it."""

import argparse
import importlib
import re
import tomllib
from pathlib import Path

import matplotlib
import pytest
from page_code import Reader, blocks

from cosim.cli.main import _COMMANDS as COMMANDS
from hybrid_model.consensus.scenario.files import read_scenario

ROOT = Path(__file__).parents[2]
PAGES = [page for page in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))] if blocks(page)]
LANGUAGES = {"python", "pycon", "sh", "toml"}
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
    matplotlib.use("Agg")
    return Reader(tmp_path, lambda tables: read_scenario(ANY_SCENARIO | tomllib.loads(tables), tmp_path))


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
                importlib.import_module(f"cosim.cli.{COMMANDS[words[1]][0]}").add_arguments(parser)
                parser.parse_args(words[2:])
