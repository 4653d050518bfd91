"""How often weights, switching and trigger of a scenario file change in a run: more than can be run is a slip."""

import math
from collections.abc import Iterator

from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.weights.switching import PeriodicSwitching, SwitchingSequence
from hybrid_model.consensus.weights.tables import PiecewiseWeight, SampledWeight

__all__ = ["MOST_CHANGES", "require_affordable"]

MOST_CHANGES = 1e7


def require_affordable(scenario: Scenario) -> None:
    """Refuse a scenario whose run would have to stop more than `MOST_CHANGES` times, whatever its agents do.

    Raises
    ------
    ScenarioError
        Names the key that is to blame.
    """
    for table, key, count in _changes(scenario):
        if count > MOST_CHANGES:
            raise ScenarioError(
                f"{table} {key} makes about {count:.1g} changes up to stop_time, {scenario.stop_time:.6g} s; a run can "
                f"have at most {MOST_CHANGES:.0g}, so change {key} or stop_time."
            )


def _changes(scenario: Scenario) -> Iterator[tuple[str, str, float]]:
    end = scenario.stop_time
    for number, wave in enumerate(scenario.weights.waveforms, start=1):
        table = f"[weights] of edge {number}:"
        for key in ("gate_rate", "sine_rate", "rate"):
            yield table, key, end * (getattr(wave, key, 0.0) / (2 * math.pi))
        if isinstance(wave, PiecewiseWeight) and wave.cycle is not None:
            yield table, "cycle", end / wave.cycle * len(wave.starts)
        if isinstance(wave, SampledWeight) and wave.repeat:
            yield table, "times", end / (wave.times[-1] - wave.times[0]) * len(wave.times)
    switching, period = scenario.switching, scenario.trigger.period
    if isinstance(switching, PeriodicSwitching):
        yield "[switching]", "dwell", end / switching.dwell
    if isinstance(switching, SwitchingSequence) and switching.repeat:
        yield "[switching]", "duration or dwell", end / switching.duration * len(switching.dwells)
    if period > 0:
        yield "[trigger]", "period", end / period
