"""FMUs in processes of their own: the same runs, and one that crashes or hangs is named with its last call."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from strangers import ABORTS, BLINDED, DIES, HANGS, LEAVES

from cosim.cli.main import main
from cosim.errors import CosimError, MisfitError
from cosim.fmu_slave import FmuSlave
from cosim.isolation.isolated_slave import IsolatedSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.system import System

WIRES = {"b.int32_in": "a.sent"}


def pair(kind, path):
    slaves = [kind("a", path), kind("b", path)]
    slaves[0].set("rate", 2.0)
    slaves[0].set("size", 3)
    slaves[0].set("weights[2]", 4.0)
    slaves[1].set("string_in", "text")
    return slaves


@pytest.mark.parametrize("master", ["exact", "fixed"])
def test_a_run_is_the_same(master, stranger):
    """Both are stepped under save and restore: neither names its next event."""
    finals = []
    for kind in (FmuSlave, IsolatedSlave):
        system = System(pair(kind, stranger()), WIRES)
        if master == "exact":
            finals.append(run_event_exact(system, 1.7).final)
        else:
            finals.append(run_fixed_step(system, 1.7, 0.1, record=["a.x"]).final)
    assert finals[0] == finals[1]
    assert finals[0]["b.string_out"] == "text"
    assert (finals[0]["a.total"], finals[0]["b.int32_out"]) == (6.0, 3)


@pytest.mark.parametrize(
    ("behaviour", "sentence"),
    [
        (DIES, r"b ended its process \(status 7\) in step\(0, 0.1\)"),
        (ABORTS, r"b crashed \(SIGABRT\) in step\(0.5, 0.6\)"),
        (BLINDED, r"b crashed \(SIGABRT\) in reading x, count, total and 16 more"),
        (HANGS, r"b did not come back from step\(0, 0.1\) within 0.5 s; its process was ended"),
    ],
)
def test_one_that_fails_is_named_and_the_others_are_freed(behaviour, sentence, stranger):
    slaves = [IsolatedSlave(name, stranger(events=False), patience=60.0) for name in "ab"]
    slaves[1].set("behaviour", behaviour)
    slaves[1]._patience = 0.5 if behaviour == HANGS else 60.0
    began = time.monotonic()
    with pytest.raises(CosimError, match=sentence):
        run_fixed_step(System(slaves, {}), 1.0, 0.1, record=[f"b.{name}" for name in slaves[1].outputs])
    assert [slave._process for slave in slaves] == [None, None]
    assert time.monotonic() - began < 30.0
    with pytest.raises(CosimError, match=r"b: its process is gone, so get\('x'\) cannot be called"):
        slaves[1].get("x")


def test_what_there_was_is_kept(stranger, tmp_path, capsys):
    table, path = tmp_path / "out.csv", stranger(events=False, experiment='stopTime="2" stepSize="0.1"')
    command = ["cosim", str(path), "--isolate", "--start-value", f"behaviour={ABORTS}", "--output-file", str(table)]
    assert main(command) == 1
    error = capsys.readouterr().err
    assert "stranger crashed (SIGABRT) in step(0.5, 0.6)" in error
    assert f"{table} has what there was up to t = 0.5 s" in error
    with table.open() as file:
        assert [float(row["time"]) for row in csv.DictReader(file)] == pytest.approx([0.1 * k for k in range(6)])


def test_errors_arrive_as_they_are(stranger, tmp_path):
    slave = IsolatedSlave("it", stranger())
    with pytest.raises(MisfitError, match=r"it.int8_in is set to 200, but it is an Int8"):
        slave.set("int8_in", 200)
    slave.close()
    with pytest.raises(CosimError, match="there is no file"):
        IsolatedSlave("it", tmp_path / "none.fmu")


def test_one_that_crashes_when_it_is_freed_has_given_its_results(stranger, capsys):
    path = stranger(events=False, experiment='stopTime="2" stepSize="0.1"')
    assert main(["cosim", str(path), "--isolate", "--start-value", f"behaviour={LEAVES}"]) == 0
    said = capsys.readouterr()
    assert "reached t = 2 s" in said.out
    assert "stranger crashed (SIGABRT) in close(). The run was over, and its results are whole." in said.err


@pytest.mark.skipif(sys.platform != "linux", reason="/proc")
def test_a_killed_run_leaves_no_process_and_no_folder_though_an_fmu_hangs(stranger, tmp_path):
    path, table, places = stranger(events=False), tmp_path / "out.csv", tmp_path / "temporary"
    places.mkdir()
    command = ["cosim", str(path), "--isolate", "--start-value", f"behaviour={HANGS}", "--output-file", str(table)]
    program = "import sys; from cosim.cli.main import main; main(sys.argv[1:])"
    run = subprocess.Popen([sys.executable, "-c", program, *command], env={**os.environ, "TMPDIR": str(places)})
    await_true(lambda: table.exists() and table.stat().st_size > 0)
    children = Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()
    assert children
    run.send_signal(signal.SIGKILL)
    run.wait()
    await_true(lambda: not any(Path(f"/proc/{child}").exists() for child in children))
    await_true(lambda: not any(places.iterdir()))
    with table.open(newline="") as file:
        assert [float(row["time"]) for row in csv.DictReader(file)] == [0.0]


def await_true(happened):
    began = time.monotonic()
    while not happened():
        assert time.monotonic() - began < 60.0
        time.sleep(0.02)
