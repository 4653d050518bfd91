"""The figures show the run's own numbers, and nothing hides a curve."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from drawn_axes import labels, line

import hybrid_model as hm
from hybrid_model.consensus.certificates.tree_bound import BoundForm, convergence_bound
from hybrid_model.consensus.figures.run import (
    plot_broadcasts,
    plot_edge_norm,
    plot_error_against_threshold,
    plot_states,
    save_paper_figures,
)
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.definition import replace_trigger
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind

# In 1/s: no state is faster, for two neighbours, weights up to 4 and differences of states up to 1.7. A broadcast is
# late by at most the run's location tolerance, so the error exceeds the threshold by at most this times that.
SPEED = 14.0


@pytest.fixture(scope="module", params=["static", "dynamic"])
def run(request):
    scenario = replace(replace_trigger(load_scenario("paper-a"), request.param), stop_time=10.0)
    return scenario, hm.simulate(closed_loop(scenario), scenario.stop_time)


def draw_all(scenario, arc):
    bounds = [convergence_bound(scenario, form) for form in BoundForm]
    return {
        "states": lambda ax: plot_states(scenario, arc, ax),
        "edge_norm": lambda ax: plot_edge_norm(scenario, arc, bounds, ax),
        "error": lambda ax: plot_error_against_threshold(scenario, arc, 2, ax),
        "broadcasts": lambda ax: plot_broadcasts(scenario, run_report(scenario, arc).event_times, ax),
    }


@pytest.mark.parametrize("name", ["states", "edge_norm", "error", "broadcasts"])
def test_figure_can_be_read(run, ax, name):
    """Axes say what they show and in which unit; the legend is above the curves and within the figure."""
    assert draw_all(*run)[name](ax) is ax
    assert ax.get_xlabel() == "time $t$ (s)"
    assert ax.get_ylabel() or [text.get_text() for text in ax.get_yticklabels()]
    ax.figure.canvas.draw()
    canvas = ax.figure.bbox
    tight = ax.get_tightbbox()
    assert canvas.x0 <= tight.x0
    assert tight.x1 <= canvas.x1
    assert tight.y1 <= canvas.y1
    if ax.get_legend() is not None:
        assert ax.get_legend().get_window_extent().y0 >= ax.get_window_extent().y1


def test_states_start_at_the_initial_values_and_carry_one_dot_a_broadcast(run, ax):
    scenario, arc = run
    plot_states(scenario, arc, ax)
    starts = [line(ax, f"$x_{{{i}}}$").get_data()[1][0] for i in (1, 2, 3, 4)]
    assert starts == list(scenario.network.initial)
    dots = [drawn for drawn in ax.lines if drawn.get_marker() in "osD^"]
    # Agents are told apart without colour: by their lines and by their marks.
    assert len({drawn.get_marker() for drawn in dots}) == len(dots)
    assert len({str(line(ax, f"$x_{{{i}}}$")._dash_pattern) for i in (1, 2, 3, 4)}) == 4
    assert sum(len(drawn.get_xdata()) for drawn in dots) == sum(run_report(scenario, arc).events_per_agent)


def test_many_agents_have_no_legend_of_colours_that_repeat(ax):
    scenario = load_scenario("paper-a")
    n = 9
    network = replace(
        scenario.network,
        agents=n,
        edges=tuple((i, i + 1) for i in range(1, n)),
        initial=tuple(np.linspace(0.0, 1.0, n)),
    )
    waveforms = (scenario.weights.waveforms[0],) * (n - 1)
    many = replace(
        scenario,
        stop_time=0.5,
        network=network,
        weights=replace(scenario.weights, waveforms=waveforms),
        switching=type(scenario.switching)(1.0, (tuple(range(1, n)),), n - 1),
    )
    plot_states(many, hm.simulate(closed_loop(many), many.stop_time), ax)
    assert labels(ax) == ["mean", f"{n} agents", "broadcast"]


def test_error_stays_below_the_threshold_and_reaches_it_at_each_broadcast(run, ax):
    scenario, arc = run
    plot_error_against_threshold(scenario, arc, 2, ax)
    times, error = line(ax, r"$|\hat{x}_{2} - x_{2}|$").get_data()
    c, beta = scenario.trigger.threshold, scenario.trigger.decay
    tolerance = SPEED * arc.event_tolerance
    assert np.max(error - c * np.exp(-beta * times)) <= tolerance
    events, reached = line(ax, "broadcast").get_data()
    np.testing.assert_array_equal(events, run_report(scenario, arc).event_times[1])
    assert len(events) > 0
    np.testing.assert_allclose(reached, c * np.exp(-beta * events), rtol=0, atol=tolerance)


@pytest.mark.parametrize("agent", [0, 5, -1])
def test_error_of_an_agent_that_is_not_there(run, ax, agent):
    with pytest.raises(ValueError, match=rf"no agent {agent} in .*: its agents are 1 to 4"):
        plot_error_against_threshold(*run, agent, ax)


def test_broadcasts_are_one_row_an_agent_the_first_on_top(run, ax):
    scenario, arc = run
    times = run_report(scenario, arc).event_times
    plot_broadcasts(scenario, times, ax)
    for row, expected in zip(ax.collections, times, strict=True):
        np.testing.assert_array_equal(row.get_positions(), expected)
    assert [text.get_text() for text in ax.get_yticklabels()] == [f"agent {i}" for i in (1, 2, 3, 4)]
    assert ax.yaxis_inverted()
    assert [text.get_text() for text in ax.texts[:4]] == [str(len(row)) for row in times]


def test_broadcasts_of_another_number_of_agents(run, ax):
    with pytest.raises(ValueError, match="3 rows of broadcast times for the 4 agents"):
        plot_broadcasts(run[0], [[1.0], [], [2.0]], ax)


def test_edge_norm_is_below_the_valid_bound_and_missing_bounds_are_named(run, ax):
    scenario, arc = run
    bounds = [convergence_bound(scenario, form) for form in BoundForm]
    plot_edge_norm(scenario, arc, bounds, ax)
    times, norm = line(ax, r"$\|x_e(t)\|$").get_data()
    # Published reference value of scenario A: six edges of the complete graph.
    assert norm[0] == pytest.approx(2.703701, abs=1e-6)
    assert np.all(norm <= np.interp(times, *line(ax, "valid bound").get_data()))
    # The printed bound needs beta < alpha_v, which the dynamic trigger of the paper does not meet.
    missing = scenario.trigger.decay > 0
    assert ("no printed bound" in labels(ax)) is missing
    assert ("printed bound" in labels(ax)) is not missing


def test_paper_figures_are_the_same_bytes_each_time(run, tmp_path):
    scenario, arc = run
    first = save_paper_figures("kind", scenario, arc, [], tmp_path / "first")
    # Whatever style others have left applied.
    with plt.style.context("fast"):
        second = save_paper_figures("kind", scenario, arc, [], tmp_path / "second")
    names = ["kind_states.png", "kind_states.pdf", "kind_edge_norm.png", "kind_edge_norm.pdf"]
    assert [path.name for path in first] == names
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_the_threshold_is_written_as_the_trigger_has_it(run, ax):
    scenario, arc = run
    mixed = Trigger(TriggerKind.MIXED, threshold=0.4, decay=0.2, offset=0.1)
    plot_error_against_threshold(replace(scenario, trigger=mixed), arc, 2, ax)
    assert r"threshold $c_0 + c_1\,e^{-\beta t}$" in labels(ax)
