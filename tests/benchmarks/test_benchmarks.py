"""The benchmarks' problems, scores and contenders, untimed: what their tables claim can be wrong only in the times."""

from dataclasses import replace

import fmpy
import numpy as np
import pytest

from benchmarks import event_cost, step_cost
from benchmarks.contenders import CONTENDERS
from benchmarks.measure import Entry, choose, fastest_scipy, score
from benchmarks.problems import MIRRORED, PAPER_DYNAMIC, PROBLEMS, Ball, Outcome
from hybrid_model.models import BouncingBall

SHORT_PAPER = replace(PAPER_DYNAMIC, scenario=replace(PAPER_DYNAMIC.scenario, stop_time=8.0))
SHORT_BALL = Ball(impacts=5)


def of_name(part):
    return next(contender for contender in CONTENDERS if part in contender.name)


def outcome(*events, x_end=(0.0,), ended="end time"):
    return Outcome([np.array(times) for times in events], np.array(x_end), 4.0, ended)


def test_a_score_counts_missed_and_extra_events_and_takes_the_latest():
    exact = outcome([1.0, 2.0, 3.0], [1.5])
    same = score(exact, exact)
    assert same.complete
    assert same.time_error == 0.0
    found = score(outcome([1.0, 2.25, 3.125], [1.5], x_end=[0.5]), exact)
    assert found.complete
    assert (found.time_error, found.state_error) == (0.25, 0.5)
    missed = score(outcome([1.0, 3.0], [1.5, 3.9]), exact)
    assert (missed.found, missed.extra, missed.complete) == (3, 1, False)
    doubled = score(outcome([1.0, 1.0, 2.0, 3.0], [1.5]), exact)
    assert (doubled.found, doubled.extra, doubled.complete) == (4, 1, False)
    assert not score(outcome([1.0, 2.0, 3.0], [1.5], ended="ValueError"), exact).complete


def test_an_event_of_another_agent_is_not_a_found_one():
    exact = outcome([1.0], [2.0])
    assert score(outcome([2.0], [1.0]), exact).found == 0


def test_ratios_refer_to_the_faster_scipy_method_that_reaches_the_target():
    contenders = [of_name("DOP853"), of_name("LSODA"), of_name("CVODE")]
    reached, seconds = [True, False, True], [[3.0, 4.0, 4.0], [1.0, 1.0, 1.0], [1.5, 1.0, 4.0]]
    entries = [Entry(c, 1e-9, r, None, None, 0.0, s) for c, r, s in zip(contenders, reached, seconds, strict=True)]
    assert fastest_scipy(entries) is entries[0]
    assert entries[2].ratio(entries[0]) == 0.5  # the median of 1/2, 1/4 and 1
    assert fastest_scipy(entries[1:]) is None


def test_impacts_and_the_flights_that_are_left_sum_to_the_zeno_time():
    ball = Ball()
    left = 2.0 * ball.rebounds[-1] / ball.gravity / (1.0 - ball.restitution)
    assert ball.times[-1] + left == pytest.approx(ball.zeno_time, rel=1e-14)  # a sum of some 30 rounded terms
    assert ball.times[-1] < ball.t_end < ball.times[-1] + 2.0 * ball.rebounds[-1] / ball.gravity


@pytest.mark.parametrize("problem", PROBLEMS[:3], ids=lambda problem: problem.title)
def test_pieces_hold_the_weights_of_the_scenario(problem):
    for piece in problem.pieces:
        t = piece.start + (piece.end - piece.start) * 0.37
        weights = piece.amplitudes * (2.0 * np.sin(problem.rates * t)) ** 2
        # Both are one sine squared, rounded a few times, at most 4.
        np.testing.assert_allclose(weights, problem.scenario.edge_weights.value(t), atol=1e-13)


def test_the_scipy_loop_loses_agents_that_broadcast_together():
    """SciPy reports one of two terminal events at one instant; the run restarts with the other's guard near zero."""
    for contender in (of_name("DOP853"), of_name("LSODA")):
        complete = [score(contender.prepare(MIRRORED, tol)(), MIRRORED.exact).complete for tol in contender.tolerances]
        # Rounding decides on which side of zero that guard is: now and then a run may have all six pairs.
        assert sum(complete) < len(complete) / 2
    ours = score(of_name("`simulate`").prepare(MIRRORED, 1e-10)(), MIRRORED.exact)
    assert ours.complete
    # At the flattest event the trigger rises by 0.0216 a second, so a state error of 1e-10 moves it by 5e-9 s.
    assert ours.time_error <= 5e-9


@pytest.mark.long
@pytest.mark.parametrize("problem", [SHORT_PAPER, SHORT_BALL], ids=["paper", "ball"])
@pytest.mark.parametrize("contender", CONTENDERS, ids=lambda contender: contender.name)
def test_every_contender_finds_the_events_of_a_short_run(contender, problem):
    if not contender.installed:
        pytest.skip(f"{contender.needs} is not installed")
    # Every contender reaches 1e-6 s at some tolerance: none of them is crippled by how it is used here.
    (entry,) = choose(contender, problem, (1e-6,))
    assert entry.reached
    assert entry.score.state_error < 1e-4  # event times of 1e-6 s, speeds up to 5 m/s


def run_driver(tmp_path, *balls, stop=0.6):
    return step_cost.run(step_cost.compile_driver(tmp_path), balls, rounds=2, stop=stop)


def test_the_c_driver_runs_fmus_past_an_impact_and_times_every_call(tmp_path, exported):
    own = step_cost.contender("own", exported(BouncingBall()), tmp_path)
    euler = step_cost.euler_ball(tmp_path)
    measured = run_driver(tmp_path, own, euler)
    assert set(measured["own"].times) == set(step_cost.MEASURED)
    assert all(len(times) == 2 and min(times) > 0.0 for times in measured["own"].times.values())
    # 60 steps of 10 ms, one of them split at the impact, obeying the announced time or stopping by itself.
    assert set(measured["own"].counts.values()) == {(61, 1)}
    t, h, v = np.array(measured["own"].values).T
    impact = np.sqrt(2.0 / 9.81)
    rebound = 0.7 * 9.81 * impact
    # A flight is a parabola: the solver is exact up to rounding, its tolerance is 1e-13.
    expected = np.where(t < impact, 1.0 - 4.905 * t**2, rebound * (t - impact) - 4.905 * (t - impact) ** 2)
    np.testing.assert_allclose(h, expected, atol=1e-11)
    np.testing.assert_allclose(v, np.where(t < impact, 0.0, rebound + 9.81 * impact) - 9.81 * t, atol=1e-11)
    assert max(step_cost.impact_errors(measured["own"].values)) < 1e-11
    # Forward Euler finds the floor at the end of a step of 1 ms, the second one after the impact.
    late, _ = step_cost.impact_errors(measured[euler.name].values)
    assert late == pytest.approx(0.453 - impact, abs=1e-9)


def test_the_loops_of_an_event_make_the_run_of_the_master(tmp_path):
    timer, tank = event_cost.exported(tmp_path)
    assert event_cost.calls_of_an_event(timer, tank) == 10
    loop, levels = event_cost.Loop(timer, tank), []
    result = event_cost.master_run(timer, tank, 3)[1]
    at = [v.valueReference for v in fmpy.read_model_description(str(tank)).modelVariables if v.name == "level"]
    for calls in (loop.by_fmpy, loop.bare):

        def watched(events, calls=calls):
            calls(events)
            loop.tank.doStep(3.0, 0.5)
            levels.append(loop.tank.getFloat64(at)[0])

        loop.run(watched, 3)
    assert levels == [result.final["tank.level"]] * 2


def test_the_c_driver_says_what_a_contender_refuses(tmp_path, exported):
    own = step_cost.contender("own", exported(BouncingBall()), tmp_path)
    with pytest.raises(step_cost.DriverError, match="instantiation token"):
        run_driver(tmp_path, replace(own, token="another"))
    # Past its Zeno time, 2.5586 s, the ball ends its run.
    with pytest.raises(step_cost.DriverError, match="Zeno"):
        run_driver(tmp_path, own, stop=2.6)


@pytest.mark.long
@pytest.mark.parametrize("package", ["pythonfmu", "pythonfmu3"])
def test_the_c_driver_runs_balls_in_python(tmp_path, package):
    pytest.importorskip(package)
    ball = step_cost.python_ball(tmp_path, package)
    measured = run_driver(tmp_path, ball, step_cost.own_ball(tmp_path))
    # Both in closed form, rounded some 50 times.
    assert max(step_cost.impact_errors(measured[ball.name].values)) < 1e-12
