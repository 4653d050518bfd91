"""What goes wrong in runs: endless iterations, states that are not freed, interrupts and kills."""

import csv
import os
import signal
import subprocess
import sys
import time

import pytest
from strangers import ITERATES

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.errors import CosimError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_error_controlled, run_event_exact
from cosim.system import System
from hybrid_model.models import BouncingBall
from hybrid_model.models.ball_on_moving_table import BallOnMovingTable

ON_A_BALL = {"second.table": "first.h", "second.table_velocity": "first.v"}


class Integrates(hm.HybridAutomaton):
    u = hm.Input(0.0)
    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": s.u}


class Counting(AutomatonSlave):
    """Counts the states that it has given and not got back."""

    held = 0

    def save(self):
        type(self).held += 1
        return super().save()

    def release(self, state):
        type(self).held -= 1
        super().release(state)


class Late(Counting):
    """Fails in a step from 0.4 s on."""

    def step(self, t, t_next):
        if t > 0.4:
            raise CosimError("late fails")
        return super().step(t, t_next)


def test_event_iterations_without_end_are_ended_with_the_name(stranger):
    slave = FmuSlave("stranger", stranger())
    slave.set("behaviour", ITERATES)
    with pytest.raises(CosimError, match=r"stranger asks for more than \d+ event iterations at t = 0 s"):
        run_error_controlled(System([slave], {}), 1.0)


@pytest.mark.parametrize("kind", [Counting, Late])
def test_all_saved_states_are_freed(kind):
    Counting.held = Late.held = 0
    slaves = [Counting("first", BouncingBall()), kind("second", BallOnMovingTable(h=1.2))]
    system = System(slaves, ON_A_BALL)
    if kind is Late:
        with pytest.raises(CosimError, match="late fails"):
            run_error_controlled(system, 0.6)
    else:
        run_error_controlled(system, 0.6)
    assert (Counting.held, Late.held) == (0, 0)


def test_an_input_is_read_once_however_often_it_is_sent():
    """Later it holds what was sent, so vectors are not read to be written."""

    class Reads(AutomatonSlave):
        reads = 0

        def get(self, name):
            self.reads += name in self.inputs
            return super().get(name)

    class Counts(hm.HybridAutomaton):
        ticks = hm.DiscreteState(0.0, output=True)

        def due(self, s):
            return (s.ticks + 1.0) * 0.1

        def tick(self, s):
            return {"ticks": s.ticks + 1.0}

        transitions = (hm.TimeEvent("tick", due, tick),)

    class Hears(hm.HybridAutomaton):
        heard = hm.Input([0.0, 0.0], discrete=True)
        total = hm.Output()

        def outputs(self, s):
            return {"total": s.heard[0] + s.heard[1]}

    slaves = [AutomatonSlave("counts", Counts()), Reads("hears", Hears())]
    result = run_event_exact(System(slaves, {"hears.heard": ["counts.ticks", "counts.ticks"]}), 1.05)
    assert result.final["hears.total"] == 20.0
    assert slaves[1].reads == 2


INTERRUPTIBLE = (
    "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    "from cosim.cli.main import main; raise SystemExit(main())"
)
"""The command line, also where the tests were begun in the background of a shell, which lets interrupts be ignored."""


def begun(path, table, tmp_path):
    """Start a run that takes long, in a folder for temporary files of its own; return it when there are rows."""
    places = tmp_path / "temporary"
    places.mkdir()
    command = [sys.executable, "-c", INTERRUPTIBLE, "cosim", str(path), "--output-file", str(table)]
    run = subprocess.Popen(command, env={**os.environ, "TMPDIR": str(places)}, stderr=subprocess.PIPE, text=True)
    began = time.monotonic()
    while not (table.exists() and table.stat().st_size > 5000):
        assert run.poll() is None
        assert time.monotonic() - began < 60.0
        time.sleep(0.05)
    return run, places


def stopped(run, sent):
    """Send a signal until the run ends, and return what it says: an interrupt can be lost, and people press again."""
    for _ in range(6):
        run.send_signal(sent)
        try:
            return run.communicate(timeout=10.0)[1]
        except subprocess.TimeoutExpired:
            continue
    raise AssertionError("the run goes on after six signals")


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize(("sent", "status"), [(signal.SIGINT, 130), (signal.SIGKILL, -9)])
def test_a_run_that_is_stopped_leaves_rows_and_no_folders(sent, status, stranger, tmp_path):
    path = stranger(events=False, experiment='stopTime="1000" stepSize="1e-4"')
    table = tmp_path / "out.csv"
    run, places = begun(path, table, tmp_path)
    error = stopped(run, sent)
    assert run.returncode == status
    with table.open(newline="") as file:
        rows = list(csv.reader(file))
    assert {len(row) for row in rows} == {len(rows[0])}
    assert float(rows[-1][0]) == pytest.approx(1e-4 * (len(rows) - 2))
    if sent is signal.SIGINT:
        assert "out.csv has what there was up to t = " in error
    began = time.monotonic()
    while any(places.iterdir()) and time.monotonic() - began < 20.0:
        time.sleep(0.05)
    assert list(places.iterdir()) == []
