"""The numbers of docs/savings.md are those of the runs."""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

import hybrid_model as hm
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.runs.metrics import performance, run_states
from hybrid_model.consensus.runs.periodic_run import periodic_run, slow_gain
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.runs.savings import Measure, run_savings
from hybrid_model.consensus.scenario.files import load_scenario

PAGE = (Path(__file__).parents[3] / "docs" / "savings.md").read_text(encoding="utf-8")
ROWS = {
    "integral of `d^2`": Measure.INTEGRAL,
    "largest `d` in the last quarter": Measure.ULTIMATE,
    "settling time": Measure.SETTLING,
}


def table(number):
    """The cells of a table of the page by the text of its first column, without units."""
    blocks = re.findall(r"(?:^\|.*\n)+", PAGE, flags=re.MULTILINE)
    rows = [[cell.strip() for cell in line.strip("|\n").split("|")] for line in blocks[number].splitlines()[2:]]
    return {row[0].removesuffix(" (s)"): row[1:] for row in rows}


def number(text):
    return math.inf if text == "does not settle" else float(text)


@pytest.fixture(scope="module", params=[("paper-a-static", 0), ("paper-a", 2)], ids=["static", "dynamic"])
def run(request):
    name, column = request.param
    scenario = load_scenario(name)
    return scenario, hm.simulate(closed_loop(scenario), scenario.stop_time), column


def test_equal_rate(run):
    scenario, arc, column = run
    cells = table(0)
    times = run_report(scenario, arc).event_times
    events = sum(map(len, times))
    period = scenario.stop_time * 4 / events
    slower = replace(scenario, network=replace(scenario.network, gain=slow_gain(scenario, period)))
    periodic = periodic_run(slower, period)
    assert cells["broadcasts"][column : column + 2] == [str(events), str(4 * periodic.broadcasts)]
    assert cells["period"][column + 1] == f"{period:.4g}"
    judged = (
        performance(scenario, run_states(scenario, arc), times),
        performance(scenario, periodic.at, [periodic.times]),
    )
    for text, measure in ROWS.items():
        for cell, found in zip(cells[text][column : column + 2], judged, strict=True):
            assert measure.of(found) == pytest.approx(number(cell), rel=5e-4)  # four digits on the page, or fewer zeros


def test_without_a_gain_of_their_own_periodic_agents_diverge_at_equal_rate(run):
    scenario, arc, _ = run
    events = sum(run_report(scenario, arc).events_per_agent)
    periodic = periodic_run(scenario, scenario.stop_time * 4 / events)
    assert performance(scenario, periodic.at, [periodic.times]).ultimate > 1e3


@pytest.mark.long
def test_equal_performance(run):
    scenario, arc, column = run
    found = run_savings(scenario, arc)
    for text, measure in ROWS.items():
        cells = table(1)[text][column : column + 2]
        if cells[1]:
            assert cells == [str(found.events), str(found.needed[measure])]
        else:
            assert cells[0] == "does not settle"
            assert math.isinf(measure.of(found.triggered))
