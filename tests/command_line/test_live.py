"""What the interactive page computes, without a browser: runs, bounds, the picture, the download."""

import io
import zipfile
from xml.etree import ElementTree

import numpy as np
import pytest

from cosim.cli.live import GRAPHS, PAPER, fmus, live, scenario_of
from cosim.cli.live_picture import draw, round_values
from hybrid_model import Stop
from hybrid_model.consensus.runs.report import edge_norm


@pytest.fixture(scope="module")
def paper():
    return live(scenario_of(PAPER, 0.5, 0.06, 1.0, 2))


def test_it_begins_with_the_example_of_the_paper(paper):
    assert paper.report.events_per_agent == [4, 10, 13, 8]
    assert paper.arc.engine.startswith("native")
    assert "35 broadcasts (4, 10, 13, 8); shortest gap 0.1038 s" in paper.text()
    # 4 agents with one broadcast each 0.1038361 s in 50 s.
    assert paper.periodic == 4 * int(50.0 / paper.report.min_gap) == 1924


def test_the_bound_holds_along_the_run(paper):
    t = np.linspace(0.0, 50.0, 1001)
    norm = edge_norm(paper.scenario, np.array([paper.arc.at(f"agent{i}.x", t) for i in (1, 2, 3, 4)]))
    assert (norm <= paper.bound(t)).all()


def test_where_the_threshold_outruns_the_rate_there_is_no_bound():
    shown = live(scenario_of("ring", 0.5, 0.3, 0.1, 2))
    assert shown.rate == pytest.approx(0.2, rel=1e-6)  # 2 k, the second eigenvalue of a ring of four times the gain
    assert shown.radius is None
    assert shown.bound(np.zeros(1)) is None
    assert "ultimate radius none" in shown.text()


def panels(svg):
    """The four panels' elements, each behind its frame, states, broadcasts, error, norms."""
    rest, places = list(ElementTree.fromstring(svg))[1:], []
    for element in rest:
        places += [[]] if element.tag == "rect" else []
        places[-1].append(element)
    return places


def points(polyline):
    return np.array([pair.split(",") for pair in polyline.get("points").split()], dtype=float)


def test_the_picture_has_the_numbers_of_the_run(paper):
    states, broadcasts, error, norms = panels(draw(paper, 2))
    frame = {key: float(states[0].get(key)) for key in ("x", "y", "width", "height")}
    # Agent 2 begins at 2, the largest state, and the axis goes to 0.1 above it; the smallest is 0.3 at the start.
    lines = [points(element) for element in states if element.tag == "polyline"]
    assert len(lines) == 4
    share = (2.0 - 0.2) / (2.1 - 0.2)
    assert lines[1][0] == pytest.approx([frame["x"], frame["y"] + frame["height"] * (1 - share)], abs=0.06)
    assert sum(len(element) for element in states if element.tag == "g") == 35
    # One stroke a broadcast, at its time.
    strokes = [element.get("d") for element in broadcasts if element.get("stroke") not in ("#444", None)]
    assert [stroke.count("M") for stroke in strokes[:4]] == [4, 10, 13, 8]
    left, width = (float(broadcasts[0].get(key)) for key in ("x", "width"))
    first = float(strokes[0][1:].split(",")[0])
    assert first == pytest.approx(left + width * paper.report.event_times[0][0] / 50.0, abs=0.06)
    # The error meets the threshold at each broadcast, however coarse the grid is.
    curve, level = (points(element) for element in error if element.tag == "polyline")
    bottom = float(error[0].get("y")) + float(error[0].get("height"))
    for time in paper.report.event_times[1]:
        x = float(error[0].get("x")) + width * time / 50.0
        met = curve[np.abs(curve[:, 0] - x) < 0.06][:, 1].min()
        # Within a cell of the level's grid, 0.05 s, the threshold falls by less than a pixel.
        assert met == pytest.approx(np.interp(x, level[:, 0], level[:, 1]), abs=1.0)
        assert curve[np.abs(curve[:, 0] - x) < 0.06][:, 1].max() == pytest.approx(bottom, abs=0.06)
    assert sum(element.tag == "polyline" for element in norms) == 2


def test_of_another_agent_the_error_changes_and_nothing_else(paper):
    first, other = (panels(draw(paper, agent)) for agent in (1, 2))
    same = [
        list(map(ElementTree.tostring, a)) == list(map(ElementTree.tostring, b))
        for a, b in zip(first, other, strict=True)
    ]
    assert same == [True, True, False, True]


def test_a_threshold_that_outruns_the_states_ends_the_run_and_the_page_says_so():
    shown = live(scenario_of(PAPER, 0.05, 0.3, 0.2, 8))
    assert shown.arc.stop is Stop.JUMPS
    assert shown.text().startswith(f"The run ends at {shown.end:.4g} s: 5000 jumps. ")
    states, *_ = panels(draw(shown, 1))
    last = max(points(element)[-1, 0] for element in states if element.tag == "polyline")
    assert last == pytest.approx(float(states[0].get("x")) + float(states[0].get("width")), abs=0.06)


def test_a_slider_that_comes_back_is_not_analysed_again(monkeypatch):
    scenarios = [scenario_of("star", 0.5, 0.0, gain, 2) for gain in (1.0, 1.1)]
    rates = [live(scenario).rate for scenario in scenarios]
    monkeypatch.setattr("cosim.cli.live.analyse", None)
    assert [live(scenario).rate for scenario in scenarios] == rates


@pytest.mark.parametrize(("low", "high"), [(0.0, 50.0), (0.0, 1.1), (-0.73, 2.1), (0.0, 3e-7), (1.0, 1.001)])
def test_values_at_the_axes_are_round_and_few(low, high):
    values = round_values(low, high)
    assert 4 <= len(values) <= 8
    assert low - 1e-9 * (high - low) <= values[0]
    assert values[-1] <= high + 1e-9 * (high - low)
    step = values[1] - values[0]
    assert round(step / 10.0 ** np.floor(np.log10(step * 1.0001)), 6) in (1.0, 2.0, 5.0)


def test_all_graphs_are_scenarios():
    for graph in GRAPHS:
        assert scenario_of(graph, 0.5, 0.0, 1.0, 1).network.agents == 4


def test_the_download_has_the_agents(paper):
    with zipfile.ZipFile(io.BytesIO(fmus(paper.scenario))) as archive:
        assert archive.namelist() == [f"agent{i}.fmu" for i in (1, 2, 3, 4)]
        with zipfile.ZipFile(io.BytesIO(archive.read("agent1.fmu"))) as fmu:
            assert "modelDescription.xml" in fmu.namelist()
