"""Figures of bounds: forms against a parameter, and how conservative each is."""

import numpy as np
import pytest

from hybrid_model.consensus.figures.conservatism import plot_conservatism


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
    dots = [float(found.get_xdata()[0]) for found in ax.lines if found.get_marker() in "ox"]
    np.testing.assert_allclose(dots, [10.0, 0.5, 10.0, 0.2])
    # What does not hold is a cross.
    crosses = [float(found.get_xdata()[0]) for found in ax.lines if found.get_marker() == "x"]
    np.testing.assert_allclose(crosses, [0.5, 0.2])
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
