"""Figures of sweeps: what they show is what the table holds."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import LogNorm
from small_scenario import small_scenario

from hybrid_model.consensus.figures import study as module
from hybrid_model.consensus.figures.study import (
    label_of,
    plot_events_against_radius,
    plot_heat_map,
    save_study_figures,
)
from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.study import study
from hybrid_model.consensus.sweeps.table import SweepTable


@pytest.fixture
def table(tmp_path):
    """Tables with rows in closed form: no run is needed to see what is drawn."""
    path = tmp_path / "small.toml"
    path.write_text(small_scenario(kind="dynamic", more="decay = 0.02"))

    def make(vary, bounds=(), row=None, **options):
        given = study(path, vary, bounds=bounds, **options)
        made = SweepTable(tmp_path / f"{len(list(tmp_path.iterdir()))}.sqlite", given)
        made.write((run, (row or closed_form)(given.values(run))) for run in range(len(given)))
        return made

    yield make
    plt.close("all")


def closed_form(values):
    c, beta = values["trigger.threshold"], values.get("trigger.decay", 0.0)
    row = {"events": round(10 / c * (1 + beta)), "gap_min": c / 10, "radius.exact": 8 * c, "radius.observed": c}
    return row if beta < 0.05 else {"events": row["events"], "failure": "none"}


AXES = ["trigger.threshold=0.1:1:6:log", "trigger.decay=0:0.06:4"]


def test_a_map_has_the_values_of_the_grid_where_they_belong(table):
    made = table(AXES)
    ax = plot_heat_map(made, "events")
    mesh = ax.collections[0]
    shown = np.asarray(mesh.get_array()).reshape(4, 6)
    for i, beta in enumerate(np.linspace(0, 0.06, 4)):
        for k, c in enumerate(np.geomspace(0.1, 1, 6)):
            assert shown[i, k] == round(10 / c * (1 + beta))
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "linear")
    assert ax.get_xlabel() == "threshold $c$"
    assert "(1/s)" in ax.get_ylabel()
    assert mesh.get_cmap().name == "cividis"
    # Values over a decade are not many enough for a logarithmic scale.
    assert not isinstance(mesh.norm, LogNorm)
    turned = plot_heat_map(made, "events", "trigger.decay", "trigger.threshold")
    assert turned.get_xlabel() == ax.get_ylabel()
    assert pytest.approx(shown) == np.asarray(turned.collections[0].get_array()).reshape(6, 4).T


def test_ticks_of_a_map_stand_where_there_are_runs(table):
    ax = plot_heat_map(table(["trigger.threshold=0.1:1:6:log", "trigger.decay=0:0.048:13"]), "events")
    np.testing.assert_allclose(ax.get_xticks(), np.geomspace(0.1, 1, 6), rtol=1e-12)
    np.testing.assert_allclose(ax.get_yticks(), np.linspace(0, 0.048, 13)[::3], atol=1e-15)
    assert [text.get_text() for text in ax.get_yticklabels()] == ["0", "0.012", "0.024", "0.036", "0.048"]
    assert ax.get_xticks(minor=True).size == 0
    # Each in the middle of its cell, as the axis shows it.
    edges = np.log(ax.collections[0].get_coordinates()[0, :, 0])
    np.testing.assert_allclose((edges[1:] + edges[:-1]) / 2, np.log(np.geomspace(0.1, 1, 6)), atol=1e-12)


def test_points_without_a_value_are_crossed_out(table):
    ax = plot_heat_map(table(AXES), "gap_min")
    crosses = ax.lines[0]
    assert crosses.get_marker() == "x"
    assert set(crosses.get_ydata()) == {0.06}
    assert len(crosses.get_xdata()) == 6


def test_drawn_points_are_dots_and_repeats_count_by_their_mean(table):
    drawn = table(["trigger.threshold=0.1:1", "trigger.decay=0:0.04"], design="latin-hypercube", runs=20)
    dots = plot_heat_map(drawn, "events").collections[0]
    assert len(dots.get_offsets()) == 20
    rows = iter(range(8))
    repeated = table(
        ["trigger.threshold=0.1,0.2", "trigger.decay=0,0.01", "channel.seed=seeds"],
        row=lambda values: {"events": next(rows)},
        repeats=2,
    )
    mesh = plot_heat_map(repeated, "events").collections[0]
    assert np.asarray(mesh.get_array()).ravel().tolist() == [0.5, 4.5, 2.5, 6.5]


def test_what_a_radius_costs(table):
    made = table(AXES, bounds=["radius.observed", "radius.exact"])
    ax = plot_events_against_radius(made, 0.02)
    exact, observed = ax.lines
    assert (exact.get_label(), observed.get_label()) == ("exact", "observed")
    assert observed.get_linestyle() == "None"
    assert exact.get_xdata() == pytest.approx(8 * np.geomspace(0.1, 1, 6))
    assert (
        exact.get_ydata().tolist()
        == observed.get_ydata().tolist()
        == [round(10 / c * 1.02) for c in np.geomspace(0.1, 1, 6)]
    )
    assert ax.get_title() == r"$\beta=0.02$ 1/s"
    assert r"e^{\beta t}" in ax.get_xlabel()
    # The least decay if none is given; there the radius is one for all time.
    assert r"e^{\beta t}" not in plot_events_against_radius(made).get_xlabel()


def test_what_cannot_be_drawn_is_refused(table):
    made = table(["trigger.threshold=0.1:1:3"])
    for call, message in (
        (lambda: plot_heat_map(made, "events"), "two keys with numbers that vary; the sweep has trigger.threshold"),
        (lambda: plot_heat_map(table(AXES), "settling"), "has no number in any run"),
        (lambda: plot_heat_map(table(AXES), "stop"), "is no column with numbers"),
        (lambda: plot_events_against_radius(made), "give both"),
        (lambda: plot_events_against_radius(table(AXES, bounds=["radius.exact"]), 0.5), "it takes the values 0, 0.02"),
    ):
        with pytest.raises(SweepError, match=message):
            call()


def test_files_for_all_that_is_there(table, tmp_path, monkeypatch):
    one = table(["trigger.threshold=0.1:1:3"], bounds=["radius.exact"])
    written = save_study_figures(one, tmp_path / "figures")
    assert [path.name for path in written] == ["events-against-radius.png", "events-against-radius.pdf"]
    assert all(path.stat().st_size > 5000 for path in written)
    assert save_study_figures(table(["trigger.threshold=0.1:1:3"]), tmp_path / "none") == []
    # Which others there are is seen without writing them.
    monkeypatch.setattr(module, "save_figures", lambda figures, folder: list(figures))
    made = table(AXES, bounds=["radius.exact", "rate.floquet"])
    assert save_study_figures(made, tmp_path) == [
        "map-events", "map-gap_min", "map-radius.exact", "events-against-radius"
    ]  # fmt: skip


def test_labels_have_units():
    assert label_of("rate.floquet") == "Floquet rate (1/s)"
    assert label_of("gap_min") == "shortest gap (s)"
    assert label_of("weights.value") == "weights.value"
