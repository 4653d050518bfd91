"""Plots: what is drawn, read back from the axes, against the run itself and against closed forms."""

import re
import warnings

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model import plots
from hybrid_model.models import BouncingBall, Thermostat
from hybrid_model.plots.style import unit_text


@pytest.fixture(scope="module")
def ball():
    return hm.simulate(BouncingBall(), 2.0)


@pytest.fixture
def ax():
    figure, axes = plt.subplots()
    yield axes
    plt.close(figure)


@pytest.fixture
def solid():
    figure, axes = plt.subplots(subplot_kw={"projection": "3d"})
    yield axes
    plt.close(figure)


class Vector(hm.HybridAutomaton):
    w = hm.State([0.0, 1.0], unit="m/s2")

    def flow_map(self, s):
        return {"w": np.array([1.0, -1.0])}


class Drift(hm.HybridAutomaton):
    """Two states and no jump at all."""

    x = hm.State(0.0)
    y = hm.State(1.0)

    def flow_map(self, s):
        return {"x": s.y, "y": -s.x}


class Cascade(hm.HybridAutomaton):
    """At t = 1 s three jumps of one instant: n goes 0, 1, 2, 3."""

    x = hm.State(0.0)
    n = hm.DiscreteState(0)

    def flow_map(self, s):
        return {"x": 1.0}

    def jump_set(self, s):
        return hm.least(s.x - 1.0, 2.5 - s.n)

    def jump_map(self, s):
        return {"n": s.n + 1}


class Ticker(hm.HybridAutomaton):
    """x rises at 1/s, and falls by 1 each second; seven internal breakpoints a second leave it as it is."""

    x = hm.State(0.0)
    k = hm.DiscreteState(0)
    m = hm.DiscreteState(0)

    def flow_map(self, s):
        return {"x": 1.0}

    def tick_time(self, s):
        return 1.0 * (s.k + 1)

    def break_time(self, s):
        return (s.m + 1) / 7.0 + 0.01

    transitions = (
        hm.TimeEvent("tick", tick_time, lambda self, s: {"x": s.x - 1.0, "k": s.k + 1}),
        hm.TimeEvent("break", break_time, lambda self, s: {"m": s.m + 1}, internal=True),
    )


def runs():
    """One run of each kind: with jumps, without, with jumps of one instant, with a composition."""
    both = hm.Composition("both", {"left": Ticker(), "right": BouncingBall()})
    return {
        "ball": hm.simulate(BouncingBall(), 2.0),
        "no jumps": hm.simulate(BouncingBall(), 0.1),
        "no jump declared": hm.simulate(Drift(), 1.0),
        "an instant": hm.simulate(BouncingBall(), 0.0),
        "cascade": hm.simulate(Cascade(), 2.0),
        "both": hm.simulate(both, 2.5),
    }


@pytest.fixture(scope="module")
def arcs():
    return runs()


def every_plot(arc):
    """Each plot function as a function of the axes alone."""
    first, second = [v.name for v in arc.automaton.variables if v.kind.name in ("STATE", "DISCRETE")][:2]
    return {
        "flow": lambda ax: plots.plot_flow(arc, [first], ax),
        "over time": lambda ax: plots.plot_over_time(arc, ax=ax),
        "over jumps": lambda ax: plots.plot_over_jumps(arc, ax=ax),
        "phase": lambda ax: plots.plot_phase(arc, first, second, ax=ax),
        "hybrid arc": lambda ax: plots.plot_hybrid_arc(arc, first, ax=ax),
        "time domain": lambda ax: plots.plot_time_domain(arc, ax=ax),
        "raster": lambda ax: plots.plot_raster(arc, ax=ax),
        "gaps": lambda ax: plots.plot_inter_event_times(arc, ax=ax, bound=0.01),
        "margin": lambda ax: plots.plot_margin(arc, ax=ax),
        "threshold": lambda ax: plots.plot_threshold(arc, first, 0.5, ax=ax),
    }


PLOTS = list(every_plot(hm.simulate(BouncingBall(), 0.0)))


def drawn(ax, label):
    """Data of the line with this label, one column a coordinate."""
    line = next(line for line in ax.lines if line.get_label() == label)
    return np.stack(line.get_data_3d() if ax.name == "3d" else line.get_data(), axis=1).astype(float)


def pieces(data):
    """Parts of a line between its gaps."""
    gaps = np.flatnonzero(np.isnan(data).any(axis=1))
    return [part[~np.isnan(part).any(axis=1)] for part in np.split(data, gaps)]


def hybrid_samples(arc, name):
    """The samples (t, j, value) of each flow."""
    rows = np.stack([arc.t, arc.j, arc[name]], axis=1)
    return [rows[arc.j == j] for j in np.unique(arc.j)]


def rows_in(rows, data):
    return all(np.any(np.all(data == row, axis=1)) for row in rows)


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


def test_the_flows_over_time_hold_every_sample_and_the_run_in_between(ball, ax):
    assert plots.plot_over_time(ball, "h", ax=ax) is ax
    flows = pieces(drawn(ax, "h"))
    samples = hybrid_samples(ball, "h")
    assert len(flows) == len(ball.jumps) + 1 == len(samples)
    for flow, rows, jump in zip(flows[1:], samples[1:], ball.jumps, strict=True):
        assert rows_in(rows[:, [0, 2]], flow)
        assert len(flow) >= 8
        assert np.all(np.diff(flow[:, 0]) > 0.0)
        since = flow[:, 0] - jump.t
        # A parabola from the floor; DOP853 is exact for it up to rounding near 1.
        assert flow[:, 1] == pytest.approx(jump.x_after[1] * since - 9.81 / 2 * since**2, abs=1e-13)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("time $t$ (s)", "h (m)")


def test_jumps_over_time_are_dashed_from_an_open_to_a_filled_marker(ball, ax):
    plots.plot_over_time(ball, "v", ax=ax)
    before = np.array([[jump.t, jump.x_before[1]] for jump in ball.jumps])
    after = np.array([[jump.t, jump.x_after[1]] for jump in ball.jumps])
    np.testing.assert_array_equal(drawn(ax, "_before"), before)
    np.testing.assert_array_equal(drawn(ax, "_after"), after)
    leaps = [part for part in pieces(drawn(ax, "_jumps")) if len(part)]
    np.testing.assert_array_equal(leaps, np.stack([before, after], axis=1))
    look = {line.get_label(): line for line in ax.lines}
    assert look["_jumps"].is_dashed()
    assert not look["v"].is_dashed()
    assert look["_before"].get_markerfacecolor() == ax.get_facecolor()
    assert look["_after"].get_markerfacecolor() == look["v"].get_color()
    assert len({line.get_color() for line in ax.lines}) == 1


def test_each_jump_of_a_cascade_is_drawn(arcs, ax):
    plots.plot_over_time(arcs["cascade"], "n", ax=ax)
    t = arcs["cascade"].jumps[0].t
    np.testing.assert_array_equal(drawn(ax, "_before"), [[t, 0.0], [t, 1.0], [t, 2.0]])
    np.testing.assert_array_equal(drawn(ax, "_after"), [[t, 1.0], [t, 2.0], [t, 3.0]])
    assert [sorted(set(flow[:, 1])) for flow in pieces(drawn(ax, "n"))] == [[0.0], [1.0], [2.0], [3.0]]


def test_over_jumps_a_flow_stays_at_its_j_and_a_jump_leads_to_the_next(ball, ax):
    assert plots.plot_over_jumps(ball, "v", ax=ax) is ax
    for j, (flow, rows) in enumerate(zip(pieces(drawn(ax, "v")), hybrid_samples(ball, "v"), strict=True)):
        assert set(flow[:, 0]) == {j}
        assert rows_in(rows[:, [1, 2]], flow)
    np.testing.assert_array_equal(drawn(ax, "_before"), [[jump.j, jump.x_before[1]] for jump in ball.jumps])
    np.testing.assert_array_equal(drawn(ax, "_after"), [[jump.j + 1, jump.x_after[1]] for jump in ball.jumps])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("jumps $j$", "v (m/s)")
    assert all(tick == round(tick) for tick in ax.get_xticks())


def test_in_the_phase_plane_each_flow_keeps_its_energy(ball, ax):
    assert plots.plot_phase(ball, "h", "v", ax=ax) is ax
    line = next(line for line in ax.lines if line.get_label().startswith("_child"))
    flows = pieces(np.stack(line.get_data(), axis=1))
    assert len(flows) == len(ball.jumps) + 1
    for j, flow in enumerate(flows):
        # Energy per mass g h + v^2/2, with v -> -0.7 v at impacts; sums of numbers near 10.
        assert 9.81 * flow[:, 0] + flow[:, 1] ** 2 / 2 == pytest.approx(9.81 * 0.7 ** (2 * j), abs=1e-12)
    np.testing.assert_array_equal(drawn(ax, "_before"), [jump.x_before for jump in ball.jumps])
    np.testing.assert_array_equal(drawn(ax, "_after"), [jump.x_after for jump in ball.jumps])
    np.testing.assert_array_equal(drawn(ax, "start"), [[1.0, 0.0]])
    np.testing.assert_array_equal(drawn(ax, "end"), [[ball.end.h, ball.end.v]])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("h (m)", "v (m/s)")


class Oscillator(hm.HybridAutomaton):
    """A circle in metres and metres, and the same numbers in other units and sizes."""

    x = hm.State(1.0, unit="m")
    y = hm.State(0.0, unit="m")
    w = hm.State([1.0, 0.0])
    rate = hm.Output(unit="m/s")
    near = hm.Output()
    far = hm.Output()

    def flow_map(self, s):
        return {"x": s.y, "y": -s.x, "w": np.array([s.w[1], -s.w[0]])}

    def outputs(self, s):
        return {"rate": s.y, "near": 5.0 * s.x, "far": 100.0 * s.x}


@pytest.mark.parametrize(
    ("horizontal", "vertical", "equal"),
    [
        ("x", "y", True),
        ("w[1]", "w[2]", True),
        ("x", "rate", False),
        ("x", "near", False),
        ("w[1]", "near", True),
        ("near", "far", False),
        ("w[1]", "far", False),
    ],
)
def test_equal_units_have_equal_scales_in_the_phase_plane(horizontal, vertical, equal, ax):
    arc = hm.simulate(Oscillator(), 6.5)
    plots.plot_phase(arc, horizontal, vertical, ax=ax)
    ax.figure.canvas.draw()
    one = ax.transData.transform([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    # Pixels of a length of one along each axis.
    along = np.linalg.norm(one[1:] - one[0], axis=1)
    assert (along[0] == pytest.approx(along[1], rel=1e-9)) == equal
    # All of the run is seen.
    line = next(line for line in ax.lines if line.get_label().startswith("_child"))
    for values, (low, high) in zip(line.get_data(), (ax.get_xlim(), ax.get_ylim()), strict=True):
        assert low <= np.nanmin(values)
        assert np.nanmax(values) <= high


def test_equal_scales_in_axes_that_share_theirs():
    figure, both = plt.subplots(1, 2, sharex=True, sharey=True)
    for axes in both:
        plots.plot_phase(hm.simulate(Oscillator(), 6.5), "x", "y", ax=axes)
    figure.canvas.draw()
    one = both[1].transData.transform([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    assert one[1, 0] - one[0, 0] == pytest.approx(one[2, 1] - one[0, 1], rel=1e-9)
    plt.close(figure)


def test_a_second_run_in_the_phase_plane_does_not_double_the_legend(ball, ax):
    plots.plot_phase(ball, "h", "v", ax=ax)
    plots.plot_phase(hm.simulate(BouncingBall(h=2.0), 1.0), "h", "v", ax=ax)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["start", "end"]


def test_over_hybrid_time_in_three_dimensions(ball, solid):
    assert plots.plot_hybrid_arc(ball, "v", ax=solid) is solid
    for flow, rows in zip(pieces(drawn(solid, "v")), hybrid_samples(ball, "v"), strict=True):
        assert rows_in(rows, flow)
    np.testing.assert_array_equal(drawn(solid, "_before"), [[jump.t, jump.j, jump.x_before[1]] for jump in ball.jumps])
    np.testing.assert_array_equal(
        drawn(solid, "_after"), [[jump.t, jump.j + 1, jump.x_after[1]] for jump in ball.jumps]
    )
    assert [solid.get_xlabel(), solid.get_ylabel(), solid.get_zlabel()] == ["time $t$ (s)", "jumps $j$", "v (m/s)"]


def test_a_time_domain_is_a_stair(ball, ax):
    assert plots.plot_time_domain(ball, ax=ax) is ax
    flows = pieces(np.stack(ax.lines[0].get_data(), axis=1))
    edges = [0.0, *(jump.t for jump in ball.jumps), 2.0]
    assert [tuple(flow[0]) for flow in flows] == [(t, j) for j, t in enumerate(edges[:-1])]
    assert [tuple(flow[-1]) for flow in flows] == [(t, j) for j, t in enumerate(edges[1:])]
    assert len(drawn(ax, "_before")) == 0


def test_a_vector_is_drawn_by_elements_and_an_element_by_its_name(ax):
    arc = hm.simulate(Vector(), 1.0)
    plots.plot_over_time(arc, "w", ax=ax)
    for label, rising in (("w[1]", True), ("w[2]", False)):
        t, w = drawn(ax, label).T
        assert w == pytest.approx(t if rising else 1.0 - t, abs=1e-14)
    assert ax.get_ylabel() == "w[1], w[2] (m/s$^{2}$)"
    plots.plot_phase(arc, "w[1]", "w[2]", ax=ax)
    np.testing.assert_array_equal(drawn(ax, "end"), [arc.end.w])


def test_without_names_the_continuous_states_are_drawn_with_their_units(ball, ax):
    plots.plot_over_time(ball, ax=ax)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["h (m)", "v (m/s)"]
    assert ax.get_ylabel() == ""


def test_two_plots_in_one_pair_of_axes_keep_both_names(ball, ax):
    for _ in range(2):
        plots.plot_over_time(ball, "h", ax=ax)
    assert ax.get_ylabel() == "h (m)"
    plots.plot_over_time(ball, "v", ax=ax)
    assert ax.get_ylabel() == "h (m), v (m/s)"


def test_names_of_parts_are_in_the_legend_and_the_variable_on_the_axis(ax):
    pair = hm.Composition("pair", {"one": BouncingBall(), "two": BouncingBall(h=2.0)})
    plots.plot_over_time(hm.simulate(pair, 1.0), "one.h", "two.h", ax=ax)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["one", "two"]
    assert ax.get_ylabel() == "h (m)"


def test_jumps_of_other_parts_and_breakpoints_are_not_marked(arcs, ax):
    arc = arcs["both"]
    plots.plot_over_time(arc, "right.h", ax=ax)
    impacts = [jump.t for jump in arc.jumps if jump.name == "right.jump"]
    assert 0 < len(impacts) < len(arc.jumps)
    np.testing.assert_array_equal(drawn(ax, "_after")[:, 0], impacts)


@pytest.mark.parametrize(("jumps", "names"), [((), ()), (["left.tick"], ["left.tick"]), ("left.break", ["left.break"])])
def test_the_jumps_to_mark_can_be_named(arcs, ax, jumps, names):
    plots.plot_over_time(arcs["both"], "right.h", ax=ax, jumps=jumps)
    expected = [jump.t for jump in arcs["both"].jumps if jump.name in names]
    np.testing.assert_array_equal(drawn(ax, "_before")[:, 0], expected)


def test_many_jumps_are_not_marked_unless_they_are_named(ax):
    flights = 2.0 * np.sqrt(2.0 / 9.81)
    arc = hm.simulate(BouncingBall(e=1.0), 70 * flights)
    assert len(arc.jumps) == 70
    plots.plot_over_time(arc, "v", ax=ax)
    assert len(drawn(ax, "_before")) == 0
    assert sum(len(part) == 2 for part in pieces(drawn(ax, "_jumps"))) == 70
    ax.clear()
    plots.plot_over_time(arc, "v", ax=ax, jumps=["jump"])
    assert len(drawn(ax, "_before")) == 70


def test_options_of_lines_are_those_of_matplotlib(ball, ax):
    plots.plot_over_time(ball, "h", ax=ax, color="#123456", linewidth=3.0, alpha=0.5, label="height")
    assert {line.get_color() for line in ax.lines} == {"#123456"}
    assert {line.get_alpha() for line in ax.lines} == {0.5}
    assert (ax.lines[0].get_linewidth(), ax.lines[0].get_label()) == (3.0, "height")


def test_a_raster_of_a_run_has_its_jumps_without_breakpoints(arcs, ax):
    assert plots.plot_raster(arcs["both"], ax=ax) is ax
    assert [label.get_text() for label in ax.get_yticklabels()] == ["left.tick", "right.jump"]
    for rows, name in zip(ax.collections, ["left.tick", "right.jump"], strict=True):
        assert list(rows.get_positions()) == list(arcs["both"].event_times(name))


@pytest.mark.parametrize("plot", [plots.plot_raster, plots.plot_inter_event_times])
def test_events_are_shown_over_the_whole_run(ax, plot):
    plot(hm.simulate(Ticker(), 9.9), "tick", ax=ax)
    low, high = ax.get_xlim()
    assert -1.0 < low <= 0.0
    assert 9.9 <= high < 11.0


def test_legends_are_above_the_axes(arcs, solid, ax):
    for axes, draw in ((ax, plots.plot_over_time), (solid, lambda arc, ax: draw_twice(arc, ax))):
        draw(arcs["ball"], ax=axes)
        axes.figure.canvas.draw()
        assert axes.get_legend().get_window_extent().y0 >= axes.get_window_extent().y1 - 1.0  # a pixel


def draw_twice(arc, ax):
    for name in ("h", "v"):
        plots.plot_hybrid_arc(arc, name, ax=ax)


def test_a_raster_takes_names_and_options(arcs, ax):
    plots.plot_raster(arcs["both"], "left.break", ax=ax, colors="r", linelengths=0.2)
    (rows,) = ax.collections
    assert list(rows.get_positions()) == list(arcs["both"].event_times("left.break"))
    assert rows.get_linelength() == 0.2


def test_the_common_end_of_names_is_the_label_of_a_raster(ax):
    events = {f"agent{i}.trigger.broadcast": [float(i)] for i in range(1, 101)}
    plots.plot_raster(events, ax=ax)
    assert ax.get_ylabel() == "trigger.broadcast"
    shown = [label.get_text() for label in ax.get_yticklabels()]
    assert shown == [f"agent{i}" for i in range(1, 101, 3)]
    assert list(ax.get_yticks()) == list(range(0, 100, 3))


def test_inter_event_times_of_a_ball_fall_geometrically(ax):
    arc = hm.simulate(BouncingBall(), 2.5)
    assert plots.plot_inter_event_times(arc, ax=ax, bound=0.02) is ax
    t, gaps = drawn(ax, "jump").T
    assert list(t) == [jump.t for jump in arc.jumps[1:]]
    flights = 2.0 * np.sqrt(2.0 / 9.81) * 0.7 ** np.arange(1, len(gaps) + 1)
    # Differences of times near 1 that are located to a few ulp.
    assert gaps == pytest.approx(flights, abs=1e-12)
    assert ax.get_yscale() == "log"
    assert set(drawn(ax, "lower bound")[:, 1]) == {0.02}
    assert ax.get_ylim()[0] < gaps.min() < gaps.max() < ax.get_ylim()[1]


def test_events_at_one_instant_are_triangles_at_the_end_of_the_axis(ax):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plots.plot_inter_event_times({"a": [0.0, 1.0, 1.0, 3.0], "b": [2.0, 2.0], "c": [1.0], "d": []}, ax=ax)
        ax.figure.canvas.draw()
    np.testing.assert_array_equal(drawn(ax, "a"), [[1.0, 1.0], [3.0, 2.0]])
    for label, times in (("at one instant", [1.0]), ("_at one instant", [2.0])):
        line = next(line for line in ax.lines if line.get_label() == label)
        assert list(line.get_xdata()) == times
        _, heights = ax.transAxes.inverted().transform(line.get_transform().transform(line.get_xydata())).T
        # The lower end of the axes is zero up to the rounding of pixels.
        assert heights == pytest.approx([0.0], abs=1e-12)
    assert [len(drawn(ax, label)) for label in ("b", "c", "d")] == [0, 0, 0]


def test_equal_gaps_do_not_fill_the_axis_with_rounding(ax):
    plots.plot_inter_event_times(hm.simulate(Thermostat(), 300.0), ax=ax)
    low, high = ax.get_ylim()
    gaps = drawn(ax, "off")[:, 1]
    assert low < gaps.min() / 2.0
    assert high > gaps.max() * 2.0


def test_the_margin_of_a_ball_is_the_lesser_of_its_height_and_speed(ball, ax):
    assert plots.plot_margin(ball, ax=ax) is ax
    plots.plot_over_time(ball, ax=ax)
    margin, h, v = (drawn(ax, label) for label in ("jump", "h (m)", "v (m/s)"))
    np.testing.assert_array_equal(margin[:, 1], np.minimum(-h[:, 1], -v[:, 1]))
    before = drawn(ax, "_before")
    assert list(before[: len(ball.jumps), 0]) == [jump.t for jump in ball.jumps]
    # A jump happens at the first point where the margin is not negative.
    assert np.all((before[: len(ball.jumps), 1] >= 0.0) & (before[: len(ball.jumps), 1] < 1e-12))


def test_the_margin_of_a_jump_on_time_is_the_time_left(arcs, ax):
    plots.plot_margin(arcs["both"], "left.tick", ax=ax)
    t, margin = drawn(ax, "left.tick").T
    inside = np.abs(t - np.round(t)) > 1e-9
    # One subtraction of numbers up to 3.
    assert margin[inside] == pytest.approx((t - np.ceil(t))[inside], abs=1e-14)
    np.testing.assert_array_equal(drawn(ax, "_before"), [[1.0, 0.0], [2.0, 0.0]])
    np.testing.assert_array_equal(drawn(ax, "_after"), [[1.0, -1.0], [2.0, -1.0]])


def test_margins_of_a_composition_go_by_name(arcs, ax):
    plots.plot_margin(arcs["both"], "right.jump", "left.tick", ax=ax)
    single = hm.simulate(BouncingBall(), 2.5)
    times, margin = drawn(ax, "right.jump").T
    at = ~np.isin(times, arcs["both"].event_times("right.jump")) & ~np.isnan(times)
    expected = np.minimum(-single.at("h", times[at]), -single.at("v", times[at]))
    # Both runs are parabolas up to rounding, at speeds up to 4.4 m/s.
    assert margin[at] == pytest.approx(expected, abs=1e-12)


def test_an_error_meets_its_threshold_where_it_jumps(ax):
    room = hm.simulate(Thermostat(), 100.0)
    middle = lambda s: abs(s.temperature - 20.0)  # noqa: E731
    assert plots.plot_threshold(room, middle, lambda s: s.upper - 20.0, ax=ax, jumps=["off", "on"]) is ax
    t, error = drawn(ax, "error").T
    at = ~np.isnan(t)
    assert error[at] == pytest.approx(np.abs(room.at("temperature", t[at]) - 20.0), abs=1e-14)
    before = drawn(ax, "_before")
    assert list(before[:, 0]) == [jump.t for jump in room.jumps]
    # Located to a few ulp of t near 100 s, at less than 0.2 K/s.
    assert before[:, 1] == pytest.approx(1.0, abs=1e-12)
    assert set(drawn(ax, "threshold")[:, 1]) == {1.0}


@pytest.mark.parametrize("e", [0.7, 0.6, 0.5])
def test_impacts_are_marked_whatever_the_rounding_of_the_height(e):
    """Before an impact the height is zero, or off by a rounding; the drawing does not depend on which."""
    ball = hm.simulate(BouncingBall(e=e), 1.3)
    heights = [jump.x_before[0] for jump in ball.jumps]
    assert 0.0 < max(map(abs, heights)) < 1e-12
    figure, (name, height, speed) = plt.subplots(3)
    plots.plot_threshold(ball, "h", 0.5, ax=name)
    assert list(drawn(name, "_before")[:, 0]) == [jump.t for jump in ball.jumps]
    # As a function of values the height does not jump at all, the speed at every impact.
    plots.plot_threshold(ball, lambda s: s.h, 0.5, ax=height)
    assert len(drawn(height, "_before")) == 0
    plots.plot_threshold(ball, lambda s: s.v, 0.5, ax=speed)
    assert list(drawn(speed, "_before")[:, 0]) == [jump.t for jump in ball.jumps]
    plt.close(figure)


def test_an_error_and_its_threshold_may_be_variables_and_numbers(ball, ax):
    plots.plot_threshold(ball, "h", "e", ax=ax)
    assert set(drawn(ax, "e")[:, 1]) == {0.7}
    assert ax.get_ylabel() == "h (m)"
    plots.plot_threshold(ball, lambda s: s.v, 0.25, ax=ax)
    assert set(drawn(ax, "threshold")[:, 1]) == {0.25}
    assert len(drawn(ax, "error")) == len(drawn(ax, "h (m)"))


@pytest.mark.parametrize("kind", list(runs()))
@pytest.mark.parametrize("plot", PLOTS)
def test_every_plot_of_every_kind_of_run_is_drawn_without_a_word(arcs, kind, plot, monkeypatch):
    monkeypatch.setattr(plt, "show", lambda *a, **k: pytest.fail("a plot function has shown the figure"))
    settings = dict(mpl.rcParams)
    figure, given = plt.subplots(subplot_kw={"projection": "3d"} if plot == "hybrid arc" else None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert every_plot(arcs[kind])[plot](given) is given
        figure.canvas.draw()
        made = every_plot(arcs[kind])[plot](None)
        made.figure.canvas.draw()
    assert made.name == given.name
    assert len(made.lines) == len(given.lines)
    assert dict(mpl.rcParams) == settings
    plt.close(figure)
    plt.close(made.figure)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda arc: plots.plot_over_time(arc, "x"), "BouncingBall has no variable 'x'; it has h, v, g, e."),
        (lambda arc: plots.plot_over_time(arc, "x[1]"), "no variable 'x[1]'"),
        (lambda arc: plots.plot_over_time(arc, "h[1]"), "no element h[1]: h has shape ()"),
        (lambda arc: plots.plot_over_time(arc, ["h", "v"]), "write names one after the other"),
        (lambda arc: plots.plot_over_time(arc, "h", jumps=["bounce"]), "no jump 'bounce'; it has jump"),
        (lambda arc: plots.plot_over_jumps(arc, "x"), "no variable 'x'"),
        (lambda arc: plots.plot_phase(arc, "h", "x"), "no variable 'x'"),
        (lambda arc: plots.plot_hybrid_arc(arc, "x"), "no variable 'x'"),
        (lambda arc: plots.plot_hybrid_arc(arc, "h", jumps=["bounce"]), "'bounce'"),
        (lambda arc: plots.plot_time_domain(arc, jumps=["bounce"]), "'bounce'"),
        (lambda arc: plots.plot_raster(arc, "bounce"), "'bounce'"),
        (lambda arc: plots.plot_raster({"a": [1.0]}, "b"), "'b'; it has a"),
        (lambda arc: plots.plot_inter_event_times(arc, "bounce"), "'bounce'"),
        (lambda arc: plots.plot_inter_event_times(arc, bound=0.0), "the bound on inter-event times is 0.0 s"),
        (lambda arc: plots.plot_inter_event_times(arc, bound=np.nan), "positive"),
        (lambda arc: plots.plot_margin(arc, "bounce"), "'bounce'"),
        (lambda arc: plots.plot_threshold(arc, "x", 1.0), "no variable 'x'"),
        (lambda arc: plots.plot_threshold(arc, "h", lambda s: s.x), "no variable 'x'"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_sentence_before_a_figure_is_made(ball, call, words):
    open_figures = plt.get_fignums()
    with pytest.raises(hm.DeclarationError, match=re.escape(words)):
        call(ball)
    assert plt.get_fignums() == open_figures


@pytest.mark.parametrize(
    ("name", "words"),
    [("w[3]", "its elements are w[1] to w[2]"), ("w[0]", "no element w[0]"), ("w", "name an element, as in w[1]")],
)
def test_elements_that_are_not_there_and_vectors_where_a_number_is_wanted(name, words):
    arc = hm.simulate(Vector(), 1.0)
    with pytest.raises(hm.DeclarationError, match=re.escape(words)):
        plots.plot_phase(arc, name, "w[1]")


def test_axes_of_the_wrong_dimension_are_refused(ball, ax, solid):
    with pytest.raises(hm.DeclarationError, match="two-dimensional, but this plot has three"):
        plots.plot_hybrid_arc(ball, "h", ax=ax)
    with pytest.raises(hm.DeclarationError, match="three-dimensional, but this plot has two"):
        plots.plot_over_time(ball, "h", ax=solid)


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        ("m/s2", "m/s$^{2}$"),
        ("degC", "°C"),
        ("deg", "°"),
        ("kg.m2.s-2", "kg·m$^{2}$·s$^{-2}$"),
        ("1/s", "1/s"),
        ("V", "V"),
    ],
)
def test_units_are_written_as_a_reader_expects(unit, text):
    assert unit_text(unit) == text
