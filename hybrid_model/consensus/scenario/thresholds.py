"""Thresholds of the triggers, in a form that runs on floats and arrays and traces on symbols."""

from __future__ import annotations

import numpy as np

from hybrid_model.declare.variables import Value


def exponential_threshold(threshold: Value, decay: Value, t: Value) -> Value:
    """Return ``c exp(-beta t)``, the threshold of the dynamic trigger (paper, section 4; beta = 0 is the static one).

    Parameters
    ----------
    threshold, decay : float, array or symbol
        c, in the unit of the states, and beta in 1/s.
    t : float, array or symbol
        Time in s.
    """
    return threshold * np.exp(-decay * t)


def mixed_threshold(offset: Value, threshold: Value, decay: Value, t: Value) -> Value:
    """Return ``c0 + c1 exp(-beta t)`` (Seyboth, Dimarogonas, Johansson, Automatica 49 (2013) 245-252).

    Parameters
    ----------
    offset, threshold, decay : float, array or symbol
        c0 and c1, in the unit of the states, and beta in 1/s.
    t : float, array or symbol
        Time in s.
    """
    return offset + exponential_threshold(threshold, decay, t)
