"""What a sweep is: a scenario, what varies of it, and what is taken from each run."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from hybrid_model.consensus.certificates.forms import BOUNDS
from hybrid_model.consensus.entries import suggestion
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.files import read_scenario, scenario_entries
from hybrid_model.consensus.sweeps.axes import Axis, Choice, Range, Seeds, as_axis
from hybrid_model.consensus.sweeps.designs import Design, points_of
from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.keys import with_values

__all__ = ["BOUND_NAMES", "METRICS", "Frame", "Study", "study"]

METRICS = (
    "events",
    "link_messages",
    "active_messages",
    "rate",
    "gap_min",
    "gap_mean",
    "integral",
    "ultimate",
    "settling",
    "edge_norm_end",
    "mean_drift",
    "end",
)
"""Columns of a row that every run has; docs/sweeps.md says what they are."""

BOUND_NAMES = tuple(f"{row.quantity.value}.{row.form.value}" for row in BOUNDS)
"""Columns that can be asked for, such as ``radius.exact``."""

_AXES: dict[str, type[Axis]] = {kind.kind: kind for kind in (Choice, Range, Seeds)}
_VERSION = 1


@dataclass(frozen=True)
class Frame:
    """What all runs of a sweep have in common: all that a worker needs besides the values of a run.

    Attributes
    ----------
    entries : Mapping
        Of the scenario file.
    folder : str
        Where the names of files in them count from.
    bounds : tuple of str
        Of `BOUND_NAMES`.
    max_jumps : int
        Jumps after which a run ends.
    """

    entries: Mapping[str, Any]
    folder: str
    bounds: tuple[str, ...]
    max_jumps: int

    def scenario(self, values: Mapping[str, Any]) -> Scenario:
        """Return the scenario of a run.

        Raises
        ------
        ScenarioError
            If it breaks a rule of scenario files.
        SweepError
            If the values name what is not there.
        """
        return read_scenario(with_values(self.entries, values), self.folder)


@dataclass(frozen=True)
class Study:
    """A sweep; `study` makes one.

    Attributes
    ----------
    frame : Frame
        The scenario, and what is taken from each run.
    axes : tuple of Axis
        What varies.
    design : Design
        Which points of the axes are run.
    runs : int or None
        How many are drawn; None on a grid.
    repeats : int
        How often each is run.
    seed : int
        Of draws and of seeds.
    """

    frame: Frame
    axes: tuple[Axis, ...]
    design: Design
    runs: int | None = None
    repeats: int = 1
    seed: int = 0
    _points: list[dict[str, Any]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Choose the points."""
        unknown = next((name for name in self.frame.bounds if name not in BOUND_NAMES), None)
        if unknown is not None:
            raise SweepError(
                f"there is no bound '{unknown}'.{suggestion(unknown, BOUND_NAMES)} Bounds: {', '.join(BOUND_NAMES)}."
            )
        if self.frame.max_jumps < 1:
            raise SweepError(f"max_jumps is {self.frame.max_jumps}; give a whole number of jumps, 1 or more.")
        points = points_of(self.axes, self.design, self.runs, self.repeats, self.seed)
        object.__setattr__(self, "_points", points)

    def __len__(self) -> int:
        """Number of runs."""
        return len(self._points)

    def values(self, run: int) -> dict[str, Any]:
        """Key -> value of a run, counted from 0."""
        return self._points[run]

    def check(self) -> None:
        """Refuse a sweep of which neither the first, nor the last, nor the middle run has a scenario.

        Raises
        ------
        ScenarioError, SweepError
            What the first lacks.
        """
        last = len(self) - 1
        errors: list[Exception] = []
        for run in (0, last, last // 2):
            try:
                self.frame.scenario(self.values(run))
                return
            except (ScenarioError, SweepError) as error:
                errors.append(error)
        raise errors[0]

    @property
    def keys(self) -> tuple[str, ...]:
        """What varies, in order."""
        return tuple(axis.key for axis in self.axes)

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Of the table: the keys, the metrics, the bounds, how the run ended, and why it failed if it did."""
        return (*self.keys, *METRICS, *self.frame.bounds, "stop", "failure")

    def as_dict(self) -> dict[str, Any]:
        """The study as data for JSON."""
        return {
            "version": _VERSION,
            "scenario": dict(self.frame.entries),
            "folder": self.frame.folder,
            "axes": [{"kind": axis.kind, **vars(axis)} for axis in self.axes],
            "design": self.design.value,
            "runs": self.runs,
            "repeats": self.repeats,
            "seed": self.seed,
            "bounds": list(self.frame.bounds),
            "max_jumps": self.frame.max_jumps,
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Study:
        """The study of `as_dict`.

        Raises
        ------
        SweepError
            If the data are of another version.
        """
        if data.get("version") != _VERSION:
            raise SweepError(f"the study has the version {data.get('version')}; this program knows version {_VERSION}.")
        frame = Frame(data["scenario"], data["folder"], tuple(data["bounds"]), data["max_jumps"])
        axes = []
        for each in data["axes"]:
            given = {name: value for name, value in each.items() if name != "kind"}
            if "values" in given:
                given["values"] = tuple(given["values"])
            axes.append(_AXES[each["kind"]](**given))
        return cls(frame, tuple(axes), Design(data["design"]), data["runs"], data["repeats"], data["seed"])


def study(
    scenario: str | os.PathLike[str],
    vary: Sequence[Axis | str],
    *,
    design: Design | str = Design.GRID,
    runs: int | None = None,
    repeats: int = 1,
    seed: int = 0,
    bounds: Sequence[str] = (),
    max_jumps: int = 20_000,
) -> Study:
    """Say what a sweep is.

    Parameters
    ----------
    scenario : str or path
        Name of a preset, or path of a scenario file.
    vary : sequence of Axis or str
        What varies of it; texts are read by `read_axis`: ``"trigger.decay=0:0.1:11"``.
    design : Design or str
        ``"grid"``, ``"random"`` or ``"latin-hypercube"``.
    runs : int, optional
        How many points are drawn; of a grid its axes say it.
    repeats : int
        How often each point is run, with other seeds.
    seed : int
        Of draws and of seeds.
    bounds : sequence of str
        Columns with certified values, such as ``"radius.energy"``, see `BOUND_NAMES`.
    max_jumps : int
        Broadcasts and breakpoints after which a run ends.

    Raises
    ------
    SweepError
        If an argument is not what it must be.
    ScenarioError
        If there is no such scenario, or no run of it could begin.
    """
    names = [known.value for known in Design]
    if design not in (*Design, *names):
        raise SweepError(f"there is no design '{design}'; it must be one of {', '.join(names)}.")
    if isinstance(seed, bool) or seed < 0:
        raise SweepError(f"seed is {seed}; it must be a whole number that is not negative.")
    entries, folder = scenario_entries(scenario)
    found = Study(
        Frame(_plain(entries), os.fspath(folder), tuple(bounds), max_jumps),
        tuple(as_axis(axis) for axis in vary),
        Design(design),
        runs,
        repeats,
        seed,
    )
    found.check()
    return found


def _plain(entries: Mapping[str, Any]) -> dict[str, Any]:
    """The entries as JSON gives them back."""
    try:
        return dict(json.loads(json.dumps(entries)))
    except TypeError as error:
        raise SweepError(f"the scenario holds what no sweep can keep: {error}.") from error
