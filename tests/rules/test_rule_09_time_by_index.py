"""Rule 9: time is computed from the index, never summed up."""

import math

import pytest
from small_automata import Timer

import hybrid_model as hm


@pytest.mark.parametrize("period", [0.1, 1e-3, 1.0 / 3.0, 1.0 / 60.0])
def test_periodic_events_come_at_the_index_times_the_period(period):
    n = 256
    arc = hm.simulate(Timer(period=period), n * period)
    # Equality, not approximation; and the end n h is met, however it rounds.
    assert [jump.t for jump in arc.jumps] == [k * period for k in range(n + 1)]
    summed = 0.0
    for _ in range(n):
        summed += period
    assert summed != n * period or period == 1.0 / 3.0  # what a sum would have given


@pytest.mark.parametrize("t_end", [0.1, 1.0 / 3.0, 1e6 + 0.1, math.pi])
def test_the_run_ends_exactly_at_its_end(t_end):
    class Drift(hm.HybridAutomaton):
        x = hm.State(0.0)

        def flow_map(self, s):
            return {"x": 1.0}

    assert hm.simulate(Drift(), t_end, t_start=t_end - 0.05).t[-1] == t_end
    assert hm.simulate(Timer(first=t_end - 0.02), t_end, t_start=t_end - 0.05).t[-1] == t_end


def test_a_run_of_length_zero_takes_what_is_due():
    arc = hm.simulate(Timer(first=2.0), 2.0, t_start=2.0)
    assert (list(arc.t), len(arc.jumps), arc.stop) == ([2.0, 2.0], 1, hm.Stop.HORIZON)


@pytest.mark.parametrize(("t_start", "t_end"), [(1.0, 0.0), (0.0, math.nan), (0.0, math.inf), (math.nan, 1.0)])
def test_reversed_or_endless_times_are_refused(t_start, t_end):
    with pytest.raises(hm.SimulationError, match=r"end time is .* start .* finite end after the start"):
        hm.simulate(Timer(), t_end, t_start=t_start)


def test_a_start_time_that_is_not_finite_is_refused():
    with pytest.raises(hm.SimulationError, match="start time"):
        hm.simulate(Timer(), 1.0, t_start=-math.inf)
    with pytest.raises(hm.SimulationError, match="start time of Timer is nan"):
        hm.Execution(Timer(), t_start=math.nan)
