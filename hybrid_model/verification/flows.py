"""Check the flows of samples: where they run, and whether the flow map leads from each sample to the next."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from hybrid_model.declare.transitions import Priority
from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import SimulationError
from hybrid_model.verification.report import Findings
from hybrid_model.verification.slack import Slack
from hybrid_model.verification.subject import Subject

METHODS = ("RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA")
"""Integrators of ``scipy.integrate.solve_ivp``."""
BETWEEN = 9
"""Points between two samples at which the sets are checked."""
INTEGRATION = 1e-4
"""Tolerance of the integration as a part of that of the comparison, so that its error does not count."""
EXPLICIT_STEP = 1e-10
"""Flows shorter than this part of the data are one Euler step: its error is of the square of that."""

Path = Callable[[float], FloatArray]


class FlowMapError(Exception):
    """The flow map cannot be integrated from a sample: the sentence says why."""


class FlowCheck:
    """Checks one stretch of samples of equal j after the other.

    Parameters
    ----------
    subject : Subject
        Automaton and samples.
    slack : Slack
        How far samples may be from an exact run.
    findings : Findings
        Where violations go.
    method : str
        One of `METHODS`.
    note : callable
        Called once for each step from a sample to the next, and once more for the sets at its start if time goes on.

    Raises
    ------
    SimulationError
        If the method is none of these.
    """

    def __init__(
        self, subject: Subject, slack: Slack, findings: Findings, method: str, note: Callable[[], object]
    ) -> None:
        if method not in METHODS:
            raise SimulationError(f"verify was given method = {method!r}: the methods are {', '.join(METHODS)}.")
        self._subject = subject
        self._slack, self._findings = slack, findings
        self._method, self._note = method, note
        automaton = subject.automaton
        self._guards = subject.guards if automaton.priority is Priority.JUMP else []

    def check(self, first: int, last: int) -> None:
        """Check the flow that is made of the samples `first` to `last`.

        A flow of length zero belongs to jumps alone, and nothing is asked of where a run's last jump lands.
        """
        self._constant_discrete_states(first, last)
        t = self._subject.samples.t
        if t[last] > t[first]:
            for k in range(first, last + 1):
                self._sets_at(k, flows_on=bool(t[k] < t[last]))
                if k < last:
                    self._note()
        for k in range(first, last):
            self._time_events(k)
        self._along(first, last)

    def _constant_discrete_states(self, first: int, last: int) -> None:
        names = self._subject.names[self._subject.x.shape[1] :]
        for k in range(first, last):
            changed = np.flatnonzero(self._subject.z[k] != self._subject.z[k + 1])
            if changed.size:
                i = changed[0]
                self._findings.add(
                    k + 1,
                    1,
                    f"discrete state {names[i]}",
                    f"{names[i]} changes from {self._subject.z[k, i]:.9g} to {self._subject.z[k + 1, i]:.9g} without a "
                    "jump: discrete states are constant along flows.",
                )

    def _time_events(self, k: int) -> None:
        end = self._subject.samples.t[k + 1]
        for index, time in zip(self._subject.timed, self._subject.event_times(k), strict=True):
            # Written so that a time that is not a number is reported as well.
            if not time >= end - self._slack.time:
                name = self._subject.automaton.jumps[index].name
                self._findings.add(
                    k + 1, 5, f"time event {name}", f"time event {name!r} was due at {time:.9g} s and is passed by."
                )

    def _badness(self, t: float, x: FloatArray, k: int) -> FloatArray:
        """Return numbers that must not be positive in a flow: how far out of C, and how far in each jump's set."""
        row = [-self._subject.flow_margin(t, x, k)]
        return np.array([*row, *self._subject.jump_margins(t, x, k)] if self._guards else row)

    def _allowed(self, t: float, x: FloatArray, k: int) -> FloatArray:
        return self._slack.of_margins(lambda moved: self._badness(t, moved, k), x)

    def _report_sets(self, k: int, t: float, x: FloatArray, badness: FloatArray) -> None:
        if np.all(badness <= 0.0):
            return
        # Written so that a margin that is not a number is reported as well.
        for row in np.flatnonzero(~(badness <= self._allowed(t, x, k))):
            if row == 0:
                self._findings.add(
                    k, 2, "flow set", f"the flow is outside the flow set at t = {t:.9g} s: margin {-badness[0]:.3g}."
                )
            else:
                name = self._subject.automaton.jumps[self._guards[row - 1]].name
                self._findings.add(
                    k,
                    3,
                    f"missed {name}",
                    f"jump {name!r} is due at t = {t:.9g} s, with margin {badness[row]:.3g}, but the flow goes on.",
                )

    def _sets_at(self, k: int, *, flows_on: bool) -> None:
        """Check a sample of a flow; a time tolerance to either side, what is bad must be bad throughout."""
        rows = np.array([self._badness(*point, k) for point in nearby(self._subject, k, self._slack.time)])
        badness = np.min(rows, axis=0)
        if not flows_on:
            # The last sample of a flow may lie in the jump set.
            badness[1:] = -math.inf
        self._report_sets(k, float(self._subject.samples.t[k]), self._subject.x[k], badness)

    def _along(self, first: int, last: int) -> None:
        """Integrate along the flow; from the first sample on that does not fit, from each sample to the next.

        In a long flow errors may grow, so only one step decides.
        """
        try:
            path = self._path(first, last)
        except FlowMapError:
            fits_upto = first
        else:
            fits_upto = next((k for k in range(first, last) if not self._arrives(k + 1, path)), last)
            for k in range(first, fits_upto):
                self._between(k, path)
                self._note()
        for k in range(fits_upto, last):
            self._note()
            try:
                path = self._path(k, k + 1)
            except FlowMapError as error:
                self._findings.add(k, 10, "flow map", str(error))
                continue
            self._between(k, path)
            self._arrives(k + 1, path, report=True)

    def _arrives(self, k: int, path: Path, *, report: bool = False) -> bool:
        found, expected = self._subject.x[k], path(float(self._subject.samples.t[k]))
        allowed = self._slack.between(found, expected)
        wrong = np.flatnonzero(~(np.abs(found - expected) <= allowed))
        if wrong.size and report:
            i = wrong[np.argmax(np.abs(found - expected)[wrong] / allowed[wrong])]
            self._findings.add(
                k,
                2,
                "flow map",
                f"{self._subject.names[i]} is {found[i]:.12g}, but the flow map leads from the sample before to "
                f"{expected[i]:.12g}.",
            )
        return not wrong.size

    def _between(self, k: int, path: Path) -> None:
        """Check the sets between two samples, also where a margin peaks between the points that are looked at."""
        t0, t1 = (float(t) for t in self._subject.samples.t[k : k + 2])
        margin = self._slack.time
        if t1 - t0 <= 4.0 * margin or not (self._guards or self._subject.automaton.has_flow_set):
            return
        times = np.linspace(t0 + margin, t1 - margin, BETWEEN)
        table = np.array([self._badness(float(t), path(float(t)), k) for t in times])
        for row in range(table.shape[1]):
            self._report_worst(k, times, table[:, row], row, path)

    def _report_worst(self, k: int, times: FloatArray, badness: FloatArray, row: int, path: Path) -> None:
        top = int(np.argmax(badness))
        t, worst = float(times[top]), badness[top]
        if 0 < top < len(times) - 1 and math.isfinite(worst) and worst <= self._allowed(t, path(t), k)[row]:
            fall = worst - min(badness[top - 1], badness[top + 1])
            # The peak of a parabola through the three lies above by less than a quarter of the fall.
            if worst + fall > 0.0:
                from scipy.optimize import minimize_scalar

                found = minimize_scalar(
                    lambda time: -self._badness(float(time), path(float(time)), k)[row],
                    bounds=(times[top - 1], times[top + 1]),
                    method="bounded",
                    options={"xatol": self._slack.time},
                )
                t, worst = float(found.x), max(worst, -float(found.fun))
        full = np.full(1 + len(self._guards), -math.inf)
        full[row] = worst
        self._report_sets(k, t, path(t), full)

    def _path(self, first: int, last: int) -> Path:
        """Integrate from one sample to another, never across a breakpoint of an input."""
        t = self._subject.samples.t
        inside = self._subject.breakpoints
        inside = inside[(inside > t[first]) & (inside < t[last])]
        edges = [float(t[first]), *inside.tolist(), float(t[last])]
        x = self._subject.x[first]
        legs: list[Path] = []
        for a, b in itertools.pairwise(edges):
            # The last sample at a or before it gives inputs and discrete states.
            k = min(max(int(np.searchsorted(t[first : last + 1], a, side="right")) - 1 + first, first), last)
            legs.append(self._leg(a, b, x, k))
            x = legs[-1](b)

        def path(time: float) -> FloatArray:
            return legs[min(max(int(np.searchsorted(edges, time, side="left")) - 1, 0), len(legs) - 1)](time)

        return path

    def _leg(self, a: float, b: float, x: FloatArray, k: int) -> Path:
        # Inputs are continuous from the right: the end of a leg belongs to the left.
        last = float(np.nextafter(b, -np.inf))

        def rates(t: float, y: FloatArray) -> FloatArray:
            result = self._subject.rates(min(t, last), y, k)
            if not np.all(np.isfinite(result)):
                raise FlowMapError(f"the flow map gives numbers that are not finite at t = {t:.9g} s.")
            return result

        if len(x) == 0:
            return lambda t: x
        if b - a <= EXPLICIT_STEP * self._slack.length or b - a <= 64.0 * math.ulp(a):
            slope = rates(a, x)
            return lambda t: x + (t - a) * slope
        options = {"rtol": max(INTEGRATION * self._slack.rtol, 3e-14), "atol": INTEGRATION * self._slack.states}
        from scipy.integrate import solve_ivp

        solution = solve_ivp(rates, (a, b), x, method=self._method, dense_output=True, **options)
        if solution.status != 0:
            raise FlowMapError(f"{self._method} cannot follow the flow map from t = {a:.9g} s: {solution.message}")
        dense = solution.sol
        return lambda t: np.asarray(dense(t))


def nearby(subject: Subject, k: int, distance: float) -> list[tuple[float, FloatArray]]:
    """Return a sample and the points of the flow through it shortly before and after, as (t, x)."""
    t, x = float(subject.samples.t[k]), subject.x[k]
    rates = subject.rates(t, x, k)
    if not np.all(np.isfinite(rates)):
        return [(t, x)]
    return [(t + shift, x + shift * rates) for shift in (0.0, -distance, distance)]
