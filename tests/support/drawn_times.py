"""Ascending times, drawn."""

import numpy as np
from hypothesis import strategies as st


@st.composite
def starts(draw, least=1):
    """Times at which rows begin, and how long the last one stays."""
    steps = draw(st.lists(st.floats(0.01, 3.0), min_size=least, max_size=7))
    return tuple(np.cumsum([draw(st.floats(-5.0, 5.0)), *steps])[:-1].tolist()), steps[-1]
