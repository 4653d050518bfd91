"""Plots: what is drawn, read back from the axes."""

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model import plots
from hybrid_model.models import BouncingBall


@pytest.fixture(scope="module")
def ball():
    return hm.simulate(BouncingBall(), 2.0)


@pytest.fixture
def ax():
    figure, axes = plt.subplots()
    yield axes
    plt.close(figure)


class Vector(hm.HybridAutomaton):
    w = hm.State([0.0, 1.0])

    def flow_map(self, s):
        return {"w": np.array([1.0, -1.0])}


def test_a_curve_goes_through_both_sides_of_every_jump(ball):
    t, v = plots.curve(ball, "v")
    assert np.all(np.diff(t) >= 0.0)
    for jump in ball.jumps:
        at = np.flatnonzero(t == jump.t)
        np.testing.assert_array_equal(v[at], [jump.x_before[1], jump.x_after[1]])


def test_a_curve_is_the_run_between_jumps(ball):
    t, h = plots.curve(ball, "h")
    first = t < ball.jumps[0].t
    assert first.sum() > 50
    assert h[first] == pytest.approx(1.0 - 9.81 / 2 * t[first] ** 2, abs=1e-12)
    assert len(t) >= plots.POINTS
    assert (t[0], t[-1]) == (0.0, 2.0)


def test_a_part_of_a_run(ball):
    t, _ = plots.curve(ball, "h", 0.3, 0.7)
    assert (t[0], t[-1]) == (0.3, 0.7)
    assert ball.jumps[0].t in t
    assert ball.jumps[1].t not in t


def test_a_curve_of_a_vector_has_columns_with_and_without_jumps():
    t, w = plots.curve(hm.simulate(Vector(), 1.0), "w")
    assert w.shape == (len(t), 2)
    assert w == pytest.approx(np.stack([t, 1.0 - t], axis=1), abs=1e-14)


def test_a_curve_of_a_run_that_starts_with_a_jump():
    class Leap(Vector):
        n = hm.DiscreteState(0)

        def jump_set(self, s):
            return 0.5 - s.n

        def jump_map(self, s):
            return {"n": 1}

    t, n = plots.curve(hm.simulate(Leap(), 1.0), "n")
    assert (list(t[:2]), list(n[:2])) == ([0.0, 0.0], [0.0, 1.0])
    assert np.all(n[1:] == 1.0)


def test_flows_are_drawn_with_their_names_and_axes(ball, ax):
    assert plots.plot_flow(ball, ["h", "v"], ax, labels={"v": "speed"}) is ax
    assert [line.get_label() for line in ax.lines] == ["h", "speed"]
    for line, name in zip(ax.lines, ["h", "v"], strict=True):
        t, values = plots.curve(ball, name)
        np.testing.assert_array_equal(line.get_xdata(), t)
        np.testing.assert_array_equal(line.get_ydata(), values)
    assert ax.get_xlabel() == "time $t$ (s)"
    assert ax.get_xlim() == (0.0, 2.0)


def test_jumps_are_marked_where_they_are(ball, ax):
    plots.mark_jumps(ball, "h", "jump", ax, color="r")
    (line,) = ax.lines
    np.testing.assert_array_equal(line.get_xdata(), [jump.t for jump in ball.jumps])
    np.testing.assert_array_equal(line.get_ydata(), [0.0] * len(ball.jumps))
    assert (line.get_linestyle(), line.get_marker(), line.get_color()) == ("None", "o", "r")


def test_a_jump_that_never_came_has_no_marks(ax):
    plots.mark_jumps(hm.simulate(BouncingBall(), 0.1), "h", "jump", ax)
    assert len(ax.lines[0].get_xdata()) == 0


def test_an_unknown_jump_is_refused(ball, ax):
    with pytest.raises(hm.DeclarationError, match="'bounce'"):
        plots.mark_jumps(ball, "h", "bounce", ax)


def test_a_raster_has_a_row_a_name_with_the_first_on_top(ax):
    events = {"one": [0.1, 0.2], "two": [], "three": [0.3]}
    assert plots.plot_raster(events, ax=ax) is ax
    assert [label.get_text() for label in ax.get_yticklabels()] == ["one", "two", "three"]
    assert ax.yaxis_inverted()
    assert [list(rows.get_positions()) for rows in ax.collections] == [[0.1, 0.2], [], [0.3]]
    assert [rows.get_lineoffset() for rows in ax.collections] == [0, 1, 2]
    assert ax.get_xlabel() == "time $t$ (s)"


def test_without_axes_new_ones_are_made(ball):
    for ax in (plots.plot_flow(ball, ["h"]), plots.plot_raster({"a": [1.0]})):
        assert ax.has_data()
        plt.close(ax.figure)


def test_a_figure_in_the_style_of_a_journal_is_the_same_bytes_each_time(ball, tmp_path):
    files = []
    for k in (1, 2):
        with mpl.rc_context(plots.JOURNAL):
            figure, ax = plt.subplots(figsize=(2.0, 1.5))
            plots.plot_flow(ball, ["h"], ax)
            files.append(tmp_path / f"{k}.svg")
            figure.savefig(files[-1], metadata={"Date": None})
            plt.close(figure)
    assert files[0].read_bytes() == files[1].read_bytes()
