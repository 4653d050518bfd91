"""What event triggering saves, or costs, against periodic broadcasting: at equal rate and at equal performance.

Both sides start alike and see the same weights. Periodic agents may lower their gain to suit their period: a law made
for frequent broadcasts overshoots when it is sampled slowly, and beating that is no merit. At equal rate the periodic
agents send as often, on average; the question is who agrees better. At equal performance they send as rarely as they
can while they agree as well; the question is who sends more. For integrators the answer to the first can well be the
periodic ones: D. Meister, F. Aurzada, M. A. Lifshits, F. Allgoewer show it for noise, all-to-all links and
instantaneous averaging (2022, 2023).
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from hybrid_model.consensus.runs.metrics import Performance, States, performance, run_states
from hybrid_model.consensus.runs.periodic_run import periodic_run, slow_gain
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.record.arc import HybridArc

__all__ = ["Measure", "Savings", "run_savings", "savings"]

_STEPS = 40
_SPAN = 30.0
_REFINEMENTS = 30
_EQUAL = 1e-9
"""Relative distance within which two performances count as equal (rounding)."""


class Measure(enum.Enum):
    """By what two runs are compared; less is better for each of them."""

    INTEGRAL = "integral of the squared disagreement"
    ULTIMATE = "largest disagreement in the last quarter"
    SETTLING = "settling time"

    def of(self, judged: Performance) -> float:
        """The number; infinite for a run that does not settle."""
        if self is Measure.SETTLING:
            return math.inf if judged.settling is None else judged.settling
        return judged.integral if self is Measure.INTEGRAL else judged.ultimate


@dataclass(frozen=True, eq=False)
class Savings:
    """An event-triggered run beside periodic ones.

    Attributes
    ----------
    triggered : Performance
        Of the event-triggered run.
    events : int
        Its broadcasts, all agents together.
    period : float
        Of the periodic run at equal average rate [s]: duration times agents by events.
    at_equal_rate : Performance
        Of that run with the gain of the scenario. It sends at most as many broadcasts, since a period that the end cuts
        off sends none.
    with_own_gain : Performance
        Of the same run with a gain that suits the period, `slow_gain`.
    equal_periods : dict
        Measure -> longest period [s] with which periodic broadcasting does as well; None if none of those tried does.
    needed : dict
        Measure -> broadcasts with that period, all agents together; None likewise.
    """

    triggered: Performance
    events: int
    period: float
    at_equal_rate: Performance
    with_own_gain: Performance
    equal_periods: dict[Measure, float | None]
    needed: dict[Measure, int | None]

    def periodic(self, measure: Measure) -> float:
        """The number of the periodic run at equal rate with the better of the two gains."""
        return min(measure.of(self.at_equal_rate), measure.of(self.with_own_gain))

    def saved(self, measure: Measure) -> float | None:
        """Share of the broadcasts that event triggering saves at equal performance; negative if it needs more.

        None if no period does as well, or periodic agents do as well without any broadcast after the first.
        """
        needed = self.needed[measure]
        return 1 - self.events / needed if needed else None

    def ratio(self, measure: Measure) -> float:
        """Event-triggered by periodic at equal rate, the better gain; above 1 the periodic agents agree better."""
        mine, theirs = measure.of(self.triggered), self.periodic(measure)
        if mine == theirs:
            return 1.0
        return math.inf if theirs == 0 else mine / theirs

    def lines(self) -> list[str]:
        """The comparison in sentences, losses as plainly as gains."""
        text = [
            f"{self.events} event-triggered broadcasts; periodic ones at equal rate come every {self.period:.4g} s."
        ]
        for measure in Measure:
            ratio = self.ratio(measure)
            better = "equal" if ratio == 1 else "event triggering is better" if ratio < 1 else "periodic is better"
            text.append(
                f"Equal rate, {measure.value}: {measure.of(self.triggered):.4g} event-triggered, "
                f"{measure.of(self.at_equal_rate):.4g} periodic, {measure.of(self.with_own_gain):.4g} periodic with a "
                f"gain for this period; {better}."
            )
            text.append(f"Equal performance, {measure.value}: {self._verdict(measure)}.")
        return text

    def _verdict(self, measure: Measure) -> str:
        needed, saved = self.needed[measure], self.saved(measure)
        if math.isinf(measure.of(self.triggered)):
            return "the event-triggered run does not settle, so there is nothing to equal"
        if needed is None:
            return "no period that was tried does as well"
        if saved is None:
            return "periodic agents do as well without any broadcast after the first"
        more = "fewer" if saved >= 0 else "more"
        return (
            f"periodic broadcasting needs {needed} broadcasts, so event triggering sends {abs(saved):.0%} {more} "
            "than that"
        )


def run_savings(scenario: Scenario, arc: HybridArc, level: float | None = None) -> Savings:
    """Compare a run `arc` of ``closed_loop(scenario)`` with periodic broadcasting; `level` as in `performance`."""
    return savings(scenario, run_states(scenario, arc), run_report(scenario, arc).event_times, level)


def savings(
    scenario: Scenario, states: States, event_times: Sequence[ArrayLike], level: float | None = None
) -> Savings:
    """Compare an event-triggered run with periodic broadcasting.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    states : callable
        States of the event-triggered run, as `hybrid_model.consensus.runs.metrics.run_states` gives them.
    event_times : sequence of array_like
        Times [s] of each agent's broadcasts, without the one at the start.
    level : float, optional
        Of the settling time, see `performance`.

    Raises
    ------
    ValueError
        If no agent broadcasts after the start: then there is nothing to compare.

    Notes
    -----
    Performance does not fall monotonically with the period. So periods from a thirtieth of that at equal rate to thirty
    times it, at most the duration, are tried in constant ratios, and the longest that does as well counts, refined
    towards its longer neighbour. The most favourable period is chosen with hindsight, for this one start: a
    comparison that leans to the periodic side rather than to ours.
    """
    events = sum(len(np.asarray(times)) for times in event_times)
    if events == 0:
        raise ValueError(f"no agent of {scenario.name} broadcasts after the start, so there is no rate to compare.")
    agents, end = scenario.network.agents, scenario.stop_time
    triggered = performance(scenario, states, event_times, level)
    period = end * agents / events

    def judge(length: float) -> tuple[Performance, Performance]:
        slower = replace(scenario, network=replace(scenario.network, gain=slow_gain(scenario, length)))
        runs = [periodic_run(each, length) for each in (scenario, slower)]
        own, suited = (performance(scenario, run.at, [run.times], triggered.level) for run in runs)
        return own, suited

    def best(measure: Measure, judged: tuple[Performance, Performance]) -> float:
        return min(measure.of(each) for each in judged)

    longest = min(end, period * _SPAN)
    tried = [(float(h), judge(float(h))) for h in np.geomspace(period / _SPAN, longest, _STEPS)]
    equal: dict[Measure, float | None] = {}
    needed: dict[Measure, int | None] = {}
    for measure in Measure:
        target = measure.of(triggered) * (1 + _EQUAL)
        good = [k for k, (_, judged) in enumerate(tried) if best(measure, judged) <= target]
        equal[measure] = needed[measure] = None
        if good and math.isfinite(target):
            found = tried[good[-1]][0]
            if good[-1] + 1 < len(tried):
                high = tried[good[-1] + 1][0]
                for _ in range(_REFINEMENTS):
                    middle = math.sqrt(found * high)
                    found, high = (middle, high) if best(measure, judge(middle)) <= target else (found, middle)
                    if high <= found * (1 + 1e-4):
                        break
            equal[measure] = found
            needed[measure] = agents * periodic_run(scenario, found).broadcasts
    return Savings(triggered, events, period, *judge(period), equal, needed)
