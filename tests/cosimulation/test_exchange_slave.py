"""Model Exchange FMUs hosted on the location of events, beside the automata that they come from."""

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.cli.main import main
from cosim.errors import CosimError
from cosim.exchange_slave import ExchangeSlave
from cosim.masters import run_error_controlled, run_event_exact, run_fixed_step
from cosim.system import System
from fmu.export import export_fmu
from hybrid_model.models import BouncingBall
from hybrid_model.models.ball_on_moving_table import BallOnMovingTable, OscillatingTable
from hybrid_model.models.sawtooth_timer import ScheduledSawtoothTimer

FIRST = np.sqrt(2.0 / 9.81)
IMPACTS = FIRST * np.array([1.0, 1.0 + 2 * 0.7, 1.0 + 2 * 0.7 + 2 * 0.49])
"""Of a ball dropped from 1 m: each flight takes 0.7 of the one before."""
TIME = 1e-9
"""Of events in s: the solver's relative tolerance is 1e-10."""


@pytest.fixture(scope="module", params=["2.0", "3.0"])
def ball(request, tmp_path_factory):
    path = tmp_path_factory.mktemp("me") / "ball.fmu"
    return export_fmu(BouncingBall(), path, fmi=request.param, kinds=("me",))


def test_impacts_are_where_they_are_exactly(ball):
    result = run_event_exact(System([ExchangeSlave("ball", ball)], {}), 1.6, output_interval=0.1, record_events=True)
    np.testing.assert_allclose(result.event_times("ball"), IMPACTS, atol=TIME, rtol=0)
    times, v = np.array(result.times), np.array(result.signals["ball.v"])
    twice = np.flatnonzero(np.diff(times) == 0.0)
    np.testing.assert_allclose(v[twice + 1], -0.7 * v[twice], rtol=1e-12)


def test_events_are_handled_inside_where_the_master_does_not(ball):
    expected = hm.simulate(BouncingBall(), 1.6)
    result = run_fixed_step(System([ExchangeSlave("ball", ball)], {}), 1.6, 0.05)
    assert result.final["ball.h"] == pytest.approx(expected["h"][-1], abs=1e-9)
    assert result.final["ball.v"] == pytest.approx(expected["v"][-1], abs=1e-8)


def test_a_state_is_returned_to(ball):
    slave = ExchangeSlave("ball", ball)
    slave.start(0.0, 2.0, events=True)
    slave.begin()
    assert not slave.update().again
    slave.enter_step_mode()
    slave.step(0.0, 0.4)
    state = slave.save()
    first = slave.step(0.4, 1.0)
    slave.restore(state)
    assert slave.step(0.4, 1.0) == first
    slave.release(state)
    slave.close()
    assert first.reached == pytest.approx(FIRST, abs=TIME)


def test_time_events_are_at_their_times(tmp_path):
    path = export_fmu(ScheduledSawtoothTimer(period=0.3), tmp_path / "timer.fmu", kinds=("me",))
    result = run_event_exact(System([ExchangeSlave("timer", path)], {}), 1.0)
    np.testing.assert_allclose(result.event_times("timer"), [0.3, 0.6, 0.9], rtol=1e-14)
    assert result.final["timer.elapsed"] == pytest.approx(0.1, abs=1e-12)


def test_a_continuous_input_reaches_it(tmp_path):
    wires = {"ball.table": "table.height", "ball.table_velocity": "table.velocity"}
    parts = {"table": OscillatingTable(), "ball": BallOnMovingTable()}
    expected = hm.simulate(hm.Composition("both", parts, wires), 1.3).event_times("ball.jump")
    path = export_fmu(BallOnMovingTable(), tmp_path / "ball.fmu", kinds=("me",))
    system = System([AutomatonSlave("table", OscillatingTable()), ExchangeSlave("ball", path)], wires)
    result = run_error_controlled(system, 1.3)
    np.testing.assert_allclose(result.event_times("ball"), expected, atol=1e-7, rtol=0)


def test_the_command_runs_it_by_itself(ball, tmp_path, capsys):
    assert main(["cosim", str(ball), "--stop-time", "1.6"]) == 0
    said = capsys.readouterr().out
    assert "ball: 3 events at 0.451523641, 1.08365674, 1.52614991 s" in said or "ball.impact: 3 ticks" in said


def test_an_interface_that_it_has_not_is_refused(stranger, ball):
    with pytest.raises(
        CosimError, match=r"is not an FMI 2.0 or 3.0 Model Exchange FMU \(it says FMI 3.0, Co-Simulation"
    ):
        ExchangeSlave("stranger", stranger())
    assert main(["cosim", str(ball), "--interface", "cs", "--stop-time", "1"]) == 1
