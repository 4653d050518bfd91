"""Hybrid arcs: the result of a run on hybrid time (t, j)."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.calls import explained
from hybrid_model.declare.real_numbers import real_array, told
from hybrid_model.declare.variables import FloatArray, Kind, Values, Variable, element_names, unknown_name
from hybrid_model.errors import DataError, DeclarationError
from hybrid_model.record.arc_file import read_record, write_record
from hybrid_model.record.arc_tables import dataframe, dataset
from hybrid_model.record.column_files import ENDINGS, replaced, write_columns
from hybrid_model.record.flow_points import ends_of, held_in, sampled, sampled_states, starts_of, states_at
from hybrid_model.record.flow_record import FlowRecord
from hybrid_model.record.jump_record import JumpRecord
from hybrid_model.record.row_flows import RowJumps
from hybrid_model.record.run_record import RunRecord
from hybrid_model.record.samples import Samples

Interval = tuple[float, float]


class HybridArc:
    """A run of an automaton: its samples on hybrid time, its jumps, and why it ended.

    Parameters
    ----------
    record : RunRecord
        What the run has left.

    Attributes
    ----------
    stop : Stop
        Why the run ended; its value is the remedy. A restricted arc keeps the reason of the whole run.
    message : str
        The particulars of the end, with names and numbers.
    event_tolerance : float
        Longest time in s that the run has taken for one instant, see `Solver`.
    engine : str
        Which engine ran, and why, in one sentence; empty for an arc from a file.
    statistics : RunStatistics or None
        Steps, evaluations and the like, where the native engine ran.
    automaton : Automaton
        What ran. That of a loaded arc has names, variables and jumps, but no maps.
    """

    def __init__(self, record: RunRecord) -> None:
        self._record, self._read, self._flows = record, record.read, record.flows
        self.automaton: Automaton = record.read.automaton
        self.stop, self.message, self.event_tolerance = record.stop, record.message, record.event_tolerance
        self.engine, self.statistics = record.engine, record.statistics

    # Computed when they are first asked for: a run may be wanted for its jumps, or for its end.

    @functools.cached_property
    def _starts(self) -> FloatArray:
        return starts_of(self._flows)

    @functools.cached_property
    def _ends(self) -> FloatArray:
        return ends_of(self._flows)

    @functools.cached_property
    def _sampled(self) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        return sampled(self._flows)

    @property
    def _numbers(self) -> npt.NDArray[np.int64]:
        return self._sampled[1]

    @property
    def t(self) -> FloatArray:
        """Times in s of the samples: every solver step and both sides of every jump."""
        return self._sampled[0]

    @functools.cached_property
    def j(self) -> npt.NDArray[np.int64]:
        """Jump counts of the samples."""
        return self._record.first_j + self._numbers

    @functools.cached_property
    def jumps(self) -> list[JumpRecord]:
        """The jumps in order, with the states on both sides."""
        return list(self._record.jumps)

    def __repr__(self) -> str:
        return (
            f"HybridArc({self.automaton.name}: t from {self.t[0]:g} to {self.t[-1]:g} s, {len(self._flows) - 1} jumps, "
            f"{self.stop.name})"
        )

    def __getattr__(self, name: str) -> Any:
        automaton = vars(self).get("automaton")
        if automaton is not None and any(name == variable.name for variable in automaton.variables):
            raise DeclarationError(f"a run has no attribute {name!r}: write arc[{name!r}] for the samples of {name}.")
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)

    def __getitem__(self, name: str) -> FloatArray:
        """Return a variable's samples, shape (n, *shape): a state, input, parameter or output, or ``v[1]`` of them."""
        return self._column(name, self.t, self._numbers, lambda part: sampled_states(self._flows, part))

    def variable(self, name: str) -> Variable:
        """Return the declaration of a variable: its unit, description, shape.

        Raises
        ------
        DeclarationError
            For an unknown name.
        """
        return self._read.variable(name)

    def at(self, name: str, t: npt.ArrayLike, *, before: bool = False, j: npt.ArrayLike | None = None) -> FloatArray:
        """Return a variable at given times, interpolated by the solver's dense output.

        Parameters
        ----------
        name : str
            A variable of the automaton, or an element of one, counted from 1 as in FMUs and plots: ``v[1]``.
        t : float or array_like, any shape
            Times in s within the run.
        before : bool
            At the time of a jump return the value before it (in a cascade, before the first); default: after the last
            jump at that time.
        j : int or array_like, any shape, optional
            Jump counts: the value at hybrid time (t, j), so that every side of every jump of a cascade can be had.

        Returns
        -------
        ndarray
            Shape of `t` (with `j`: what both broadcast to) followed by the variable's shape.

        Raises
        ------
        DeclarationError
            For an unknown name or a hybrid time outside the run.
        """
        shape = self.variable(name).shape
        times = _times(t)
        if j is None:
            self._require_inside(times)
            numbers = self._numbers_at(times.ravel(), before)
        else:
            times, counts = np.broadcast_arrays(times, np.asarray(j))
            pairs = zip(times.ravel(), counts.ravel(), strict=True)
            numbers = np.array([self._number_on(float(time), count) for time, count in pairs], dtype=np.int64)
        flat = times.ravel()
        values = self._column(name, flat, numbers, lambda part: states_at(self._flows, numbers, flat, part))
        return values.reshape(times.shape + shape)

    def _column(
        self,
        name: str,
        times: FloatArray,
        numbers: npt.NDArray[np.int64],
        states: Callable[[slice], FloatArray],
    ) -> FloatArray:
        """Return a variable at times (s) in the flows of those numbers, where `states` gives a part of the states."""
        part = self._read.part(name)
        if part is None:
            return self._read.column(name, times, states(slice(None)), held_in(self._flows, numbers))
        # Of a large network one state is read at the cost of one, not of all.
        variable = self.variable(name)
        values = held_in(self._flows, numbers, part) if variable.kind is Kind.DISCRETE else states(part)
        return values.reshape(len(times), *variable.shape)

    # Parts of a run.

    def restrict(self, *, t: Interval | None = None, j: Interval | None = None) -> HybridArc:
        """Return the part of the run in an interval of t, of j, or of both, on the same hybrid time.

        Parameters
        ----------
        t : (float, float), optional
            Closed interval in s: jumps at its ends belong to it with both sides. Flows are cut by their dense output.
        j : (int, int), optional
            First and last jump count kept: flows number `j[0]` to `j[1]` and the jumps between them.

        Returns
        -------
        HybridArc
            With the jump counts of the whole run, and its `stop` and `message`.

        Raises
        ------
        DeclarationError
            For an interval whose end is not at or after its start, or in which nothing of the run lies.
        """
        a, b = _interval("t", t)
        first, last = _interval("j", j)
        counts = self._record.first_j + np.arange(len(self._flows))
        inside = (first <= counts) & (counts <= last) & (self._ends >= a) & (self._starts <= b)
        kept = [int(k) for k in np.flatnonzero(inside)]
        if not kept:
            raise DeclarationError(
                f"nothing of the run lies in t = [{a:g}, {b:g}] s and j = [{first:g}, {last:g}]: it covers "
                f"t = [{self.t[0]:g}, {self.t[-1]:g}] s and j = [{self.j[0]}, {self.j[-1]}]."
            )
        return HybridArc(
            replace(
                self._record,
                flows=[self._flows[k].cut(a, b) for k in kept],
                jumps=self.jumps[kept[0] : kept[-1]],
                first_j=self._record.first_j + kept[0],
            )
        )

    def resample(self, grid: npt.ArrayLike, names: Iterable[str] | None = None, *, both_sides: bool = False) -> Samples:
        """Return variables at given times.

        Parameters
        ----------
        grid : array_like, shape (n,)
            Times in s within the run.
        names : iterable of str, optional
            Which variables; default: all but the parameters that are fixed for a run.
        both_sides : bool
            Whether a time at which the run jumps gives two rows, before its first and after its last jump there;
            default: one row, after the last.

        Returns
        -------
        Samples
            With the jump count of every row.

        Raises
        ------
        DeclarationError
            For an unknown name or a time outside the run.
        """
        times = np.atleast_1d(_times(grid))
        self._require_inside(times)
        after = np.searchsorted(self._starts, times, side="right") - 1
        if both_sides:
            before = np.minimum(np.searchsorted(self._ends, times, side="left"), after)
            rows = np.where(before < after, 2, 1)
            times, number = np.repeat(times, rows), np.repeat(after, rows)
            # The first of two rows.
            firsts = np.cumsum(rows) - rows
            number[firsts] = before
        else:
            number = after
        values = self._table(names, times, states_at(self._flows, number, times), held_in(self._flows, number))
        return Samples(times, number + self._record.first_j, values)

    def samples(self, names: Iterable[str] | None = None) -> Samples:
        """Return the run's own samples: every solver step and both sides of every jump.

        Parameters
        ----------
        names : iterable of str, optional
            Which variables; default: all but the parameters that are fixed for a run.
        """
        held = held_in(self._flows, self._numbers)
        return Samples(self.t.copy(), self.j.copy(), self._table(names, self.t, sampled_states(self._flows), held))

    # Jumps and lengths.

    def event_times(self, name: str | None = None) -> FloatArray:
        """Return the times of jumps.

        Parameters
        ----------
        name : str, optional
            Only jumps of this name; default: all jumps but those declared internal.

        Returns
        -------
        ndarray, shape (number of such jumps,)
            In s.

        Raises
        ------
        DeclarationError
            If no jump has that name.
        """
        if name is None:
            internal = {info.name for info in self.automaton.jumps if info.internal}
            return np.array([jump.t for jump in self.jumps if jump.name not in internal])
        if name not in [info.name for info in self.automaton.jumps]:
            known = {info.name: info for info in self.automaton.jumps}
            raise DeclarationError(unknown_name(self.automaton.name, name, known, "jump"))
        jumps = self._record.jumps
        if isinstance(jumps, RowJumps):
            return jumps.times(name)
        return np.array([jump.t for jump in jumps if jump.name == name])

    @property
    def flow_lengths(self) -> FloatArray:
        """Length in s of the flow at each j, shape (number of jumps + 1,); zero inside a cascade."""
        return self._ends - self._starts

    def inter_event_times(self, name: str | None = None) -> FloatArray:
        """Return the times in s between successive jumps.

        Parameters
        ----------
        name : str, optional
            As for `event_times`.
        """
        return np.diff(self.event_times(name))

    def before(self, jump: JumpRecord) -> Values:
        """Return all values just before a jump of this arc; DeclarationError for what is no jump."""
        flow = self._flow_of(_index_of(jump))
        return self._read.values(flow.t1, flow.at(flow.t1), flow.z)

    def after(self, jump: JumpRecord) -> Values:
        """Return all values just after a jump of this arc; DeclarationError for what is no jump."""
        flow = self._flow_of(_index_of(jump) + 1)
        return self._read.values(flow.t0, flow.x0, flow.z)

    @property
    def end(self) -> Values:
        """All values at the end of the run."""
        flow = self._flows[-1]
        return self._read.values(flow.t1, flow.at(flow.t1), flow.z)

    def interpolation_error(self, name: str) -> FloatArray:
        """Return how far interpolated values may lie from the solver's dense output, in the variable's unit and shape.

        Zero in a run. In an arc from a file the largest error seen when it was saved: rounding, but for variables with
        fast oscillations or discontinuities inside a step.
        """
        return self._read.interpolation_error(name)

    # Other forms.

    def to_dataframe(self, names: Iterable[str] | None = None) -> Any:
        """Return the samples as a pandas DataFrame, see `hybrid_model.record.arc_tables.dataframe`."""
        return dataframe(self._record, self.samples(names))

    def to_xarray(self, names: Iterable[str] | None = None) -> Any:
        """Return the samples as an xarray Dataset, see `hybrid_model.record.arc_tables.dataset`."""
        return dataset(self._record, self.samples(names))

    def save(self, path: str | Path) -> None:
        """Write the arc to a file, in a folder made if need be; its name decides in which form.

        Parameters
        ----------
        path : str or Path
            ``*.npz``: the complete arc, which `load_arc` reads, see `hybrid_model.record.arc_file`. The samples alone:
            ``*.csv``, which `Samples.from_csv` reads, ``*.mat`` for MATLAB and Octave, ``*.nc``, netCDF-3, which
            xarray opens; see `hybrid_model.record.column_files`.

        Raises
        ------
        DataError
            For a name with another ending.
        """
        ending = Path(path).suffix.lower()
        if ending == ".csv":
            with replaced(Path(path)) as part:
                self.samples().to_csv(part)
        elif ending == ".npz":
            with replaced(Path(path)) as part:
                write_record(self._record, part)
        elif ending in ENDINGS:
            samples = self.samples()
            units = {e: v.unit for v in map(self._read.variable, samples.values) for e in element_names(v)}
            about = {"automaton": self.automaton.name, "stop": self.stop.name, "message": self.message}
            write_columns(path, {"t": samples.t, "j": samples.j, **samples.columns()}, {"t": "s", **units}, about)
        else:
            raise DataError(
                f"{path} ends in {ending!r}, but an arc is saved as .npz, which hm.load_arc reads, or as .csv, .mat or "
                ".nc, its samples alone: give one of these endings."
            )

    def _table(self, names: Iterable[str] | None, t: FloatArray, x: FloatArray, z: FloatArray) -> dict[str, FloatArray]:
        # Parameters are told once, but for those that may change.
        told = [v.name for v in self.automaton.variables if v.tunable or v.kind is not Kind.PARAMETER]
        chosen = told if names is None else names
        return {name: self._read.column(name, t, x, z) for name in chosen}

    def _require_inside(self, times: FloatArray) -> None:
        # Written so that a time that is not a number is outside as well.
        if times.size and not (times.min() >= self.t[0] and times.max() <= self.t[-1]):
            raise DeclarationError(
                f"a time in [{times.min():g}, {times.max():g}] s lies outside the run, "
                f"which covers [{self.t[0]:g}, {self.t[-1]:g}] s."
            )

    def _numbers_at(self, times: FloatArray, before: bool) -> npt.NDArray[np.int64]:
        if before:
            at = np.searchsorted(self._ends, times, side="left")
        else:
            at = np.searchsorted(self._starts, times, side="right") - 1
        return np.clip(at, 0, len(self._flows) - 1)

    def _number_on(self, t: float, j: Any) -> int:
        number = self._number_of(j)
        if not self._starts[number] <= t <= self._ends[number]:
            raise DeclarationError(
                f"hybrid time (t, j) = ({t:.9g} s, {j}) lies outside the run: at j = {j} it covers "
                f"[{self._starts[number]:.9g}, {self._ends[number]:.9g}] s."
            )
        return number

    def _flow_of(self, j: Any) -> FlowRecord:
        return self._flows[self._number_of(j)]

    def _number_of(self, j: Any) -> int:
        number = j - self._record.first_j
        if not 0 <= number < len(self._flows) or number != int(number):
            raise DeclarationError(f"the run has no jump count j = {j}: it covers {self.j[0]} to {self.j[-1]}.")
        return int(number)


@explained(DataError)
def load_arc(path: str | Path) -> HybridArc:
    """Read an arc that `HybridArc.save` has written.

    The arc answers all that the saved one does, samples bit by bit and interpolated values to rounding. Its automaton
    has names, variables and jumps; its maps are not in the file and say so when they are called.

    Parameters
    ----------
    path : str or Path
        The file.

    Returns
    -------
    HybridArc

    Raises
    ------
    DataError
        If the file is no saved arc, is damaged, or has a version of the schema that this package does not know.
    MissingFileError
        If there is no file; it is a DataError and Python's FileNotFoundError.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise DataError(f"load_arc was given {told(path)}: give the path of a file that HybridArc.save has written.")
    return HybridArc(read_record(Path(path)))


def _times(given: npt.ArrayLike) -> FloatArray:
    try:
        return real_array(given)
    except (TypeError, ValueError, OverflowError) as error:
        raise DeclarationError(f"the times are {told(given)}: give numbers in s.") from error


def _interval(what: str, given: Interval | None) -> Interval:
    if given is None:
        return -np.inf, np.inf
    try:
        a, b = (float(end) for end in given)
    except (TypeError, ValueError) as error:
        raise DeclarationError(
            f"the interval {what} = {told(given)} has no two ends: write {what}=(first, last)."
        ) from error
    # Written so that an end that is not a number is refused as well.
    if not a <= b:
        raise DeclarationError(f"the interval {what} = ({given[0]}, {given[1]}) is empty: give its start first.")
    return a, b


def _index_of(jump: JumpRecord) -> int:
    if not isinstance(jump, JumpRecord):
        raise DeclarationError(f"{jump!r} is no jump of an arc: give one of arc.jumps, such as arc.jumps[0].")
    return jump.j
