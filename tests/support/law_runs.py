"""Runs of scenarios under a trigger law, as one automaton and agent by agent, and their comparison with exact ones."""

import numpy as np

import hybrid_model as hm
from cosim.consensus import in_process_system, network_report
from cosim.masters import run_event_exact
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.runs.report import run_report

# The limits of the agreement of executions. Events amplify errors, so random runs are short.
TIME_TOLERANCE = 1e-8
STATE_TOLERANCE = 1e-9
STATE_ERROR = 1e-11
"""What integration and rounding leave in a margin: it moves an event by its quotient with the margin's slope."""


def run(scenario):
    return hm.simulate(closed_loop(scenario), scenario.stop_time)


def reported(scenario):
    return run_report(scenario, run(scenario))


def reported_by_agents(scenario):
    """Of agents that meet at events only."""
    return network_report(scenario, run_event_exact(in_process_system(scenario), scenario.stop_time))


def compare(report, exact, slack=None):
    """Events and final states; `slack` holds what each event time may be off beyond the tolerance."""
    assert report.events_per_agent == exact.counts
    if slack is None:
        slopes = getattr(exact, "slopes", [np.full(len(times), 1.0) for times in exact.event_times])
        slack = [STATE_ERROR / np.maximum(slope, 1e-5) for slope in slopes]
    for times, expected, more in zip(report.event_times, exact.event_times, slack, strict=True):
        assert np.all(np.abs(times - expected) <= TIME_TOLERANCE + more)
    np.testing.assert_allclose(report.x_end, exact.x_end, rtol=0, atol=STATE_TOLERANCE)
