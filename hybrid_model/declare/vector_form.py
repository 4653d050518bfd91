"""The maps of an automaton on vectors of floats: what executions evaluate.

An automaton's own maps take values by name. Here they take the vectors t, x, z, u, p of its layout; a kind of automaton
that knows a faster way to evaluate itself registers a vector form of its own with `vector_form`.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.layout import layout_of
from hybrid_model.declare.variables import FloatArray, Kind


class VectorForm:
    """The maps of an automaton, evaluated by calling them.

    Every method takes the time t in s and the vectors x (continuous states), z (discrete states), u (inputs) and p
    (parameters); results that are not finite are left to the caller.

    Parameters
    ----------
    automaton : Automaton
        Whose maps.
    """

    def __init__(self, automaton: Automaton) -> None:
        self.automaton = automaton
        self.layout = layout_of(automaton)

    def start(
        self, t: float, x: FloatArray, z: FloatArray, u: FloatArray, p: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return x and z with the computed start values in place."""
        new = self.automaton.start_values(self.layout.values(t, x, z, u, p))
        return self.layout.pack(Kind.STATE, new, x), self.layout.pack(Kind.DISCRETE, new, z)

    def rates(self, t: float, x: FloatArray, z: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """Return dx/dt, shape of x."""
        return self.layout.pack(Kind.STATE, self.automaton.derivatives(self.layout.values(t, x, z, u, p)))

    def margins(self, t: float, x: FloatArray, z: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """Return the margins of the jumps on state, in the automaton's order, and then of the flow set if there is one.

        The caller owns the array.
        """
        s = self.layout.values(t, x, z, u, p)
        margins = [float(margin) for margin in self.automaton.jump_margins(s)]
        if self.automaton.has_flow_set:
            margins.append(float(self.automaton.flow_margin(s)))
        return np.array(margins)

    def margins_along(
        self, times: FloatArray, x: FloatArray, z: FloatArray, u: Sequence[FloatArray], p: FloatArray
    ) -> FloatArray:
        """Return the margins at several times, shape (times, margins); x has shape (times, states)."""
        return np.array([self.margins(float(t), x[k], z, u[k], p) for k, t in enumerate(times)])

    def event_times(self, t: float, x: FloatArray, z: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """Return the absolute times in s of the jumps on time, in the order of the automaton's jumps."""
        times = self.automaton.event_times(self.layout.values(t, x, z, u, p))
        return np.array([float(time) for time in times])

    def reset(
        self, jump: int, t: float, x: FloatArray, z: FloatArray, u: FloatArray, p: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return x and z after jump number `jump`."""
        new = self.automaton.reset(jump, self.layout.values(t, x, z, u, p))
        return self.layout.pack(Kind.STATE, new, x), self.layout.pack(Kind.DISCRETE, new, z)


@functools.singledispatch
def vector_form(automaton: Automaton) -> VectorForm:
    """Return the maps of an automaton on vectors; they give the same numbers as its maps on values by name."""
    return VectorForm(automaton)
