"""Samples as plain arrays, CSV files, DataFrames and Datasets; all hold the same numbers."""

import builtins
import sys

import numpy as np
import pytest
from child_python import run_child
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import hybrid_model as hm
from hybrid_model.models import BouncingBall


class Matrix(hm.HybridAutomaton):
    """A scalar, a vector and a matrix."""

    n = hm.Dimension()
    x = hm.State(1.0, unit="m", description="a length")
    w = hm.State(0.0, shape="n", unit="V")
    m = hm.DiscreteState(0.0, shape=("n", "n"))
    g = hm.Parameter([2.0, 3.0])
    y = hm.Output(shape="n")
    transitions = (hm.TimeEvent("turn", lambda self, s: 0.5 + s.m[0, 0], lambda self, s: {"m": s.m.T + 1.0}),)

    def flow_map(self, s):
        return {"x": -s.x, "w": s.m @ s.w}

    def outputs(self, s):
        return {"y": 2.0 * s.w}


@pytest.fixture(scope="module")
def arc():
    return hm.simulate(Matrix(n=2, w=[1.0, 2.0], m=[[0.0, 1.0], [2.0, 3.0]]), 1.0)


@pytest.fixture(scope="module")
def ball():
    return hm.simulate(BouncingBall(), 2.0)


def test_samples_of_an_arc_are_its_samples(arc):
    samples = arc.samples()
    assert set(samples.values) == {"x", "w", "m", "y"}
    assert samples["m"].shape == (len(arc.t), 2, 2)
    for name in samples.values:
        np.testing.assert_array_equal(samples[name], arc[name])
    with pytest.raises(hm.DataError, match="the samples have no variable 'v'; they have x, w, m, y"):
        samples["v"]


@pytest.mark.parametrize("ending", ["npz", "csv", "mat", "nc"])
def test_an_arc_is_saved_into_a_folder_that_is_made(ball, tmp_path, ending):
    path = tmp_path / "new" / "folder" / f"run.{ending}"
    ball.save(path)
    assert [found.name for found in path.parent.iterdir()] == [path.name]


def test_samples_tell_their_size_and_names_and_not_their_numbers(ball):
    assert repr(ball.samples()) == f"Samples({len(ball.t)} at t from 0 to 2 s, j from 0 to {len(ball.jumps)}: h, v)"
    assert repr(hm.Samples([], [], {})) == "Samples(0: )"


def test_a_dataframe_has_index_t_j_scalar_columns_and_units(arc):
    frame = arc.to_dataframe()
    assert list(frame.columns) == ["x", "w[1]", "w[2]", "m[1,1]", "m[1,2]", "m[2,1]", "m[2,2]", "y[1]", "y[2]"]
    assert frame.index.names == ["t", "j"]
    np.testing.assert_array_equal(frame.index.get_level_values("t"), arc.t)
    np.testing.assert_array_equal(frame.index.get_level_values("j"), arc.j)
    np.testing.assert_array_equal(frame["m[2,1]"], arc["m"][:, 1, 0])
    assert frame.attrs["units"] == {**dict.fromkeys(frame.columns, ""), "x": "m", "w[1]": "V", "w[2]": "V"}
    assert frame.attrs["descriptions"]["x"] == "a length"
    assert frame.attrs["parameters"] == {"g": [2.0, 3.0]}
    assert (frame.attrs["automaton"], frame.attrs["stop"]) == ("Matrix", "HORIZON")
    assert list(arc.to_dataframe(["x"]).columns) == ["x"]


def test_a_dataset_has_arrays_with_units_on_hybrid_time(arc):
    data = arc.to_xarray()
    assert data["m"].dims == ("sample", "m_1", "m_2")
    np.testing.assert_array_equal(data["m"], arc["m"])
    assert data["w"].attrs == {"units": "V", "description": "", "kind": "continuous states"}
    np.testing.assert_array_equal(data["t"], arc.t)
    assert (data["t"].attrs["units"], data.attrs["stop"], data.attrs["g"]) == ("s", "HORIZON", [2.0, 3.0])
    np.testing.assert_array_equal(data["x"].sel(j=1), arc["x"][arc.j == 1])
    assert set(data.reset_index("sample").coords) == {"t", "j"}


def test_a_dataframe_gives_the_samples_back(arc):
    back = hm.Samples.from_dataframe(arc.to_dataframe())
    np.testing.assert_array_equal(back.t, arc.t)
    np.testing.assert_array_equal(back.j, arc.j)
    for name, value in arc.samples().values.items():
        np.testing.assert_array_equal(back[name], value)
    np.testing.assert_array_equal(hm.Samples.from_dataframe(arc.to_dataframe().reset_index())["m"], arc["m"])


def test_a_csv_file_gives_the_samples_back_bit_by_bit(arc, tmp_path):
    arc.samples().to_csv(tmp_path / "arc.csv")
    back = hm.Samples.from_csv(tmp_path / "arc.csv")
    np.testing.assert_array_equal(back.t, arc.t)
    for name, value in arc.samples().values.items():
        np.testing.assert_array_equal(back[name], value)


@settings(deadline=None)
@given(hnp.arrays(np.float64, (4, 2, 3), elements=st.floats(allow_nan=False)))
def test_columns_and_arrays_are_inverse(values):
    samples = hm.Samples(np.arange(4.0), np.zeros(4), {"a.m": values, "x": values[:, 0, 0]})
    back = hm.Samples.from_columns(samples.t, samples.j, samples.columns())
    np.testing.assert_array_equal(back["a.m"], values)
    np.testing.assert_array_equal(back["x"], values[:, 0, 0])


def test_pandas_reads_what_is_written_and_the_other_way_round(ball, tmp_path):
    import pandas

    ball.samples().to_csv(tmp_path / "ours.csv")
    frame = pandas.read_csv(tmp_path / "ours.csv")
    np.testing.assert_array_equal(frame["h"], ball["h"])
    ball.to_dataframe().to_csv(tmp_path / "theirs.csv")
    np.testing.assert_array_equal(hm.Samples.from_csv(tmp_path / "theirs.csv")["v"], ball["v"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"bad\.csv has no column t or time; it has none: the first line names the columns"),
        ("h,j\n0,1\n", r"bad\.csv has no column t or time; it has h, j"),
        ("t,j,h\n0,0\n", r"bad\.csv, line 2, column 3: the line has 2 fields, but the line of names has 3"),
        ("t,j,h\n\n0,0,high\n", r"bad\.csv, line 3, column 3 \(h\): 'high' is not a number"),
        ("t,j,h\n0,0,\n", r"bad\.csv, line 2, column 3 \(h\): the field is empty: give a number"),
        ("t,h\n0,1,\n", r"bad\.csv, line 2, column 3: the line has 3 fields, .* 2: remove the comma at its end"),
        ("t,h,\n0,1,\n", r"bad\.csv, line 1, column 3: the line ends with a comma: remove it, in every line"),
        ("t,,h\n0,1,2\n", r"bad\.csv, line 1, column 2: the column has no name: give it one"),
        ("t,h,h\n0,1,2\n", r"bad\.csv, line 1, column 3: the name h is there twice"),
        ("t;h\n0;1\n", r"bad\.csv, line 1: names are separated by semicolons: separate them by commas"),
        ("t,w\n0,1 2\n1,1\n", r"bad\.csv, line 3, column 2 \(w\): the field holds 1 numbers, .* first row 2"),
        ("t,j,h\n0,0.5,1\n", "j counts jumps, but holds numbers that are not whole"),
        ("t,j,w[1],w[3]\n0,0,1,2\n", r"the columns of w are \[\(1,\), \(3,\)\]: give every element of one array"),
        ("t,j,w,w[1]\n0,0,1,2\n", "the columns of w are"),
    ],
)
def test_tables_that_are_no_samples_are_refused(tmp_path, text, message):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(hm.DataError, match=message):
        hm.Samples.from_csv(tmp_path / "bad.csv")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "t,h\n0,1\n".encode("utf-16"),
            r"bad\.csv, line 1, column 1: the file is in UTF-16, or is no text: save it as",
        ),
        ("t,h\n0,1\n".encode("utf-16-le"), r"bad\.csv, line 1, column 1: the file is in UTF-16"),
        ("t,h\n0,1\n0,H\xf6he\n".encode("latin-1"), r"bad\.csv, line 3, column 2: this is no UTF-8: save the file as"),
        (b't,h\n0,"1', r"bad\.csv, line 2: this is no line of comma-separated values: unexpected end of data"),
    ],
)
def test_files_in_another_encoding_are_refused(tmp_path, content, message):
    (tmp_path / "bad.csv").write_bytes(content)
    with pytest.raises(hm.DataError, match=message):
        hm.Samples.from_csv(tmp_path / "bad.csv")


def test_without_a_column_of_jumps_a_time_that_comes_again_is_a_jump(tmp_path):
    """Three sides at t = 1 are two jumps; the two equal lines at t = 2 are one sample."""
    path = tmp_path / "run.csv"
    path.write_bytes(
        b'\xef\xbb\xbf"time", h ,on\r\n0,1,False\r\n1,2,False\r\n1,0,True\r\n1,0,false\r\n2,5,1\r\n2,5,1\r\n'
    )
    samples = hm.Samples.from_csv(path)
    np.testing.assert_array_equal(samples.t, [0.0, 1.0, 1.0, 1.0, 2.0, 2.0])
    np.testing.assert_array_equal(samples.j, [0, 0, 1, 2, 2, 2])
    np.testing.assert_array_equal(samples["on"], [0.0, 0.0, 1.0, 0.0, 1.0, 1.0])
    # A variable may be called time where t is there; not a number in place of a number is no change.
    path.write_text("t,time,h\n0,5,nan\n0,5,nan\n1,6,nan\n")
    samples = hm.Samples.from_csv(path)
    assert (samples["time"].tolist(), samples.j.tolist()) == ([5.0, 5.0, 6.0], [0, 0, 0])


def test_several_numbers_in_a_field_are_a_vector(tmp_path):
    (tmp_path / "run.csv").write_text("time,w\n0,1 2\n0,3 4\n1, 3 4\n")
    samples = hm.Samples.from_csv(tmp_path / "run.csv")
    np.testing.assert_array_equal(samples["w"], [[1.0, 2.0], [3.0, 4.0], [3.0, 4.0]])
    np.testing.assert_array_equal(samples.j, [0, 1, 1])


def test_jumps_of_a_dataframe_are_found_likewise(ball):
    frame = ball.to_dataframe().reset_index().rename(columns={"t": "time"}).drop(columns="j")
    np.testing.assert_array_equal(hm.Samples.from_dataframe(frame).j, ball.j)
    np.testing.assert_array_equal(hm.Samples.from_dataframe(frame.set_index("time")).t, ball.t)


@pytest.mark.parametrize(
    ("t", "j", "values", "message"),
    [
        ([0.0, 1.0], [0], {}, r"t has shape \(2,\) and j shape \(1,\)"),
        ([0.0, 1.0], [0, 0], {"h": [1.0]}, r"h has shape \(1,\), but there are 2 samples"),
        ([[0.0]], [[0]], {}, r"t has shape \(1, 1\)"),
        ([0.0], [np.nan], {}, "not whole"),
        (["now"], [0], {}, "t does not hold numbers only"),
    ],
)
def test_arrays_that_do_not_fit_together_are_refused(t, j, values, message):
    with pytest.raises(hm.DataError, match=message):
        hm.Samples(t, j, values)


@pytest.mark.parametrize(("package", "method"), [("pandas", "to_dataframe"), ("xarray", "to_xarray")])
def test_without_the_packages_the_remedy_is_told(ball, monkeypatch, package, method):
    found = builtins.__import__

    def absent(name, *rest, **options):
        if name.split(".")[0] == package:
            raise ImportError(name)
        return found(name, *rest, **options)

    monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.setattr(builtins, "__import__", absent)
    with pytest.raises(hm.DataError, match=rf"{method} needs {package}, .* pip install hybrid-fmu\[data\]"):
        getattr(ball, method)()


def test_the_packages_are_imported_only_when_asked_for():
    code = "import hybrid_model, sys; print({'pandas', 'xarray'} & set(sys.modules))"
    assert run_child(code) == "set()"
