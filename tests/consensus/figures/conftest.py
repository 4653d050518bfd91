"""Axes of a journal's column for the tests of figures."""

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import pytest

from hybrid_model.consensus.figures.style import COLUMN
from hybrid_model.plots import JOURNAL


@pytest.fixture
def ax():
    with plt.rc_context(JOURNAL):
        figure, axes = plt.subplots(figsize=COLUMN)
        yield axes
        plt.close(figure)
