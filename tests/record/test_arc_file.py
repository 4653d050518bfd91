"""Arcs in files: bit-exact samples, dense output to rounding, every question answered again, damage told."""

import itertools
import json
import zipfile

import numpy as np
import pytest
from catalogue import cases
from executions import reference
from hypothesis import given, settings
from hypothesis import strategies as st
from test_arc_parts import Switched

import hybrid_model as hm
from hybrid_model.declare.variables import Kind
from hybrid_model.models import BouncingBall
from hybrid_model.record.interpolants import LADDER, Polynomial, interpolate, lobatto

# Of the largest value in the run: what the file aims at (64 ulp), and as much again for evaluating both sides.
ROUNDING = 128 * np.finfo(np.float64).eps


@pytest.fixture(scope="module")
def switched():
    return hm.simulate(Switched(), 3.5, inputs={"u": hm.Signal(lambda t: np.sin(3.0 * t) + (t >= 0.8), [0.8])})


@pytest.fixture
def again(tmp_path):
    def save_and_load(arc):
        arc.save(tmp_path / "arc.npz")
        return hm.load_arc(tmp_path / "arc.npz")

    return save_and_load


def names(arc):
    return [variable.name for variable in arc.automaton.variables]


def assert_same(arc, back):
    """Every question that needs no map has the same answer."""
    np.testing.assert_array_equal(back.t, arc.t)
    np.testing.assert_array_equal(back.j, arc.j)
    for name in names(arc):
        np.testing.assert_array_equal(back[name], arc[name])
        now, was = back.variable(name), arc.variable(name)
        np.testing.assert_array_equal(now.start, was.start)
        flags = ("kind", "unit", "description", "shape", "discrete", "integer", "output", "internal", "computed")
        assert [getattr(now, flag) for flag in flags] == [getattr(was, flag) for flag in flags]
    for one, other in zip(back.jumps, arc.jumps, strict=True):
        assert (one.t, one.j, one.index, one.name) == (other.t, other.j, other.index, other.name)
        for side in ("x_before", "z_before", "x_after", "z_after"):
            np.testing.assert_array_equal(getattr(one, side), getattr(other, side))
    assert (back.stop, back.message, repr(back)) == (arc.stop, arc.message, repr(arc))
    assert back.event_tolerance == arc.event_tolerance
    assert (back.automaton.jumps, back.automaton.clocks) == (arc.automaton.jumps, arc.automaton.clocks)
    assert (back.automaton.priority, back.automaton.has_flow_set) == (
        arc.automaton.priority,
        arc.automaton.has_flow_set,
    )
    np.testing.assert_array_equal(back.flow_lengths, arc.flow_lengths)
    np.testing.assert_array_equal(back.inter_event_times(), arc.inter_event_times())
    for name in {jump.name for jump in arc.jumps}:
        np.testing.assert_array_equal(back.event_times(name), arc.event_times(name))
    for jump in arc.jumps:
        for name in [v.name for v in arc.automaton.variables if v.kind is not Kind.OUTPUT]:
            np.testing.assert_array_equal(back.before(jump)[name], arc.before(jump)[name])
            np.testing.assert_array_equal(back.after(jump)[name], arc.after(jump)[name])


def assert_close_between(arc, back, grid):
    for name in names(arc):
        scale = np.max(np.abs(arc[name]), axis=0, initial=0.0)
        error = np.max(np.abs(back.at(name, grid) - arc.at(name, grid)), axis=0, initial=0.0)
        assert np.all(error <= np.maximum(ROUNDING * scale, 2.0 * back.interpolation_error(name)))
        assert np.all(back.interpolation_error(name) <= ROUNDING * scale)


@pytest.mark.parametrize("name", ["bouncing_ball", "thermostat", "integrator", "gated_sine", "boost_converter"])
def test_a_loaded_arc_answers_as_the_saved_one(name, again):
    arc = reference(name)
    back = again(arc)
    assert_same(arc, back)
    assert_close_between(arc, back, np.linspace(arc.t[0], arc.t[-1], 501))


@pytest.mark.long
@pytest.mark.parametrize("name", cases())
def test_every_model_is_saved_and_loaded(name, again):
    arc = reference(name)
    back = again(arc)
    assert_same(arc, back)
    assert_close_between(arc, back, np.linspace(arc.t[0], arc.t[-1], 501))


@pytest.mark.parametrize("method", hm.Method)
def test_the_dense_output_of_every_method_is_kept(method, again):
    arc = hm.simulate(BouncingBall(), 1.5, solver=hm.Solver(method=method, rtol=1e-6, atol=1e-8))
    assert_close_between(arc, again(arc), np.linspace(0.0, 1.5, 301))


def test_inputs_with_breakpoints_and_outputs_with_kinks_are_kept(switched, again):
    back = again(switched)
    assert_same(switched, back)
    # The output's kink at x = 0.6 lies inside a step, and the input's discontinuity at 0.8 s at the end of one. A kink
    # is confined to 2^-30 of a step shorter than 1 s, where the output moves by less than 3 a second.
    grid = np.sort(np.concatenate([np.linspace(0.0, 3.5, 2001), [0.8, np.nextafter(0.8, 0.0)]]))
    for name in ("x", "k", "u", "y"):
        error = np.max(np.abs(back.at(name, grid) - switched.at(name, grid)))
        assert error <= 3.0 * 2.0**-30
        assert back.interpolation_error(name) <= 3.0 * 2.0**-30
    assert np.max(np.abs(back.at("x", grid) - switched.at("x", grid))) <= 3.0 * ROUNDING


def test_an_output_that_no_polynomial_follows_has_its_error_told(again):
    class Buzz(hm.HybridAutomaton):
        x = hm.State(0.0)
        y = hm.Output()

        def flow_map(self, s):
            return {"x": 1.0}

        def outputs(self, s):
            return {"y": np.sin(1e5 * s.x)}

    arc = hm.simulate(Buzz(), 10.0)
    back = again(arc)
    np.testing.assert_array_equal(back["y"], arc["y"])
    assert back.interpolation_error("y") > 0.1
    assert back.interpolation_error("x") < 1e-13
    # Told once more by a file of the file.
    assert again(back).interpolation_error("y") == back.interpolation_error("y")


def test_a_loaded_arc_is_cut_resampled_tabulated_and_saved_again(switched, again, tmp_path):
    back = again(switched)
    part, was = back.restrict(t=(0.31, 2.77), j=(1, 3)), switched.restrict(t=(0.31, 2.77), j=(1, 3))
    np.testing.assert_array_equal(part.t, was.t)
    np.testing.assert_allclose(part["x"], was["x"], atol=3.0 * ROUNDING)
    grid = np.linspace(0.0, 3.5, 36)
    for name, value in switched.resample(grid, both_sides=True).values.items():
        np.testing.assert_allclose(back.resample(grid, both_sides=True)[name], value, atol=1e-12)
    assert back.to_dataframe().equals(switched.to_dataframe())
    assert back.to_xarray().identical(switched.to_xarray())
    back.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == (tmp_path / "arc.npz").read_bytes()
    once_more = again(part)
    np.testing.assert_array_equal(once_more["y"], part["y"])
    np.testing.assert_array_equal(once_more.at("x", 2.2), part.at("x", 2.2))
    assert (once_more.j[0], once_more.jumps[0].j) == (1, 1)


def test_interpolants_take_one_time_or_many_as_dense_outputs_do():
    found, _ = interpolate(lambda t: np.array([t, t**2]), 0.0, 1.0, np.array([1e-14, 1e-14]))
    assert found(0.5).shape == (2,)
    np.testing.assert_array_equal(found(np.array([0.25, 0.5, 0.75]))[:, 1], found(0.5))
    assert found(np.zeros(0)).shape == (2, 0)


def test_a_part_of_a_run_is_saved_with_its_hybrid_time(again):
    ball = hm.simulate(BouncingBall(), 2.0)
    assert_same(ball.restrict(j=(1, 2)), again(ball.restrict(j=(1, 2))))
    assert_same(ball.restrict(t=(0.2, 0.2)), again(ball.restrict(t=(0.2, 0.2))))


def test_runs_without_states_or_without_jumps_are_saved(again):
    class Still(hm.HybridAutomaton):
        p = hm.Parameter(1.0)

    class Rest(hm.HybridAutomaton):
        x = hm.State([])

        def flow_map(self, s):
            return {"x": s.x}

    for automaton in (Still(), Rest(), BouncingBall(h=100.0)):
        arc = hm.simulate(automaton, 1.0)
        assert_same(arc, again(arc))


def test_what_needs_the_automaton_says_so(again):
    back = again(hm.simulate(BouncingBall(), 1.0))
    with pytest.raises(
        hm.DeclarationError, match=r"BouncingBall comes from a file, which holds a run and not the .* map"
    ):
        hm.simulate(back.automaton, 1.0)
    with pytest.raises(hm.DeclarationError, match="use the automaton that ran"):
        hm.verify(back.automaton, back)
    assert hm.verify(BouncingBall(), back).ok


def test_a_file_has_no_pickle_and_is_the_same_each_time(tmp_path):
    ball = hm.simulate(BouncingBall(), 1.0)
    ball.save(tmp_path / "one.npz")
    ball.save(str(tmp_path / "two.npz"))
    assert (tmp_path / "one.npz").read_bytes() == (tmp_path / "two.npz").read_bytes()
    with np.load(tmp_path / "one.npz", allow_pickle=False) as file:
        assert str(file["schema"]) == "hybrid-fmu hybrid arc"
        assert int(file["version"]) == 2
        assert json.loads(bytes(file["about"]))["variables"][0]["unit"] == "m"


# Files that are no arcs.


@pytest.fixture
def saved(tmp_path):
    hm.simulate(BouncingBall(), 1.0).save(tmp_path / "ball.npz")
    return tmp_path / "ball.npz"


def rewritten(path, **changes):
    with np.load(path) as file:
        content = {name: file[name] for name in file.files}
    content.update(changes)
    np.savez(path, **{name: value for name, value in content.items() if value is not None})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": np.array(3)}, "has version 3 of the schema, and this package reads versions 1 to 2: install"),
        ({"schema": np.array("somebody's arc")}, "holds no hybrid arc: give a file that HybridArc.save has written"),
        ({"schema": None}, "holds no hybrid arc"),
        ({"points": None}, "is damaged: its parts do not fit together .*points"),
        ({"channels": np.zeros((3, 2))}, "is damaged"),
        ({"jump_index": np.array([7])}, "is damaged"),
        ({"about": np.frombuffer(b"{not json", dtype=np.uint8)}, "is damaged"),
        ({"piece_parts": np.array([1])}, "is damaged"),
        ({"part_points": np.array([9999])}, "is damaged"),
        ({"event_tolerance": np.array("soon")}, "is damaged"),
        ({"parameter_times": np.array([0.0, 1.0])}, "is damaged"),
    ],
)
def test_files_that_do_not_fit_are_refused_with_a_sentence(saved, changes, message):
    rewritten(saved, **changes)
    with pytest.raises(hm.DataError, match=message):
        hm.load_arc(saved)


def test_files_of_the_first_version_are_read(saved):
    """They have the parameters as one row, and nothing about which may be tuned."""
    with np.load(saved) as file:
        about = json.loads(bytes(file["about"]))
        row = file["parameters"][0]
    for variable in about["variables"]:
        del variable["tunable"]
    old = np.frombuffer(json.dumps(about).encode(), dtype=np.uint8)
    rewritten(saved, version=np.array(1), parameters=row, parameter_times=None, about=old)
    back = hm.load_arc(saved)
    assert (float(back.at("g", 0.5)), float(back.at("e", 0.9))) == (9.81, 0.7)
    assert not back.variable("e").tunable
    with np.load(saved) as file:
        assert "parameter_times" not in file


def test_other_files_are_refused_with_a_sentence(tmp_path):
    path = tmp_path / "file.npz"
    np.savez(path, x=np.arange(3))
    with pytest.raises(hm.DataError, match="holds no hybrid arc"):
        hm.load_arc(path)
    path.write_text("t,j,h\n0,0,1\n")
    with pytest.raises(hm.DataError, match="is no hybrid arc, or is damaged"):
        hm.load_arc(path)
    path.write_bytes(b"")
    with pytest.raises(hm.DataError, match="is no hybrid arc, or is damaged"):
        hm.load_arc(path)
    np.save(tmp_path / "array.npy", np.arange(3))
    with pytest.raises(hm.DataError, match="is no hybrid arc"):
        hm.load_arc(tmp_path / "array.npy")
    with pytest.raises(FileNotFoundError):
        hm.load_arc(tmp_path / "missing.npz")


def test_a_pickle_in_a_file_is_not_executed(saved):
    rewritten(saved, about=np.array([{"a": 1}], dtype=object))
    with pytest.raises(hm.DataError, match="is no hybrid arc, or is damaged"):
        hm.load_arc(saved)


def test_truncated_files_are_refused_with_a_sentence(saved):
    whole = saved.read_bytes()
    for length in range(0, len(whole), 97):
        saved.write_bytes(whole[:length])
        with pytest.raises(hm.DataError):
            hm.load_arc(saved)


def test_the_name_of_a_file_decides_what_is_written(tmp_path):
    ball = hm.simulate(BouncingBall(), 1.0)
    ball.save(tmp_path / "ball.CSV")
    back = hm.Samples.from_csv(tmp_path / "ball.CSV")
    np.testing.assert_array_equal(back.t, ball.t)
    np.testing.assert_array_equal(back["h"], ball["h"])
    assert hm.verify(BouncingBall(), back).ok
    with pytest.raises(hm.DataError, match=r"ball\.CSV holds samples alone, .*: read it by hm\.Samples\.from_csv"):
        hm.load_arc(tmp_path / "ball.CSV")
    for name, reader in (("ball.mat", r"scipy\.io\.loadmat"), ("ball.nc", r"xarray\.open_dataset")):
        ball.save(tmp_path / name)
        with pytest.raises(hm.DataError, match=rf"{name} holds samples alone, .*: read it by {reader}; arcs are \.npz"):
            hm.load_arc(tmp_path / name)
    for name in ("ball.xlsx", "ball", "ball.json"):
        with pytest.raises(hm.DataError, match=r"an arc is saved as \.npz, which hm\.load_arc reads, or as \.csv"):
            ball.save(tmp_path / name)
        assert not (tmp_path / name).exists()


@settings(deadline=None)
@given(where=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
def test_a_damaged_byte_is_told_or_harmless(tmp_path_factory, where, flip):
    path = tmp_path_factory.getbasetemp() / "damaged.npz"
    ball = hm.simulate(BouncingBall(), 0.5)
    ball.save(path)
    data = bytearray(path.read_bytes())
    data[int(where * len(data))] ^= flip
    path.write_bytes(bytes(data))
    try:
        back = hm.load_arc(path)
    except hm.DataError:
        return
    # Dates and attributes in the zip's directory say nothing of the arc.
    assert_same(ball, back)


def test_a_damaged_array_is_found_by_its_checksum(saved):
    with zipfile.ZipFile(saved) as archive:
        entry = archive.getinfo("channels.npy")
    # A file's header has 30 bytes, its name and at most 20 more; behind it come the compressed numbers.
    offset = entry.header_offset + 30 + len(entry.filename) + 20 + entry.compress_size // 2
    data = bytearray(saved.read_bytes())
    data[offset] ^= 1
    saved.write_bytes(bytes(data))
    with pytest.raises(hm.DataError, match="damaged"):
        hm.load_arc(saved)


# Interpolation.


@settings(deadline=None)
@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=9), st.floats(-10.0, 10.0), st.floats(0.01, 10.0))
def test_polynomials_up_to_the_degree_of_the_points_are_reproduced(coefficients, a, length):
    b = a + length

    def function(t):
        return np.array([np.polynomial.chebyshev.chebval(2.0 * (t - a) / (b - a) - 1.0, coefficients)])

    polynomial = Polynomial(a, b, np.array([function(t) for t in lobatto(a, b, 9)]))
    for t in np.linspace(a, b, 40):
        # The variable itself is rounded by a few ulp of a/length, and T_8' is at most 64.
        assert polynomial(t) == pytest.approx(function(t), abs=64 * 1e-15 * (10.0 + abs(a) / length))


def test_points_of_the_ladder_are_nested_and_end_at_the_ends():
    for few, many in itertools.pairwise(LADDER):
        np.testing.assert_array_equal(lobatto(0.3, 0.7, many)[[0, -1]], [0.3, 0.7])
        np.testing.assert_allclose(lobatto(0.3, 0.7, many)[::2], lobatto(0.3, 0.7, few), atol=1e-16)


def test_smooth_functions_take_few_points_and_noise_does_not_end_in_halving():
    smooth, error = interpolate(lambda t: np.array([np.exp(t)]), 0.0, 1.0, np.array([1e-14]))
    assert len(smooth.parts) == 1
    assert error[0] <= 1e-14
    random = np.random.default_rng(1)
    noisy, error = interpolate(lambda t: random.normal(size=1), 0.0, 1.0, np.array([1e-14]))
    assert len(noisy.parts) <= 4
    assert error[0] > 0.1


@settings(deadline=None)
@given(st.integers(1, 9), st.floats(0.1, 3.0), st.sampled_from([np.sin, np.cos, np.tanh]))
def test_symmetric_functions_are_no_straight_lines(power, rate, shape):
    def function(t):
        return np.array([shape(rate * (t - 0.5)) ** power])

    found, error = interpolate(function, 0.0, 1.0, np.array([1e-12]))
    # Between the points that were checked the error may be a little larger.
    assert error[0] <= 1e-12
    grid = np.linspace(0.0, 1.0, 101)
    assert np.max(np.abs(found(grid)[0] - [function(t)[0] for t in grid])) <= 1e-11


def test_a_function_that_is_not_a_number_somewhere_ends():
    found, error = interpolate(lambda t: np.array([np.nan if t > 0.4 else t, t]), 0.0, 1.0, np.array([1e-14, 1e-14]))
    assert len(found.parts) == 1
    assert np.isnan(error[0])
