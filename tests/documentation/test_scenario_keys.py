"""docs/scenarios.md has a row for every key that a scenario file may have, with its default, and for no other."""

import re
from pathlib import Path

import pytest

from hybrid_model.consensus.graphs.generators import GraphKind
from hybrid_model.consensus.scenario import read_network
from hybrid_model.consensus.scenario.channel import IDEAL
from hybrid_model.consensus.scenario.files import CHANNEL_KEYS, TOP_KEYS
from hybrid_model.consensus.scenario.read_switching import SWITCHING_KEYS
from hybrid_model.consensus.scenario.trigger import TriggerKind, trigger_keys
from hybrid_model.consensus.weights.kinds import WeightKind

PAGE = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text(encoding="utf-8")
WEIGHTS = [kind for kind in WeightKind if kind is not WeightKind.FUNCTION]  # which files name as file.py:function
TRIGGERS = [kind for kind in TriggerKind if kind is not TriggerKind.OWN]


def section(heading, within=PAGE):
    """What stands under a heading, up to the next one of its level or above."""
    level = heading.index(" ")
    return re.split(rf"\n#{{1,{level}}} ", within.split(f"\n{heading}\n")[1])[0]


def rows(text):
    """Key -> default of each row of the first table, keys in ticks."""
    table = re.search(r"\| key \| value \| default \|\n.*\n((?:\|.*\|\n)+)", text)[1]
    cells = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table.splitlines()]
    return {row[0].strip("|` "): row[-1].strip("| ") for row in cells}


@pytest.mark.parametrize(
    ("heading", "keys"),
    [
        ("## At the top", TOP_KEYS),
        ("## Network", read_network.KEYS),
        ("### Drawn start values", ("draw", "seed", *(key for both in read_network._DRAWN.values() for key in both))),
        ("## Channel", CHANNEL_KEYS),
    ],
)
def test_tables_with_one_kind(heading, keys):
    assert set(rows(section(heading))) == set(keys)


@pytest.mark.parametrize("kind", WEIGHTS)
def test_weights(kind):
    found = rows(section(f"### `{kind.value}`", section("## Weights")))
    assert set(found) == set(kind.keys)
    for key, default in kind.waveform.numbers.items():
        assert found[key] == ("-" if default is None else f"{default:g}"), key


@pytest.mark.parametrize("kind", SWITCHING_KEYS)
def test_switching(kind):
    assert set(rows(section(f"### `{kind.value}`", section("## Switching")))) == set(SWITCHING_KEYS[kind])


@pytest.mark.parametrize("kind", TRIGGERS)
def test_triggers(kind):
    found = rows(section(f"### `{kind.value}`", section("## Trigger")))
    defaults = trigger_keys(kind)
    assert set(found) == {"kind", *defaults}
    for key, default in defaults.items():
        assert found[key] == ("-" if default is None else f"{default:g}"), key


def test_every_kind_has_its_section_and_no_other_has():
    for heading, kinds in (("## Weights", WEIGHTS), ("## Switching", SWITCHING_KEYS), ("## Trigger", TRIGGERS)):
        named = re.findall(r"\n### `([\w-]+)`\n", section(heading))
        assert sorted(named) == sorted(kind.value for kind in kinds)
    assert [kind.value for kind in GraphKind if f'`"{kind.value}"`' not in section("## Network")] == []


def test_defaults_of_the_channel():
    assert rows(section("## Channel")) == {key: f"{getattr(IDEAL, key):g}" for key in CHANNEL_KEYS}
