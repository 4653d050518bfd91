"""One run of a sweep: from values to a row."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import hybrid_model as hm
from hybrid_model.consensus.certificates.analysis import Analysis, analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.components import connected_components, union_time
from hybrid_model.consensus.certificates.forms import BOUNDS, Evidence, Form
from hybrid_model.consensus.certificates.observation import observe
from hybrid_model.consensus.certificates.sizes import LARGE
from hybrid_model.consensus.laws.agent_network import agent_network
from hybrid_model.consensus.laws.loop_reuse import LoopReuse
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.runs.communication import communication, gap_statistics
from hybrid_model.consensus.runs.metrics import performance, run_states
from hybrid_model.consensus.runs.report import report_of
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import TriggerKind
from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.study import Frame

__all__ = ["Row", "Runner", "run_points"]

Row = dict[str, Any]
"""Column -> value of a run."""

_MOST_ANALYSES = 4
_ROWS = {f"{row.quantity.value}.{row.form.value}": row for row in BOUNDS}


class Runner:
    """Runs points of a sweep one after the other, and keeps what they share: closed loops and analyses of networks.

    Parameters
    ----------
    frame : Frame
        What the runs have in common.
    """

    def __init__(self, frame: Frame) -> None:
        self._frame = frame
        self._loops = LoopReuse()
        self._analyses: list[tuple[object, Analysis | None]] = []

    def row(self, values: Mapping[str, Any]) -> Row:
        """Run a point; what goes wrong with it is told in its row."""
        try:
            return self._measured(values)
        except (
            hm.HybridModelError,
            ScenarioError,
            SweepError,
            ArithmeticError,
            ValueError,
            np.linalg.LinAlgError,
            MemoryError,
        ) as error:
            return {"failure": f"{type(error).__name__}: {error}"}

    def _measured(self, values: Mapping[str, Any]) -> Row:
        scenario = self._frame.scenario(values)
        zeno = hm.ZenoGuard(max_jumps=self._frame.max_jumps)
        arc: hm.HybridArc | hm.NetworkRun
        if scenario.network.agents >= LARGE and scenario.trigger.kind is not TriggerKind.CONTINUOUS:
            # Event by event: an event of one automaton of all agents would stop all of them.
            arc = hm.simulate_network(agent_network(scenario), scenario.stop_time, zeno=zeno)
        else:
            loop, starts = self._loops.loop(scenario)
            arc = hm.simulate(loop, scenario.stop_time, starts=starts, zeno=zeno)
        row = _metrics(scenario, arc)
        if self._frame.bounds:
            row |= self._bounds(scenario, arc)
        return row

    def _bounds(self, scenario: Scenario, arc: hm.HybridArc | hm.NetworkRun) -> Row:
        analysis = self._analysis(scenario)
        if analysis is None:
            return {}
        bounds = Bounds(analysis)
        seen = None
        if any(_ROWS[name].form is Form.OBSERVED for name in self._frame.bounds):
            decay = min((beta for _, beta in bounds.slowest), default=None)
            seen = observe(analysis, arc, decay, bounds.passing_radii)
        evidence = Evidence(bounds, seen)
        return {name: _ROWS[name].value(evidence) for name in self._frame.bounds}

    def _analysis(self, scenario: Scenario) -> Analysis | None:
        """The analysis of a network, made once for all triggers and start values; None if it falls into parts."""
        network = replace(scenario.network, initial=(0.0,) * scenario.network.agents)
        # All that `Analysis.alike` keeps.
        about = (network, scenario.weights, scenario.switching, scenario.stop_time)
        place = next((k for k, (known, _) in enumerate(self._analyses) if known == about), None)
        if place is not None:
            _, found = self._analyses.pop(place)
            found = None if found is None else found.alike(scenario)
        elif len(connected_components(scenario, union_time(scenario))) > 1:
            found = None
        else:
            found = analyse(scenario)
        self._analyses = [(about, found), *self._analyses[: _MOST_ANALYSES - 1]]
        return found


def _metrics(scenario: Scenario, arc: hm.HybridArc | hm.NetworkRun) -> Row:
    report = report_of(scenario, arc)
    end = float(arc.t if isinstance(arc, hm.NetworkRun) else arc.t[-1])
    ran = replace(scenario, stop_time=end) if end < scenario.stop_time else scenario
    sent, gaps = communication(ran, report.event_times), gap_statistics(report.event_times)
    judged = performance(ran, run_states(ran, arc), report.event_times)
    return {
        "events": sum(sent.broadcasts),
        "link_messages": sum(sent.link_messages),
        "active_messages": sum(sent.active_messages),
        "rate": sent.rate,
        "gap_min": gaps.min if report.min_gap is not None else None,
        "gap_mean": gaps.mean,
        "integral": judged.integral,
        "ultimate": judged.ultimate,
        "settling": judged.settling,
        "edge_norm_end": report.edge_norm_end,
        "mean_drift": report.mean_drift,
        "end": end,
        "stop": report.stop,
        "failure": None if arc.stop is hm.Stop.HORIZON else report.message,
    }


_of_thread = threading.local()


def run_points(frame: Frame, points: Sequence[Mapping[str, Any]]) -> tuple[list[Row], float]:
    """Run points of a sweep, in a worker of any kind.

    Parameters
    ----------
    frame : Frame
        What they have in common.
    points : sequence of mapping
        Key -> value of each.

    Returns
    -------
    rows : list of dict
    seconds : float
        What they took on the clock.
    """
    begin = time.perf_counter()
    known: tuple[Frame, Runner] | None = getattr(_of_thread, "runner", None)
    if known is None or known[0] != frame:
        known = _of_thread.runner = frame, Runner(frame)
    rows = [known[1].row(point) for point in points]
    return rows, time.perf_counter() - begin
