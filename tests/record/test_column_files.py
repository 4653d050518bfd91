"""Runs in files of other programs, read back by those: NumPy, SciPy, xarray, pandas, Octave."""

import shutil
import subprocess
import sys

import numpy as np
import pytest
import scipy.io
import xarray

import hybrid_model as hm
from cosim.cli.main import main
from cosim.cli.options.values import TABLES
from hybrid_model.models import BouncingBall
from hybrid_model.record.column_files import ENDINGS, matlab_names, write_columns

COLUMNS = {"time": np.array([0.0, 0.5, 0.5]), "agent1.x": np.array([1.0, 0.1, -0.1]), "w[1]": np.array([1e-300, 2, 3])}


@pytest.fixture(scope="module")
def ball():
    return hm.simulate(BouncingBall(), 1.2)


def test_npz_has_the_names_and_the_bits(tmp_path):
    write_columns(tmp_path / "a.npz", {**COLUMNS, "file": COLUMNS["time"]})
    with np.load(tmp_path / "a.npz") as found:
        for name, column in COLUMNS.items():
            np.testing.assert_array_equal(found[name], column)
        assert len(found.files) == 4


def test_netcdf_in_xarray(ball, tmp_path):
    ball.save(tmp_path / "ball.nc")
    with xarray.open_dataset(tmp_path / "ball.nc", engine="scipy") as found:
        np.testing.assert_array_equal(found["h"], ball["h"])
        np.testing.assert_array_equal(found["j"], ball.j)
        assert found["v"].attrs["units"] == "m/s"
        assert found.attrs["stop"] == "HORIZON"


def test_mat_in_scipy(ball, tmp_path):
    ball.save(tmp_path / "ball.mat")
    found = scipy.io.loadmat(tmp_path / "ball.mat", simplify_cells=True)
    np.testing.assert_array_equal(found["v"], ball["v"])
    np.testing.assert_array_equal(found["t"], ball.t)
    assert found["info"]["columns"]["h"] == {"name": "h", "unit": "m"}
    assert found["info"]["automaton"] == "BouncingBall"


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="apt-get install octave: reads .mat files back")
def test_mat_in_octave(tmp_path):
    write_columns(tmp_path / "a.mat", COLUMNS, {"time": "s"})
    program = "s = load('a.mat'); printf('%.17g ', s.time, s.agent1_x, s.w_1); disp(s.info.columns.agent1_x.name)"
    call = ["octave-cli", "--norc", "--no-history", "--eval", program]
    done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True, check=True)
    *numbers, name = done.stdout.split()
    np.testing.assert_array_equal([float(number) for number in numbers], np.concatenate(list(COLUMNS.values())))
    assert name == "agent1.x"


def test_names_of_matlab():
    names = ["a.b", "a_b", "1x", "w[1,2]", "Ω", "x" * 70, "x" * 71, "_"]
    found = matlab_names(names)
    assert list(found.values())[:5] == ["a_b", "a_b_2", "x1x", "w_1_2", "x"]
    assert len(set(found.values())) == len(names)
    assert all(name.isidentifier() and name[0] != "_" and len(name) <= 63 for name in found.values())


def test_pandas_has_a_row_for_each_side_of_a_jump(ball):
    frame = ball.to_dataframe()
    (impact,) = ball.event_times("jump")[:1]
    assert len(frame.xs(impact, level="t")) == 2


@pytest.mark.parametrize("ending", ENDINGS)
def test_files_of_the_command_line(ending, tmp_path, capsys):
    assert ENDINGS == TABLES
    path = tmp_path / f"run{ending}"
    assert main(["simulate", "paper-a", "--stop-time", "2", "--output-file", str(path)]) == 0
    if ending == ".csv":
        columns = {name: value for name, value in hm.Samples.from_csv(path).values.items()}
    elif ending == ".nc":
        with xarray.open_dataset(path, engine="scipy") as found:
            columns = {str(name): found[name].to_numpy() for name in found.variables}
    else:
        columns = dict(np.load(path)) if ending == ".npz" else scipy.io.loadmat(path, squeeze_me=True)
    x = columns["agent1_x" if ending == ".mat" else "agent1.x"]
    assert x[0] == 1.0
    assert len(x) > 21
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_other_endings_are_refused_before_the_run(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("cosim.cli.simulate.run", lambda options: pytest.fail("it ran"))
    for call in (["simulate", "paper-a"], ["cosim", "paper-a"]):
        assert main([*call, "--output-file", str(tmp_path / "run.xlsx")]) == 2
        assert "ends in '.xlsx': tables are written as .csv, .npz, .mat, .nc; give one" in capsys.readouterr().err
    with pytest.raises(hm.DataError, match=r"ends in '\.xlsx'"):
        write_columns(tmp_path / "a.xlsx", COLUMNS)


@pytest.mark.skipif(sys.platform == "win32", reason="limits of processes")
@pytest.mark.parametrize("ending", [".csv", ".npz", ".mat"])
def test_a_file_that_does_not_fit_is_named_and_nothing_of_it_is_left(ending, tmp_path):
    import resource

    path, limits = tmp_path / f"run{ending}", resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
    try:
        with pytest.raises(OSError, match="too large") as raised:
            write_columns(path, {"time": np.linspace(0.0, 1.0, 10_000)})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert raised.value.filename == str(path)
    assert list(tmp_path.iterdir()) == []
