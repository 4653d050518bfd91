"""docs/models.md lists every model of the library, and each model's file has its test."""

import re
from pathlib import Path

import pytest

import hybrid_model as hm
import hybrid_model.models
from hybrid_model import plots
from hybrid_model.models import FiniteStateMachine

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "models.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", hm.models.__all__)
def test_the_page_names_the_model(name):
    assert f"`{name}`" in PAGE


@pytest.mark.parametrize(
    "file", sorted((ROOT / "hybrid_model" / "models").glob("[!_]*.py")), ids=lambda file: file.stem
)
def test_the_model_has_a_test_of_its_name(file):
    assert (ROOT / "tests" / "models" / f"test_{file.name}").exists()


def test_the_names_of_the_page_exist():
    public = re.findall(r"`hm\.(\w+)", PAGE)
    assert len(public) > 10
    assert [name for name in public if not hasattr(hm, name)] == []
    assert [name for name in re.findall(r"`(plot_\w+)`", PAGE) if not hasattr(plots, name)] == []
    arc = hm.simulate(FiniteStateMachine(table=[[0]]), 1.0)
    assert [name for name in re.findall(r"`arc\.(\w+)", PAGE) if not hasattr(arc, name)] == []
    stops = re.findall(r"`Stop\.(\w+)", PAGE)
    assert set(stops) == set(hm.Stop.__members__)
