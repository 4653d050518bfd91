"""How far samples may be from an exact run: measured against the samples themselves, so that no unit matters."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from hybrid_model.declare.variables import FloatArray, Kind
from hybrid_model.verification.subject import Subject, Tolerances

TIME, STATE = 1e-8, 1e-9
"""Parts of the length of the data, and of the size of a state."""
NOTHING = 1e-12
"""A state below this part of the largest one may be all rounding, and counts as large."""


class Slack:
    """The tolerances of one verification.

    Parameters
    ----------
    subject : Subject
        Automaton and samples.
    tolerances : Tolerances
        What was asked for; what it leaves open follows from the samples.

    Attributes
    ----------
    time : float
        In s.
    states, all_states : ndarray
        Absolute tolerance of each continuous state, and of the discrete ones after them.
    rtol : float
        Relative tolerance of states.
    length : float
        Of the data in s.
    """

    def __init__(self, subject: Subject, tolerances: Tolerances) -> None:
        known = subject.samples.t[np.isfinite(subject.samples.t)]
        self.length = float(np.ptp(known)) if known.size else 0.0
        latest = float(np.abs(known).max()) if known.size else 0.0
        self.time = tolerances.time or max(TIME * self.length, 8.0 * math.ulp(latest))
        self._declared, self.rtol = tolerances.atol, tolerances.rtol
        self.all_states = self._of_states(subject)
        self.states = self.all_states[: subject.x.shape[1]]

    def _of_states(self, subject: Subject) -> FloatArray:
        # A count beside a small current says nothing about the current.
        tables = {Kind.STATE: subject.x, Kind.DISCRETE: subject.z}
        return np.concatenate([self._of_kind(subject, kind, table) for kind, table in tables.items()])

    def _of_kind(self, subject: Subject, kind: Kind, table: FloatArray) -> FloatArray:
        if self._declared is not None:
            return np.full(table.shape[1], self._declared)
        sizes = np.where(np.isfinite(table), np.abs(table), 0.0).max(axis=0, initial=0.0)
        nominal = np.array([v.nominal or 0.0 for v in subject.automaton.of_kind(kind) for _ in range(v.size)])
        largest = float(sizes.max(initial=np.finfo(np.float64).tiny))
        return STATE * np.where(nominal > 0.0, nominal, np.where(sizes < NOTHING * largest, largest, sizes))

    def between(self, a: FloatArray, b: FloatArray) -> FloatArray:
        """Return how far two values of the continuous states, or of all states, may be apart."""
        return self.all_states[: len(a)] + self.rtol * np.maximum(np.abs(a), np.abs(b))

    def of_margins(self, margins: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
        """Return how far margins may be on the wrong side of zero: as much as they change with the states' tolerances.

        Parameters
        ----------
        margins : callable
            Continuous states -> margins, shape (m,).
        x : ndarray
            Where.
        """
        here = margins(x)
        if self._declared is not None:
            return np.full(here.shape, self._declared)
        alternating = np.where(np.arange(len(x)) % 2 == 0, 1.0, -1.0)
        moves = (1.0, -1.0, alternating, -alternating)
        with np.errstate(all="ignore"):
            # A margin may be infinite, or no number at a point moved.
            changes = np.array([np.abs(margins(x + move * self.states) - here) for move in moves])
        widest: FloatArray = np.max(np.where(np.isfinite(changes), changes, 0.0), axis=0)
        return widest
