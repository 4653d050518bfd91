"""Pages name only what there is: files, folders, modules, and what is in them."""

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
PACKAGES = ("hybrid_model", "fmu", "cosim")
# The log of changes names what was; files of users and of results are in no checkout.
HISTORY = "CHANGELOG.md"
CODE = re.compile(r"`([^`\n]+)`")
PLACE = re.compile(r"^(?:hybrid_model|fmu|cosim|tests|docs|notebooks|findings)/[\w/.*-]*$")
NAME = re.compile(rf"^(?:{'|'.join(PACKAGES)})(?:\.\w+)+$")


def spans(page):
    return CODE.findall(page.read_text(encoding="utf-8"))


def exists(place):
    if "*" in place:
        return any(ROOT.glob(place))
    path = ROOT / place
    return path.exists() or path.with_suffix(".py").exists()


def resolves(name):
    """Whether a dotted name is a module, or something in one, or an attribute of that."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        for attribute in parts[length:]:
            if not hasattr(found, attribute):
                return False
            found = getattr(found, attribute)
        return True
    return False


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != HISTORY], ids=lambda page: page.name)
def test_places_and_names_on_a_page_are_there(page):
    found = spans(page)
    assert [place for place in found if PLACE.match(place) and not exists(place)] == []
    assert [name for name in found if NAME.match(name) and not resolves(name)] == []


@pytest.mark.parametrize(
    ("there", "missing"),
    [("hybrid_model/simulate", "hybrid_model/imitate"), ("docs/*.md", "docs/*.txt"), ("tests/rooms/", "tests/halls/")],
)
def test_a_place_that_is_not_there_is_seen(there, missing):
    assert PLACE.match(there)
    assert exists(there)
    assert not exists(missing)


def test_a_name_that_is_not_there_is_seen():
    assert resolves("hybrid_model.HybridArc.at")
    assert not resolves("hybrid_model.HybridArc.nowhere")
    assert not resolves("fmu.export.import_fmu")


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != HISTORY], ids=lambda page: page.name)
def test_what_the_code_of_a_page_imports_is_there(page):
    text = page.read_text(encoding="utf-8")
    wanted = [
        f"{module}.{name.split(' as ')[0].strip()}"
        for module, names in re.findall(r"from ((?:hybrid_model|fmu|cosim)[\w.]*) import ([\w, ]+)", text)
        for name in names.split(",")
    ]
    assert [name for name in wanted if not resolves(name)] == []


def test_docstrings_name_modules_that_are_there():
    """Names of modules in the docstrings and comments of the packages."""
    wrong = []
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("*.py")):
            wrong += [(file.name, name) for name in spans(file) if NAME.match(name) and not resolves(name)]
    assert wrong == []


def test_sources_name_files_that_are_there():
    """Paths from the root in docstrings and comments, of Python and C."""
    path = re.compile(r"(?<![\w/.<{])((?:hybrid_model|fmu|cosim|docs|tests)/[\w/-]+\.(?:py|c|h|md))\b")
    wrong = []
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("*.[pch]*")):
            if file.suffix in (".py", ".c", ".h"):
                text = file.read_text(encoding="utf-8")
                wrong += [(file.name, place) for place in path.findall(text) if not exists(place)]
    assert wrong == []
