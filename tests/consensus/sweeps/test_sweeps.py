"""A sweep from end to end: what its rows hold, and that they are the same whatever ran them and whatever died."""

import csv
import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import replace
from multiprocessing import active_children

import pytest
from small_scenario import small_scenario

import hybrid_model as hm
from hybrid_model.consensus import closed_loop, load_scenario, run_metrics, run_report
from hybrid_model.consensus.certificates.analysis import analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.observation import observe
from hybrid_model.consensus.sweeps import execute
from hybrid_model.consensus.sweeps.errors import SweepError
from hybrid_model.consensus.sweeps.execute import run_sweep
from hybrid_model.consensus.sweeps.export import write_csv, write_parquet
from hybrid_model.consensus.sweeps.study import Study, study
from hybrid_model.consensus.sweeps.table import SweepTable

LONG = 400.0
"""Stop time in s of runs that take long enough to be interrupted."""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "small.toml"
    path.write_text(small_scenario(stop_time=LONG, kind="dynamic", more="decay = 0.02"))
    return path


@pytest.fixture(scope="module")
def many(small):
    """A sweep whose runs go through with different numbers of events, one of which cannot be."""
    return study(
        small,
        ["trigger.threshold=0:0.2:30", "trigger.decay=0.0,0.02,0.04"],
        bounds=["rate.floquet", "radius.energy"],
    )


@pytest.fixture(scope="module")
def expected(many, tmp_path_factory):
    """Its rows, run in this process."""
    return rows_of(many, tmp_path_factory.mktemp("table") / "table.sqlite", executor=ThreadPoolExecutor(1))


def rows_of(given, path, **options):
    with run_sweep(given, path, **options) as table:
        return list(table.rows())


def test_a_row_holds_what_a_run_by_itself_shows(tmp_path):
    given = study(
        "paper-a",
        [
            "trigger.threshold=0.3,0.5",
            "trigger.decay=0.01:0.02:2",
            "network.initial=[[1.0, 2.0, 0.3, 0.4], [1, 0, 0, 2]]",
        ],
        bounds=["radius.energy", "rate.printed", "radius.observed", "min_gap.observed"],
    )
    with run_sweep(given, tmp_path / "a.sqlite", executor=ThreadPoolExecutor(1)) as table:
        assert len(table) == 8
        rows = [dict(zip(("run", *given.columns), row, strict=True)) for row in table.rows()]
    row = rows[5]
    assert (row["trigger.threshold"], row["trigger.decay"]) == (0.5, 0.01)
    assert json.loads(row["network.initial"]) == [1, 0, 0, 2]
    base = load_scenario("paper-a")
    scenario = replace(
        base,
        network=replace(base.network, initial=(1.0, 0.0, 0.0, 2.0)),
        trigger=replace(base.trigger, threshold=0.5, decay=0.01),
    )
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    found, report = run_metrics(scenario, arc), run_report(scenario, arc)
    assert row["events"] == sum(found["broadcasts"])
    assert row["link_messages"] == sum(found["link_messages"])
    assert row["active_messages"] == sum(found["active_messages"])
    assert (row["gap_min"], row["gap_mean"], row["rate"]) == (
        found["gaps"]["min"],
        found["gaps"]["mean"],
        found["rate"],
    )
    assert (row["integral"], row["ultimate"]) == (found["integral"], found["ultimate"])
    assert row["settling"] == found["settling"]["time"]
    assert (row["edge_norm_end"], row["mean_drift"]) == (report.edge_norm_end, report.mean_drift)
    assert (row["end"], row["stop"], row["failure"]) == (50.0, "HORIZON", None)
    # The bounds of a network are computed once; those of other thresholds and start values follow from them.
    bounds = Bounds(analyse(scenario))
    seen = observe(bounds.analysis, arc, 0.01)
    expected = (bounds.energy_radius, bounds.printed.rate, seen.radius, seen.min_gap)
    assert [row[name] for name in given.frame.bounds] == pytest.approx(expected, rel=1e-9)


def test_runs_that_fail_say_why_and_the_others_go_on(many, expected):
    failed = [row for row in expected if row[-1] is not None]
    assert len(expected) == len(many) == 90
    assert len(failed) == 3
    assert "[trigger] threshold is 0.0; it must be positive." in failed[0][-1]
    events = many.columns.index("events") + 1
    assert min(row[events] for row in expected if row[-1] is None) >= 1


def test_graphs_and_seeds_vary_as_any_other_key(tmp_path):
    path = tmp_path / "drawn.toml"
    path.write_text(
        'name = "drawn"\nstop_time = 2.0\n[network]\nagents = 8\ngraph = "ring"\ndegree = 4\n'
        'initial = {draw = "normal", mean = 0.0, deviation = 1.0, seed = 1}\n'
        '[weights]\nkind = "constant"\nvalue = 1.0\n[trigger]\nkind = "static"\nthreshold = 0.3\n'
    )
    given = study(
        path, ["network.graph=ring,small-world", "network.seed=seeds", "network.initial.seed=seeds"], repeats=2, seed=4
    )
    with run_sweep(given, tmp_path / "a.sqlite", executor=ThreadPoolExecutor(1)) as table:
        assert table.failures == 0
        assert table.column("network.graph").tolist() == ["ring", "ring", "small-world", "small-world"]
        assert len(set(table.column("integral"))) == 4
    edges = [given.frame.scenario(given.values(run)).network.edges for run in range(4)]
    assert edges[0] == edges[1]
    assert [len(each) for each in edges[2:]] == [16, 16]
    assert edges[2] != edges[3]


def test_large_networks_run_event_by_event(tmp_path):
    edges = [[k, k % 18 + 1] for k in range(1, 19)]
    path = tmp_path / "ring.toml"
    path.write_text(
        f'name = "ring"\nstop_time = 4.0\n[network]\nagents = 18\nedges = {edges}\n'
        f"initial = {[k % 5 for k in range(18)]}\n"
        '[weights]\nkind = "constant"\nvalue = 1.0\n[trigger]\nkind = "static"\nthreshold = 0.3\n'
    )
    given = study(path, ["trigger.threshold=0.2,0.4"], bounds=["radius.energy", "radius.observed"])
    with run_sweep(given, tmp_path / "a.sqlite", executor=ThreadPoolExecutor(1)) as table:
        rows = [dict(zip(("run", *given.columns), row, strict=True)) for row in table.rows()]
    for row in rows:
        scenario = given.frame.scenario({"trigger.threshold": row["trigger.threshold"]})
        # The whole as one automaton: another engine's times of events, to some 1e-12 of the run.
        arc = hm.simulate(closed_loop(scenario), 4.0)
        found = run_metrics(scenario, arc)
        assert row["failure"] is None
        assert row["events"] == sum(found["broadcasts"])
        assert row["gap_min"] == pytest.approx(found["gaps"]["min"], rel=1e-8)
        assert row["integral"] == pytest.approx(found["integral"], rel=1e-8)
        assert row["radius.observed"] <= row["radius.energy"]


def test_thresholds_that_vanish_too_fast_end_the_run_and_say_so(small, tmp_path):
    given = study(small, ["trigger.decay=0.0,9.0"], max_jumps=50)
    with run_sweep(given, tmp_path / "a.sqlite", executor=ThreadPoolExecutor(1)) as table:
        assert table.failures == 1
        assert table.column("stop").tolist() == ["HORIZON", "JUMPS"]
        assert table.column("end")[1] < LONG
        assert "50 jumps" in table.column("failure")[1]


def test_one_worker_two_workers_one_of_which_is_killed_and_none_give_the_same_table(many, expected, tmp_path):
    killed = []

    def kill_one(done, total):
        if done and not killed:
            killed.append(active_children()[0].pid)
            os.kill(killed[0], signal.SIGKILL)

    assert rows_of(many, tmp_path / "two.sqlite", workers=2, progress=kill_one) == expected
    assert killed


def test_a_sweep_that_was_killed_goes_on_where_it_was(many, expected, small, tmp_path):
    # On a machine that is busy the sweep may be over before it is killed: then once more.
    paths = (tmp_path / f"killed{k}.sqlite" for k in range(5))
    path, children = next(
        (path, children) for path in paths if (children := killed(many, small, path)) and count(path) < len(many)
    )
    done = count(path)
    assert done > 0
    began = []
    assert rows_of(many, path, executor=CountingExecutor(began)) == expected
    assert len(began) == len(many) - done
    # Its workers have ended by themselves.
    limit = time.monotonic() + 60
    while any(is_alive(child) for child in children):
        assert time.monotonic() < limit
        time.sleep(0.05)


def killed(many, small, path):
    """Begin the sweep in a process of its own and kill that after the first rows; return its workers."""
    axes = [f"--vary={axis}" for axis in ("trigger.threshold=0:0.2:30", "trigger.decay=0.0,0.02,0.04")]
    call = [sys.executable, "-m", "cosim.cli.main", "sweep", str(small), *axes]
    call += ["--bounds=rate.floquet,radius.energy", f"--table={path}", "--workers=1"]
    process = subprocess.Popen(call, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    while not (path.exists() and count(path)):
        assert process.poll() is None
        time.sleep(0.01)
    children = children_of(process.pid)
    # Whoever asks for it meanwhile is told that it runs; stopped, so that it does not end before.
    process.send_signal(signal.SIGSTOP)
    if process.poll() is None and count(path) < len(many):
        with pytest.raises(SweepError, match="another process runs the sweep"):
            run_sweep(many, path, executor=ThreadPoolExecutor(1)).close()
    process.kill()
    process.wait()
    return children


def count(path):
    try:
        with closing(sqlite3.connect(path)) as database:
            return database.execute("SELECT count(*) FROM runs").fetchone()[0]
    except sqlite3.OperationalError:
        return 0


def children_of(pid):
    try:
        with open(f"/proc/{pid}/task/{pid}/children") as file:
            return [int(child) for child in file.read().split()]
    except OSError:
        return []


def is_alive(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


class CountingExecutor(ThreadPoolExecutor):
    """Notes each point that is run."""

    def __init__(self, began):
        super().__init__(1)
        self.began = began

    def submit(self, function, frame, points):
        self.began.extend(points)
        return super().submit(function, frame, points)


class Fragile(Executor):
    """Runs at once; it breaks when it is given a threshold that it does not survive."""

    def __init__(self, deadly):
        self.deadly, self.is_broken = deadly, False

    def submit(self, function, frame, points):
        future = Future()
        self.is_broken |= any(point["trigger.threshold"] == self.deadly for point in points)
        if self.is_broken:
            future.set_exception(BrokenProcessPool("a worker died"))
        else:
            future.set_result(function(frame, points))
        return future


class FragileCrew:
    """Makes executors that break; counts them."""

    workers, made = 2, 0

    def executor(self):
        self.made += 1
        return Fragile(0.2)

    def dismiss(self, executor):
        pass

    finish = dismiss


def test_a_run_that_takes_its_worker_along_is_told_and_the_others_are_as_ever(many, expected, tmp_path, monkeypatch):
    crew = FragileCrew()
    monkeypatch.setattr(execute, "_crew", lambda *_: crew)
    rows = rows_of(many, tmp_path / "a.sqlite")
    deadly = [run for run in range(len(many)) if many.values(run)["trigger.threshold"] == 0.2]
    assert len(deadly) == 3
    assert [row for row in rows if row[0] not in deadly] == [row for row in expected if row[0] not in deadly]
    for run in deadly:
        assert rows[run][-1] == "its worker died each of the 2 times that it was run alone"
    # One for each lonely attempt, and some for the crowds before.
    assert crew.made <= 2 * len(deadly) + 4


def test_an_executor_that_was_given_and_broke_is_said_to_be_so(many, tmp_path):
    with pytest.raises(SweepError, match="rows that are done are in the table"):
        run_sweep(many, tmp_path / "a.sqlite", executor=Fragile(0.2))


def test_a_file_of_another_sweep_or_of_something_else_is_refused(many, small, tmp_path):
    path = tmp_path / "a.sqlite"
    SweepTable(path, many).close()
    with pytest.raises(SweepError, match="holds another sweep, with another entry 'axes'"):
        SweepTable(path, study(small, ["trigger.threshold=0.1,0.2"], bounds=many.frame.bounds))
    assert Study.from_dict(json.loads(json.dumps(many.as_dict()))) == many
    other = tmp_path / "other.sqlite"
    with closing(sqlite3.connect(other)) as database:
        database.execute("CREATE TABLE things (a)")
    text = tmp_path / "text.sqlite"
    text.write_text("no database, but long enough to be looked at as one" * 30)
    for file, message in (
        (other, "not the table of a sweep"),
        (text, "cannot be used as the table of a sweep"),
        (tmp_path / "none.sqlite", "there is no file"),
    ):
        with pytest.raises(SweepError, match=message):
            SweepTable(file)
    assert text.read_text().startswith("no database")


def test_exports_hold_the_table(many, expected, tmp_path):
    path = tmp_path / "a.sqlite"
    with SweepTable(path, many) as table:
        table.write((row[0], dict(zip(many.columns, row[1:], strict=True))) for row in reversed(expected))
        write_csv(table, tmp_path / "a.csv")
        with (tmp_path / "a.csv").open(newline="") as file:
            lines = list(csv.reader(file))
        assert lines[0] == ["run", *many.columns]
        assert lines[1:] == [["" if value is None else str(value) for value in row] for row in expected]
        parquet = pytest.importorskip("pyarrow.parquet")
        write_parquet(table, tmp_path / "a.parquet")
        read = parquet.read_table(tmp_path / "a.parquet").to_pydict()
    assert list(read) == ["run", *many.columns]
    assert [tuple(values) for values in zip(*read.values(), strict=True)] == expected


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"vary": ["trigger.decay=0,1"], "bounds": ["radius.tight"]}, "there is no bound 'radius.tight'"),
        ({"vary": ["trigger.decay=0,1"], "design": "star"}, "there is no design 'star'; it must be one of grid"),
        ({"vary": ["trigger.decay=0,1"], "seed": -1}, "seed is -1"),
        ({"vary": ["trigger.decay=0,1"], "max_jumps": 0}, "max_jumps is 0"),
        ({"vary": ["trigger.decai=0,1"]}, "unknown key 'decai'. Did you mean 'decay'"),
    ],
)
def test_slips_are_refused_before_anything_runs(options, message):
    with pytest.raises(ValueError, match=message):
        study("paper-a", **options)


def test_dask_gives_the_same_table(many, expected, tmp_path):
    distributed = pytest.importorskip("distributed")
    # On the loopback only, the dashboard too; its workers are threads of this process, which have loaded everything.
    own = {"host": "127.0.0.1", "protocol": "tcp://", "dashboard_address": "127.0.0.1:0"}
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, silence_logs=50, **own
    ) as cluster:
        assert cluster.scheduler_address.startswith("tcp://127.0.0.1:")
        assert rows_of(many, tmp_path / "a.sqlite", scheduler=cluster.scheduler_address) == expected


@pytest.mark.long
def test_dask_gives_the_same_table_after_a_worker_was_killed(many, expected, tmp_path):
    distributed = pytest.importorskip("distributed")
    own = {"host": "127.0.0.1", "protocol": "tcp://", "dashboard_address": "127.0.0.1:0"}
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, silence_logs=50, **own) as cluster:
        with distributed.Client(cluster) as client:
            pids = list(client.run(os.getpid).values())

        def kill_one(done, total):
            if done and pids:
                os.kill(pids.pop(), signal.SIGKILL)
                pids.clear()

        assert rows_of(many, tmp_path / "a.sqlite", scheduler=cluster.scheduler_address, progress=kill_one) == expected
        assert not pids


def test_a_scheduler_that_does_not_answer_is_said_to_be_so(many, tmp_path):
    pytest.importorskip("distributed")
    with pytest.raises(SweepError, match="no Dask scheduler answers at nowhere://x:1"):
        run_sweep(many, tmp_path / "a.sqlite", scheduler="nowhere://x:1")
