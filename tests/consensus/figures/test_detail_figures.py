"""Figures of a run in more detail show the numbers that they are given."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from drawn_axes import labels, line

import hybrid_model as hm
from hybrid_model.consensus.figures.details import (
    plot_all_errors,
    plot_broadcasts_and_weights,
    plot_gaps_against_bounds,
)
from hybrid_model.consensus.laws.closed_loop import closed_loop, edges_of
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.files import load_scenario


@pytest.fixture(scope="module")
def run():
    scenario = replace(load_scenario("paper-a-static"), stop_time=10.0)
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    return scenario, arc, run_report(scenario, arc).event_times


@pytest.mark.parametrize("columns", [1, 2, 3])
def test_every_agent_has_axes_with_its_own_broadcasts(run, columns):
    scenario, arc, times = run
    figure = plot_all_errors(scenario, arc, columns)
    assert [ax.get_title(loc="left") for ax in figure.axes] == [f"agent {i}" for i in (1, 2, 3, 4)]
    for ax, expected in zip(figure.axes, times, strict=True):
        dots = [found for found in ax.lines if found.get_label() == "broadcast"]
        np.testing.assert_array_equal(np.concatenate([dot.get_xdata() for dot in dots] or [[]]), expected)
        assert ax.get_ylim() == figure.axes[0].get_ylim()
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["threshold $c$", "broadcast"]
    plt.close(figure)


def test_shades_are_the_times_in_which_the_agent_moves(run, ax):
    """Under a constant threshold every broadcast lies in the shade: outside, the state stands still."""
    scenario, _, times = run
    plot_broadcasts_and_weights(scenario, times, ax)
    shades = ax.collections[scenario.network.agents :]
    assert len(shades) == scenario.network.agents
    grid = np.linspace(0.0, scenario.stop_time, 4001)[1:-1]
    for agent, (shade, row) in enumerate(zip(shades, times, strict=True), start=1):
        spans = [path.get_extents() for path in shade.get_paths()]

        def within(t, spans=spans):
            return any(span.x0 - 1e-9 <= t <= span.x1 + 1e-9 for span in spans)

        assert all(span.y0 < agent - 1 < span.y1 for span in spans)
        assert all(within(t) for t in row)
        for t in grid:
            moving = np.any(scenario.edge_weights.value(t)[edges_of(scenario, agent)] > 0)
            assert not moving or within(t)
        # The gates are open for a fifth of the time at most.
        assert 0.05 < sum(span.width for span in spans) / scenario.stop_time < 0.25


def test_gaps_and_bounds(run, ax):
    scenario, _, times = run
    plot_gaps_against_bounds(scenario, times, {"valid": 1e-6, "printed": 0.5, "improved": None}, ax)
    gaps = np.diff(times[2])
    np.testing.assert_allclose(np.sort(line(ax, "agent 3").get_ydata()), np.sort(gaps))
    # The smallest gap of scenario A, .106 s, is below 0.5 s.
    assert "valid bound" in labels(ax)
    assert "printed bound, violated" in labels(ax)
    assert "no improved bound" in labels(ax)
    low, high = ax.get_ylim()
    assert low < 1e-6
    assert high > max(np.max(np.diff(row), initial=0.0) for row in times)
