"""FMUs of FMI 3.0 as other tools write them, under both masters."""

import numpy as np
import pytest
from strangers import CREEPS, PANTS, PASTS, REPEATS, STALLS

from cosim.cli.main import main
from cosim.errors import CosimError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_error_controlled, run_event_exact, run_fixed_step
from cosim.result import Ended
from cosim.system import System


def slave_of(path, name="stranger", **starts):
    slave = FmuSlave(name, path)
    for variable, value in starts.items():
        slave.set(variable, value)
    return slave


def exact(system, t_stop=2.0, interval=0.1):
    return run_event_exact(system, t_stop, output_interval=interval)


@pytest.mark.parametrize("states", [True, False])
@pytest.mark.parametrize("announces", [True, False])
def test_the_event_exact_master_runs_a_stranger_to_its_end(states, announces, stranger):
    """Its time is 0.3 where the output point is 3 * 0.1, one ulp later: the two are one, and the run goes on."""
    result = exact(System([slave_of(stranger(states=states), rate=0.7, announces=announces)], {}), t_stop=5.0)
    assert result.ended is Ended.HORIZON
    # The FMU computes the times of its events by adding 1 / 0.7 up.
    np.testing.assert_allclose(result.event_times("stranger"), [1 / 0.7, 2 / 0.7, 3 / 0.7], rtol=1e-15)
    assert result.final["stranger.count"] == 3
    assert result.final["stranger.x"] == pytest.approx(0.5, abs=1e-14)
    np.testing.assert_allclose(
        result.signals["stranger.x"], np.mod(0.7 * np.array(result.times), 1.0), rtol=0, atol=1e-13
    )


def test_each_output_interval_is_one_step_of_a_stranger(stranger):
    result = exact(System([slave_of(stranger(), rate=0.0)], {}))
    assert (result.steps, result.final["stranger.steps"]) == (20, 20)


@pytest.mark.parametrize("states", [True, False])
def test_strangers_side_by_side_have_their_events_in_the_order_of_time(states, stranger):
    rates = {"slow": 0.7, "fast": 1.9, "still": 0.0}
    slaves = [slave_of(stranger(states=states), name, rate=rate) for name, rate in rates.items()]
    result = exact(System(slaves, {}), t_stop=4.0)
    for name, rate in rates.items():
        expected = np.arange(1, int(4.0 * rate) + 1) / rate if rate else []
        np.testing.assert_allclose(result.event_times(name), expected, rtol=1e-15)
    assert [event.t for event in result.events] == sorted(event.t for event in result.events)


def test_an_event_reaches_another_stranger_at_its_instant(stranger):
    slaves = [slave_of(stranger(), "a", rate=0.7), slave_of(stranger(), "b", rate=1.9)]
    result = exact(System(slaves, {"a.heard": "b.sent", "b.heard": "a.sent"}), t_stop=4.0)
    np.testing.assert_allclose(result.event_times("a"), np.array([1, 2]) / 0.7, rtol=1e-15)
    np.testing.assert_allclose(result.event_times("b"), np.arange(1, 8) / 1.9, rtol=1e-15)


def test_what_cannot_return_and_is_sent_something_is_named(stranger):
    slaves = [slave_of(stranger(states=False), "a", rate=0.7), slave_of(stranger(states=False), "b", rate=1.9)]
    system = System(slaves, {"a.heard": "b.sent"})
    with pytest.raises(CosimError, match=r"b sends to a at t = 0\.526315789474 s, but a is at .* cannot return"):
        run_event_exact(system, 4.0)


def test_an_fmu_that_may_be_there_once_is_not_instantiated_twice(stranger):
    path = stranger(alone=True)
    first, second = slave_of(path, "a"), slave_of(path, "b")
    for _ in range(2):  # once at a time: a run after the other is no matter
        assert exact(System([first], {})).ended is Ended.HORIZON
    with pytest.raises(CosimError, match=r"b and a are one FMU, of which a process may have one instance"):
        exact(System([first, second], {}))
    assert exact(System([second], {})).ended is Ended.HORIZON


def test_an_fmu_that_returns_early_without_an_event_is_carried_on(stranger):
    result = exact(System([slave_of(stranger(), rate=0.7, behaviour=PANTS)], {}))
    np.testing.assert_allclose(result.event_times("stranger"), [1 / 0.7], rtol=1e-15)
    assert result.final["stranger.x"] == pytest.approx(0.4, abs=1e-14)


@pytest.mark.parametrize(
    ("behaviour", "sentence"),
    [
        (STALLS, "stranger returns from a step at 0 s and gets no further"),
        (CREEPS, "stranger returned early from one step 10000 times, the last time at 4"),
        (REPEATS, "stranger gets no further than t = 0 s: each of its last 10000 steps ended there with an event"),
    ],
)
def test_strangers_that_get_no_further_are_named(behaviour, sentence, stranger):
    with pytest.raises(CosimError, match=sentence):
        exact(System([slave_of(stranger(), behaviour=behaviour)], {}))


@pytest.mark.parametrize("master", [run_event_exact, run_error_controlled])
@pytest.mark.parametrize(
    ("behaviour", "sentence"),
    [(REPEATS, "^a gets no further than t = 0 s"), (PASTS, "^a .* its next event is at -1 s: that is not ahead")],
)
def test_they_are_named_among_others_too(behaviour, sentence, master, stranger):
    slaves = [slave_of(stranger(), "a", behaviour=behaviour), slave_of(stranger(), "b")]
    with pytest.raises(CosimError, match=sentence):
        master(System(slaves, {"b.int32_in": "a.count"}), 1.0)


@pytest.mark.parametrize("events", [True, False])
def test_only_events_are_listed_where_steps_end_early_for_none(events, stranger):
    """It ends steps at 0.03 s, for nothing, and counts at 0.5, 1, 1.5 s."""
    system = System([slave_of(stranger(events=events), rate=2.0, behaviour=PANTS)], {})
    np.testing.assert_allclose(run_error_controlled(system, 1.6).event_times("stranger"), [0.5, 1.0, 1.5], atol=1e-9)


def test_an_event_that_nobody_handles_does_not_end_a_step(stranger):
    """FMI forbids it to say so where event mode is off; a step that ended there would lose its rest in silence."""
    slave = slave_of(stranger(), behaviour=REPEATS)
    with pytest.raises(CosimError, match="stranger returns from a step at 0 s and gets no further"):
        run_fixed_step(System([slave], {}), 1.0, 0.1)


@pytest.mark.parametrize("events", [True, False])
def test_a_stranger_that_ends_the_run_has_come_to_its_end(events, stranger, tmp_path, capsys):
    path = stranger(events=events, experiment='stopTime="10" stepSize="0.25"')
    table = tmp_path / "run.csv"
    command = ["cosim", str(path), "--start-value", "rate=0.625", "--start-value", "ends=3", "--output-file"]
    assert main([*command, str(table)]) == 0
    assert "stranger ended the run at t = 4.8 s" in capsys.readouterr().out
    times, counts = np.loadtxt(table, delimiter=",", skiprows=1, usecols=(0, 2), unpack=True)
    # Three times 1 / 0.625, added up.
    assert times[-1] == pytest.approx(4.8, rel=1e-15)
    assert counts[-1] == 3
    # Both rows of each jump, and no row twice.
    assert np.all(np.diff(times) >= 0)
    assert len(set(zip(times, counts, strict=True))) == len(times)


def test_events_of_strangers_are_counted_and_listed(stranger, capsys):
    assert main(["cosim", str(stranger()), "--start-value", "rate=2"]) == 0
    assert "stranger: 4 events at 0.5, 1, 1.5, 2 s" in capsys.readouterr().out


def test_slaves_of_a_run_by_a_fixed_step_are_the_same(stranger):
    system = System([slave_of(stranger(), rate=0.7)], {})
    result = run_fixed_step(system, 5.0, 0.1, record=system.output_names)
    assert result.final["stranger.count"] == 3
    np.testing.assert_allclose(
        result.signals["stranger.x"], np.mod(0.7 * np.array(result.times), 1.0), rtol=0, atol=1e-13
    )
