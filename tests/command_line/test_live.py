"""What the interactive page computes, without a browser: runs, bounds, the picture, the download."""

import io
import zipfile

import numpy as np
import pytest
from PIL import Image

from cosim.cli.live import GRAPHS, PAPER, Picture, fmus, live, scenario_of
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


def test_the_picture_follows_the_run(paper):
    picture = Picture()
    first = np.asarray(Image.open(io.BytesIO(picture.draw(paper, 1))), dtype=int)
    other = np.asarray(Image.open(io.BytesIO(picture.draw(paper, 2))), dtype=int)
    again = np.asarray(Image.open(io.BytesIO(picture.draw(paper, 1))), dtype=int)
    np.testing.assert_array_equal(first, again)
    half = first.shape[0] // 2
    # Of another agent the error below changes, and nothing above.
    np.testing.assert_array_equal(first[:half], other[:half])
    assert (first[half:] != other[half:]).any()


def test_all_graphs_are_scenarios():
    for graph in GRAPHS:
        assert scenario_of(graph, 0.5, 0.0, 1.0, 1).network.agents == 4


def test_the_download_has_the_agents(paper):
    with zipfile.ZipFile(io.BytesIO(fmus(paper.scenario))) as archive:
        assert archive.namelist() == [f"agent{i}.fmu" for i in (1, 2, 3, 4)]
        with zipfile.ZipFile(io.BytesIO(archive.read("agent1.fmu"))) as fmu:
            assert "modelDescription.xml" in fmu.namelist()
