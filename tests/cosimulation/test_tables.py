"""Inputs from files, rows as they come, comparison with a reference, pictures: `hybrid-fmu cosim` and its files."""

import csv
import math

import numpy as np
import pytest
from matplotlib.figure import Figure
from strangers import BACKWARD

import hybrid_model as hm
from cosim.cli.main import main
from cosim.errors import CosimError, MisfitError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_fixed_step
from cosim.result import CosimResult
from cosim.system import System
from cosim.tables.comparison import deviations
from cosim.tables.input_table import Polyline, Staircase, read_inputs
from cosim.tables.picture import draw
from cosim.tables.row_file import Columns, RowFile


@pytest.fixture
def echo(stranger):
    """A stranger without events of its own, and a way to write a table."""
    return stranger(experiment='stopTime="2" stepSize="0.5"', events=False)


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def columns(path):
    with path.open(newline="") as file:
        names, *rows = csv.reader(file)
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def test_inputs_of_all_types_arrive_exactly(echo, tmp_path):
    table = written(
        tmp_path / "in.csv",
        "time,int64_in,uint64_in,boolean_in,string_in,enumeration_in,float64_in\n"
        "0,-9223372036854775808,0,false,a b,low,0\n"
        "1,9223372036854775807,18446744073709551615,true,c,high,2\n",
    )
    out = tmp_path / "out.csv"
    assert main(["cosim", str(echo), "--input-file", str(table), "--output-file", str(out)]) == 0
    found = columns(out)
    # At 1 s there is a row before the jump of the table and one behind it.
    assert found["time"] == ["0.0", "0.5", "1.0", "1.0", "1.5", "2.0"]
    assert found["int64_out"] == ["-9223372036854775808"] * 3 + ["9223372036854775807"] * 3
    assert found["uint64_out"][-1] == "18446744073709551615"
    assert found["string_out"] == ["a b"] * 3 + ["c"] * 3
    assert found["enumeration_out"][-1] == "7"


class Through(hm.HybridAutomaton):
    u = hm.Input(0.0)
    x = hm.State(0.0, output=True)
    y = hm.Output()

    def flow_map(self, s):
        return {"x": s.u}

    def outputs(self, s):
        return {"y": 2.0 * s.u}


JUMPS = "time,u\n0,-1\n0.3,-1\n0.3,3\n0.75,3\n0.75,5\n1.2,5\n1.2,7\n2,7\n"


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_single_fmu_has_both_rows_of_each_jump_of_its_inputs(fmi, tmp_path, exported):
    """At an output point, where 3 * 0.1 is not 0.3, and between two; what it integrates is exact: u stands still."""
    table, out = written(tmp_path / "in.csv", JUMPS), tmp_path / "out.csv"
    command = ["cosim", str(exported(Through(), "through", fmi)), "--input-file", str(table), "--stop-time", "1"]
    assert main([*command, "--step-size", "0.1", "--output-file", str(out)]) == 0
    found = {name: np.array(column, dtype=float) for name, column in columns(out).items()}
    grid = sorted([0.1 * k for k in range(11)] + [0.3, 0.75, 0.75])
    np.testing.assert_allclose(found["time"], grid, atol=1e-15)
    before = np.array([-2.0] * 4 + [6.0] * 6 + [10.0] * 4)
    np.testing.assert_array_equal(found["y"], before)
    t = found["time"]
    exact = -np.minimum(t, 0.3) + 3.0 * np.clip(t - 0.3, 0.0, 0.45) + 5.0 * np.maximum(t - 0.75, 0.0)
    np.testing.assert_allclose(found["x"], exact, atol=1e-12)


def test_jumps_of_inputs_arrive_late_where_steps_have_one_length(stranger, tmp_path):
    path = stranger(variable=False, events=False, experiment='stopTime="1" stepSize="0.1"')
    table, out = written(tmp_path / "in.csv", "time,int8_in\n0,1\n0.75,2\n"), tmp_path / "out.csv"
    assert main(["cosim", str(path), "--input-file", str(table), "--output-file", str(out)]) == 0
    found = columns(out)
    rows = [(float(t), value) for t, value in zip(found["time"], found["int8_out"], strict=True)]
    assert [value for t, value in rows if t == pytest.approx(0.8)] == ["1", "2"]
    assert len(rows) == 12


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("time,int8_in\n0,200\n", "stranger.int8_in is set to 200, but it is an Int8"),
        ("time,int8_in\n0,x\n", "stranger.int8_in is set to 'x'"),
        ("time,nobody\n0,1\n", "stranger.nobody is neither an input nor a tunable parameter"),
        ("time,int8_in\n1,1\n0,1\n", "row 3: the time 0 s comes after 1 s"),
        ("time,int8_in\n0\n", "row 2: it has 1 fields, but there are 2 names"),
        ("time,int8_in\nnan,1\n", "row 2: the time 'nan' is no finite number"),
        ("int8_in,time\n0,1\n", "begins with time"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(text, sentence, echo, tmp_path, capsys):
    table = written(tmp_path / "in.csv", text)
    assert main(["cosim", str(echo), "--input-file", str(table)]) == 2
    assert sentence in capsys.readouterr().err


def test_lines_and_stairs_jump_where_a_time_comes_twice():
    line, stairs = Polyline((0.0, 1.0, 1.0, 2.0), (0.0, 2.0, 5.0, 6.0)), Staircase((0.0, 1.0, 2.0), (1, 1, 3))
    assert [line(t) for t in (-1.0, 0.0, 0.5, 1.0, 1.5, 3.0)] == [0.0, 0.0, 1.0, 5.0, 5.5, 6.0]
    assert line.jumps == [1.0]
    assert [stairs(t) for t in (-1.0, 0.0, 1.9, 2.0, 9.0)] == [1, 1, 1, 3, 3]
    assert stairs.jumps == [2.0]


def test_an_input_that_is_driven_cannot_come_from_a_table(echo, tmp_path):
    system = System([FmuSlave("a", echo), FmuSlave("b", echo)], {"b.int8_in": "a.int8_out"})
    table = written(tmp_path / "in.csv", "time,b.int8_in\n0,1\n")
    with pytest.raises(MisfitError, match=r"b.int8_in cannot be given a value, for a.int8_out -> b.int8_in drives it"):
        read_inputs(table, system)


def test_a_vector_is_one_column():
    table = Columns(["a.y[1]", "a.y[2]", "a.z"], {"a.y[1]": "a.y", "a.y[2]": "a.y"}, {"a.y": "y"})
    assert table.names == ["y", "a.z"]
    assert table.cells([1.0, 0.1, True]) == ["1.0 0.1", 1]


def test_rows_are_there_while_the_run_goes_on(tmp_path):
    rows, result = RowFile(tmp_path / "new" / "out.csv", Columns(["x"], {}, {})), CosimResult()
    result.watch = rows.take
    result.keep(0.0, ["x"], [1.5])
    assert (tmp_path / "new" / "out.csv").read_bytes() == b"time,x\r\n0.0,1.5\r\n"
    rows.close()


def test_a_call_that_is_refused_leaves_the_results_of_an_earlier_one(echo, tmp_path):
    out = written(tmp_path / "out.csv", "time,x\n0,1\n")
    assert main(["cosim", str(echo), "--output-file", str(out), "--output-interval", "0.3"]) == 2
    assert out.read_text() == "time,x\n0,1\n"


def test_a_full_disk_leaves_whole_lines(tmp_path):
    rows, result = RowFile(tmp_path / "out.csv", Columns(["x"], {}, {})), CosimResult()
    result.watch = rows.take
    result.keep(0.0, ["x"], [1.0])
    file = rows._file

    class Full:
        """A disk with room for five more bytes."""

        room = 5

        def write(self, content):
            if not self.room:
                raise OSError(28, "No space left on device")
            room, self.room = self.room, 0
            return file.write(content[:room])

        def fileno(self):
            return file.fileno()

        def close(self):
            file.close()

    rows._file = Full()
    with pytest.raises(CosimError, match=r"out\.csv cannot be written any further at t = 1 s: No space left"):
        result.keep(1.0, ["x"], [123456.0])
    rows._file.close()
    assert (tmp_path / "out.csv").read_bytes() == b"time,x\r\n0.0,1.0\r\n"


def test_what_there_is_stays_when_an_fmu_fails(stranger, tmp_path, capsys):
    out = tmp_path / "out.csv"
    table = written(tmp_path / "in.csv", "time,int8_in\n0,1\n1.05,1\n1.1,2\n")
    path = stranger(events=False, experiment='stopTime="2" stepSize="0.1"')
    slave = FmuSlave("stranger", path)
    inputs = read_inputs(table, System([slave], {}))

    def fail(result):
        if result.times[-1] > 1.0:
            raise CosimError("enough")

    with pytest.raises(CosimError, match="enough"):
        run_fixed_step(System([slave], {}), 2.0, 0.1, record=["stranger.x"], inputs=inputs, watch=fail)
    code = main(["cosim", str(path), "--start-value", "behaviour=5", "--output-file", str(out)])
    assert code == 1
    assert f"{out} has what there was up to t = 0 s" in capsys.readouterr().err
    assert columns(out)["time"] == ["0.0"]


def test_outputs_that_a_file_of_numbers_does_not_hold_are_named(echo, tmp_path, capsys):
    table = tmp_path / "run.npz"
    assert main(["cosim", str(echo), "--output-file", str(table)]) == 0
    assert "run.npz holds numbers alone, and is without string_out, binary_out: .csv has all" in capsys.readouterr().err
    with np.load(table) as columns_of_numbers:
        assert {"x", "int64_out"} <= set(columns_of_numbers)
        assert "string_out" not in columns_of_numbers


def test_a_run_is_compared_with_a_table(echo, tmp_path, capsys):
    out = tmp_path / "out.csv"
    assert main(["cosim", str(echo), "--output-file", str(out)]) == 0
    assert main(["cosim", str(echo), "--reference-file", str(out)]) == 0
    assert "  x is as in out.csv\n" in capsys.readouterr().out
    off = written(tmp_path / "off.csv", "time,x,unknown\n0,0,0\n0.5,0.51,0\n")
    assert main(["cosim", str(echo), "--reference-file", str(off)]) == 1
    said = capsys.readouterr().out
    assert "x differs from off.csv by 0.0196 of its size, at 0.5 s: beyond 0.001" in said
    assert "not compared, as the run has none of that form: unknown" in said
    assert main(["cosim", str(echo), "--reference-file", str(off), "--reference-tolerance", "0.02"]) == 0


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ("0,0\n2,0.8\n", ""),
        ("0,0\n2,0.8\n3,3\n", "1 of its 3 rows are not compared: it goes from 0 to 3 s, and the run from 0 to 2 s"),
        ("-1,0\n0,0\n2,0.8\n", "1 of its 3 rows are not compared: it goes from -1 to 2 s, and the run from 0 to 2 s"),
        (
            "0,0\n1,0.4\n",
            "it goes from 0 to 1 s alone, and the run from 0 to 2 s: the rest of that is not compared",
        ),
    ],
)
def test_what_is_not_compared_is_told(rows, told, echo, tmp_path, capsys):
    table = written(tmp_path / "ref.csv", f"time,x\n{rows}")
    assert main(["cosim", str(echo), "--start-value", "rate=0.4", "--reference-file", str(table)]) == 0
    said = capsys.readouterr()
    assert (f"{table}: {told}" in said.err) if told else said.err == ""
    assert not told or f"  ref.csv: {told}" in said.out


@pytest.mark.parametrize(("rows", "status"), [("0,0\n0.5,0.5\n1,0\n", 0), ("0,0\n0.5,0.5\n1,0\n2,0\n", 1)])
def test_a_run_that_ended_early_does_not_agree_with_a_table_that_goes_on(rows, status, stranger, tmp_path, capsys):
    """It ends the run itself at 1 s, as it may."""
    table = written(tmp_path / "ref.csv", f"time,x\n{rows}")
    path = stranger(events=False, experiment='stopTime="2" stepSize="0.5"')
    command = ["cosim", str(path), "--start-value", "ends=1", "--reference-file", str(table)]
    assert main(command) == status
    assert ("since it ended before its time" in capsys.readouterr().out) == bool(status)


def test_at_a_jump_either_side_is_right_and_texts_are_compared(tmp_path):
    table = written(tmp_path / "ref.csv", "time,x,s,v\n0,0,a,1 2\n1,5,a,1 2\n1.5,5.5,b,1 2\n")
    signals = {"x": [0.0, 1.0, 5.0, 6.0], "s": ["a", "a", "b", "b"], "v[1]": [1.0] * 4, "v[2]": [2.0, 2.0, 2.0, 2.5]}
    compared = deviations(table, [0.0, 1.0, 1.0, 2.0], signals)
    assert compared.missing == []
    largest = {deviation.name: deviation.largest for deviation in compared.found}
    assert largest["x"] == 0.0
    assert largest["s"] == 1.0
    assert largest["v[2]"] == pytest.approx(0.125)
    with pytest.raises(MisfitError, match="no time in common"):
        deviations(table, [3.0, 4.0], {"x": [0.0, 0.0]})


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        (b"time,x\n0,0\n0.5,abc\n", "column x: could not convert string to float: 'abc'"),
        (b"time,x\n0,0\nlate,1\n", "row 3: the time 'late' is no finite number"),
        (
            b"time,x\n-1,0\n10,1\n",
            "and the run have no time in common: it goes from -1 to 10 s, and the run from 0",
        ),
        (b"time,x\n0,0\n1\n", "row 3: it has 1 fields, but there are 2 names"),
        (b"\xff\xfe\x00", "no file of comma-separated values in UTF-8"),
        (b"", "no line of names that begins with time"),
    ],
)
def test_what_is_no_table_of_reference_is_refused(table, sentence, tmp_path):
    path = tmp_path / "ref.csv"
    path.write_bytes(table)
    with pytest.raises(MisfitError, match=sentence):
        deviations(path, [0.0, 1.0], {"x": [0.0, 1.0]})


def test_events_are_logged_and_outputs_drawn(stranger, tmp_path):
    log, picture = tmp_path / "events.csv", tmp_path / "run.png"
    command = ["cosim", str(stranger()), "--start-value", "rate=2", "--event-log", str(log), "--plot", str(picture)]
    assert main(command) == 0
    logged = columns(log)
    assert logged.pop("time") == ["0.5", "1.0", "1.5", "2.0"]
    assert logged == {"component": ["stranger"] * 4, "clocks": [""] * 4, "kind": ["stopped"] * 4}
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_events_before_a_failure_are_logged(stranger, tmp_path, capsys):
    """It refuses to go back in time after its first event, at 0.5 s."""
    log = tmp_path / "events.csv"
    values = ("rate=2", f"behaviour={BACKWARD}")
    command = ["cosim", str(stranger()), "--event-log", str(log), *(f"--start-value={value}" for value in values)]
    assert main(command) == 1
    assert "outside the step" in capsys.readouterr().err
    assert columns(log) == {"time": ["0.5"], "component": ["stranger"], "clocks": [""], "kind": ["stopped"]}


def test_a_table_of_reference_that_does_not_fit_is_wrong_usage(echo, tmp_path, capsys):
    table = written(tmp_path / "ref.csv", "time,nobody\n0,1\n")
    assert main(["cosim", str(echo), "--reference-file", str(table)]) == 2
    assert "has none of the columns" in capsys.readouterr().err


def test_a_trajectory_of_a_scenario_has_both_rows_of_a_jump(tmp_path):
    for engine in ("automaton", "network"):
        folder = tmp_path / engine
        command = ["simulate", "paper-a", "--stop-time", "2", "--engine", engine, "--out", str(folder)]
        assert main(command) == 0
        table = columns(folder / "trajectory.csv")
        times = np.array(table["time"], dtype=float)
        sent = np.array([table[f"agent{i}.broadcast"] for i in range(1, 5)], dtype=float)
        twice = np.flatnonzero(np.diff(times) == 0.0)
        assert twice.size >= 2
        # Broadcasts are constant but for the second rows.
        changed = np.flatnonzero(np.any(np.diff(sent) != 0.0, axis=0))
        assert set(changed) <= set(twice)
        assert math.isclose(times[-1], 2.0)


def test_names_lie_on_no_curve_and_whole_numbers_have_whole_ticks(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    times, names = [0.0, 1.0, 1.0, 2.0], [f"modes{k}" for k in range(4)]
    signals = {"mode": [0, 0, 2, 2], "is_on": [True] * 4, "level": [0.0, 1.0, 0.0, 0.5]}
    signals |= {name: [0, 1, 1, 3] for name in names}
    draw(times, signals, "run", tmp_path / "run.png", show=False)
    figure = drawn[0]
    figure.canvas.draw()
    for ax, values in zip(figure.axes, signals.values(), strict=True):
        assert not ax.get_legend().get_window_extent().overlaps(ax.get_window_extent())
        low, high = ax.get_ylim()
        ticks = [tick for tick in ax.get_yticks() if low <= tick <= high]
        assert ticks
        assert isinstance(values[0], float) or all(tick == round(tick) for tick in ticks)
