"""Figures of runs and of sweeps show the numbers that they are given."""

from dataclasses import replace

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.consensus.certificates.forms import Quantity
from hybrid_model.consensus.figures.conservatism import plot_conservatism
from hybrid_model.consensus.figures.details import (
    plot_all_errors,
    plot_broadcasts_and_weights,
    plot_disagreement,
    plot_gap_histogram,
    plot_gaps_against_bounds,
)
from hybrid_model.consensus.figures.run import plot_error_against_threshold
from hybrid_model.consensus.figures.style import COLUMN
from hybrid_model.consensus.figures.sweeps import plot_against_parameter, plot_radius_against, plot_rate_against
from hybrid_model.consensus.laws.closed_loop import closed_loop, edges_of
from hybrid_model.consensus.runs.metrics import run_states
from hybrid_model.consensus.runs.periodic_run import periodic_run
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind
from hybrid_model.native.compiled import compiled
from hybrid_model.plots import JOURNAL


@pytest.fixture(scope="module")
def run():
    scenario = replace(load_scenario("paper-a-static"), stop_time=10.0)
    arc = hm.simulate(compiled(closed_loop(scenario)), scenario.stop_time)
    return scenario, arc, run_report(scenario, arc).event_times


@pytest.fixture
def ax():
    with plt.rc_context(JOURNAL):
        figure, axes = plt.subplots(figsize=COLUMN)
        yield axes
        plt.close(figure)


def labels(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def line(ax, label):
    return next(found for found in ax.lines if found.get_label() == label)


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


def test_disagreement_of_runs_side_by_side(run, ax):
    scenario, arc, _ = run
    periodic = periodic_run(scenario, 0.5)
    plot_disagreement(scenario, {"static": run_states(scenario, arc), "periodic": periodic.at}, 0.1, ax)
    assert labels(ax) == ["static", "periodic", "settled"]
    start = np.std([1.0, 2.0, 0.3, 0.4]) * 2  # of four agents: sqrt(4) times the standard deviation
    for name in ("static", "periodic"):
        assert line(ax, name).get_ydata()[0] == pytest.approx(start)
    last = periodic.at(np.array([scenario.stop_time]))[:, 0]
    assert line(ax, "periodic").get_ydata()[-1] == pytest.approx(np.linalg.norm(last - last.mean()))


def test_histogram_counts_every_gap(run, ax):
    _, _, times = run
    plot_gap_histogram(times, 8, ax)
    values = ax.patches[0].get_data().values
    assert values.sum() == sum(max(0, len(row) - 1) for row in times)
    gaps = np.concatenate([np.diff(row) for row in times])
    assert labels(ax) == [f"median {np.median(gaps):.3g} s"]


def test_forms_against_a_parameter_leave_gaps_where_they_do_not_exist(ax):
    beta = [0.0, 0.1, 0.2]
    plot_radius_against("beta", beta, {"exact": [1.0, 2.0, 3.0], "valid": [5.0, None, None], "printed": [None] * 3}, ax)
    np.testing.assert_array_equal(line(ax, "exact").get_ydata(), [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(line(ax, "valid").get_ydata(), [5.0, np.nan, np.nan])
    assert "no printed" in labels(ax)
    assert ax.get_yscale() == "log"
    assert ax.get_xlabel() == r"decay of the threshold $\beta$ (1/s)"


def test_rate_against_beta_has_the_line_that_parts_slow_from_fast_thresholds(ax):
    plot_rate_against("beta", [0.0, 0.3, 0.6], {"floquet": [0.47] * 3, "valid": [1e-3] * 3}, ax)
    times, values = line(ax, r"$\beta$").get_data()
    np.testing.assert_array_equal(times, values)


def test_rate_against_c_has_no_such_line(ax):
    plot_rate_against("c", [0.1, 0.3], {"floquet": [0.47] * 2}, ax)
    assert labels(ax) == ["Floquet"]
    assert ax.get_xlabel() == "threshold $c$"


def test_wrong_number_of_values(ax):
    with pytest.raises(ValueError, match="'valid' has 1 values for 2 of the parameter"):
        plot_against_parameter([1.0, 2.0], {"valid": [1.0]}, name="c", quantity=Quantity.RATE, ax=ax)


def test_conservatism_is_a_factor_and_violations_are_named(ax):
    certified = {
        "radius": {"valid": 20.0, "printed": 1.0},
        "min_gap": {"valid": 0.01, "printed": 0.5, "improved": None},
    }
    plot_conservatism(certified, {"radius": 2.0, "min_gap": 0.1}, ax)
    assert [text.get_text() for text in ax.get_yticklabels()] == [
        "radius, valid",
        "radius, printed",
        "gap, valid",
        "gap, printed",
        "gap, improved",
    ]
    texts = [text.get_text() for text in ax.texts]
    # An upper bound of half the reference and a lower bound of five times it do not hold.
    assert texts == ["10", "0.5, violated", "10", "0.2, violated", "none"]
    dots = [float(found.get_xdata()[0]) for found in ax.lines if found.get_marker() == "o"]
    np.testing.assert_allclose(dots, [10.0, 0.5, 10.0, 0.2])
    ax.figure.canvas.draw()
    label = ax.xaxis.label.get_window_extent()
    assert ax.figure.bbox.x0 <= label.x0 <= label.x1 <= ax.figure.bbox.x1
    for text in ax.texts:
        box = text.get_window_extent()
        assert ax.get_window_extent().x0 <= box.x0
        assert box.x1 <= ax.figure.bbox.x1


def test_conservatism_needs_a_reference(ax):
    with pytest.raises(ValueError, match="the rate has the reference None"):
        plot_conservatism({"rate": {"valid": 1.0}}, {}, ax)


def test_what_is_observed_is_called_no_bound_however_far_the_factors_reach(ax):
    """The text stands right of the line, and names at the left stay free, over eight decades."""
    plot_conservatism({"radius": {"valid": 1e8, "exact": 1.0, "observed": 0.3}}, {"radius": 1.0}, ax)
    assert [text.get_text() for text in ax.texts][1:] == ["1", "0.3"]
    ax.figure.canvas.draw()
    assert all(text.get_window_extent().x0 > ax.transData.transform((1.0, 0.0))[0] for text in ax.texts)
    assert all(text.get_window_extent().x1 <= ax.figure.bbox.x1 for text in ax.texts)


def test_a_bound_that_has_overflown_leaves_the_others_visible(ax):
    plot_radius_against("beta", [0.0, 0.1], {"exact": [2.0, 3.0], "energy": [4.0, 7e305]}, ax)
    np.testing.assert_array_equal(line(ax, "energy").get_ydata(), [4.0, np.nan])
    assert ax.get_ylim()[1] < 10


def test_the_threshold_is_written_as_the_trigger_has_it(run, ax):
    scenario, arc, _ = run
    mixed = Trigger(TriggerKind.MIXED, threshold=0.4, decay=0.2, offset=0.1)
    plot_error_against_threshold(replace(scenario, trigger=mixed), arc, 2, ax)
    assert r"threshold $c_0 + c_1\,e^{-\beta t}$" in labels(ax)
