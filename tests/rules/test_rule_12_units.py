"""Rule 12: a run whose time or whose states are written in another unit is the same run, scaled."""

import fmpy
import numpy as np
import pytest
from catalogue import cases
from hypothesis import given, settings
from hypothesis import strategies as st
from rescaled import Charge, InOtherTime, Ring, Sawtooth, Twins

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.system import System

FREQUENCIES = [1e-12, 1e-6, 1.0, 1e6, 1e7, 1e8, 1e9, 1e12]
CASES = {name: case for name, case in cases().items() if not case.steps}
QUICK = {
    "analog_digital_loop",
    "bouncing_ball",
    "bouncing_ball_with_dwell",
    "newtons_cradle",
    "relay_hysteresis",
    "resting_ball",
    "sampled_lti_loop",
    "thermostat",
    "two_tank",
}


def both_units(name, unit):
    case = CASES[name]
    plain = hm.simulate(case.automaton, case.t_end)
    return plain, hm.simulate(InOtherTime(case.automaton, unit), case.t_end * unit)


@pytest.mark.parametrize("unit", [2.0**-40, 2.0**40])
@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.long) for name in CASES]
)
def test_a_unit_of_time_that_is_a_power_of_two_changes_no_bit_of_a_run(name, unit):
    """Scaling by a power of two rounds nothing, so every difference would come from a number that is in seconds."""
    plain, other = both_units(name, unit)
    assert (plain.stop, plain.t.size) == (other.stop, other.t.size)
    assert [(jump.name, jump.t * unit) for jump in plain.jumps] == [(jump.name, jump.t) for jump in other.jumps]
    assert np.array_equal(plain.t * unit, other.t)
    for before, after in zip(plain.jumps, other.jumps, strict=True):
        assert np.array_equal(before.x_before, after.x_before)
        assert np.array_equal(before.x_after, after.x_after)
        assert np.array_equal(before.z_after, after.z_after)


@settings(max_examples=12)
@given(st.floats(-12.0, 12.0), st.sampled_from(sorted(QUICK)))
def test_any_unit_of_time_leaves_the_run_as_it_is(exponent, name):
    plain, other = both_units(name, 10.0**exponent)
    assert plain.stop is other.stop
    assert [jump.name for jump in plain.jumps] == [jump.name for jump in other.jumps]
    times = np.array([jump.t for jump in plain.jumps])
    # Rounding of the unit is amplified by what follows a jump, never above 1e-9 of the run in these models.
    assert [jump.t / 10.0**exponent for jump in other.jumps] == pytest.approx(times, abs=1e-9 * CASES[name].t_end)


@pytest.mark.parametrize("f", FREQUENCIES)
def test_a_sawtooth_of_any_frequency_has_its_events(f):
    arc = hm.simulate(Sawtooth(f=f), 10.5 / f)
    assert (arc.stop, arc.end.n) == (hm.Stop.HORIZON, 10)
    assert arc.event_times("jump") * f == pytest.approx(np.arange(1.0, 11.0), rel=1e-13)
    assert arc.end.x == pytest.approx(0.5, abs=1e-12)


def test_a_run_that_ends_half_a_period_before_an_event_has_none():
    arc = hm.simulate(Sawtooth(f=1e9), 0.5e-9)
    assert (arc.end.n, arc.end.x) == (0, pytest.approx(0.5, abs=1e-15))


def test_regular_jumps_are_no_accumulation_however_close():
    arc = hm.simulate(Sawtooth(f=1e8), 2.005e-6)
    assert (arc.stop, arc.end.n) == (hm.Stop.HORIZON, 200)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("f", FREQUENCIES)
def test_a_sawtooth_as_an_fmu_has_its_events_in_each_step(fmi, f, exported):
    path = str(exported(Sawtooth(), "sawtooth", fmi=fmi))
    step = 1.05 / f
    found = fmpy.simulate_fmu(path, stop_time=10 * step, step_size=step, output_interval=step, start_values={"f": f})
    assert found["n"].tolist() == list(range(11))
    assert found["x"] == pytest.approx(0.05 * np.arange(11), abs=1e-12)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_sawtooth_for_model_exchange_jumps_at_any_frequency(fmi, exported):
    path = str(exported(Sawtooth(), "sawtooth", fmi=fmi))
    for f in (1e-9, 1.0, 1e9):
        found = fmpy.simulate_fmu(
            path,
            fmi_type="ModelExchange",
            solver="Euler",
            stop_time=3.5 / f,
            step_size=0.01 / f,
            output_interval=0.5 / f,
            start_values={"f": f},
        )
        # Euler's steps of a hundredth locate events to a hundredth; three times that for three events.
        assert found["n"][-1] == 3
        assert found["x"][-1] == pytest.approx(0.5, abs=0.03)


RUNS = pytest.mark.parametrize("kind", ["python", "slave", "fmu"])


def ring_run(kind, w, exported, **values):
    t_end = 20.0 / w
    if kind == "python":
        arc = hm.simulate(Ring(w=w, **values), t_end)
        return arc.event_times("jump"), arc.end.x
    slave = AutomatonSlave("ring", Ring(w=w)) if kind == "slave" else FmuSlave("ring", exported(Ring(), "ring"))
    for name, value in {"w": w, **values}.items():
        slave.set(name, value)
    system = System([slave], {})
    final = run_event_exact(system, t_end).final
    return np.full(int(final["ring.n"]), np.nan), final["ring.x"]


@RUNS
@pytest.mark.parametrize("w", [1e-9, 1.0, 1e9, 1e12])
def test_a_ring_of_any_frequency_changes_its_sign_six_times_in_twenty_radians(kind, w, exported):
    times, x = ring_run(kind, w, exported)
    assert len(times) == 6
    assert x == pytest.approx(np.cos(20.0), abs=1e-10)
    if kind == "python":
        assert times * w == pytest.approx(np.pi * (np.arange(6) + 0.5), abs=1e-10)


@RUNS
@pytest.mark.parametrize("size", [1e-20, 1e-10, 1e10])
def test_a_ring_of_any_size_is_as_accurate_as_one_of_size_one(kind, size, exported):
    times, x = ring_run(kind, 1.0, exported, size=size)
    assert len(times) == 6
    assert x / size == pytest.approx(np.cos(20.0), abs=1e-10)


@pytest.mark.parametrize("unit", [1e-20, 1e-10, 1.0, 1e10])
@pytest.mark.parametrize("current", [1e-6, 1.0, 1e6])
def test_a_charge_is_blocked_where_its_flow_set_ends(unit, current):
    arc = hm.simulate(Charge(current=current * unit, most=unit), 20.0 / current)
    assert arc.stop is hm.Stop.BLOCKED
    assert arc.t[-1] * current == pytest.approx(1.0, rel=1e-12)
    assert arc.end.q == pytest.approx(unit, rel=1e-12)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("most", [1e-20, 1e-10, 1e10])
def test_a_charge_as_an_fmu_is_blocked_where_its_flow_set_ends(fmi, most, exported):
    slave = FmuSlave("charge", exported(Charge(), "charge", fmi=fmi))
    slave.set("current", most)
    slave.set("most", most)
    slave.start(0.0, 20.0, events=False)
    slave.begin()
    made = slave.step(0.0, 20.0)
    slave.close()
    assert made.terminated is not None
    assert "Blocked" in made.terminated.message
    assert made.reached == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("f", [1e-12, 1e-3, 1.0, 1e3, 1e12])
@pytest.mark.parametrize("size", [1e-12, 1.0, 1e12])
def test_twins_fire_at_one_instant_in_any_unit(f, size):
    arc = hm.simulate(Twins(f=f, size=size), 10.0 / f)
    assert [jump.name for jump in arc.jumps] == ["risen", "fallen"]
    assert arc.jumps[0].t == arc.jumps[1].t == pytest.approx(7.0 / f, rel=1e-13)


def test_a_declared_tolerance_is_in_seconds():
    arc = hm.simulate(Sawtooth(f=1e12), 10.5e-12, solver=hm.Solver(event_tolerance=1e-21))
    assert arc.event_tolerance == 1e-21
    assert arc.event_times("jump") * 1e12 == pytest.approx(np.arange(1.0, 11.0), rel=1e-12)


def test_events_a_microsecond_apart_after_a_quiet_hour_stay_apart():
    """What one instant is follows from the gap between jumps too, not from the time so far alone."""

    class Late(Sawtooth):
        start = hm.Parameter(3600.0)

        def flow_map(self, s):
            return {"x": np.where(s.n == 0, 1.0 / s.start, s.f)}

    arc = hm.simulate(Late(f=1e6), 3600.0 + 10.5e-6)
    gaps = np.diff(arc.event_times("jump"))
    assert len(gaps) == 10
    # 16 ulp of 3600 s.
    assert gaps == pytest.approx(np.full(10, 1e-6), abs=16 * np.spacing(3600.0))


@pytest.mark.parametrize("f", [1e-9, 1.0, 1e9])
def test_a_run_is_verified_at_any_frequency_and_what_is_wrong_is_seen(f):
    arc = hm.simulate(Sawtooth(f=f), 10.5 / f)
    assert hm.verify(Sawtooth(f=f), arc).ok
    # The flow map of a frequency that is off by a millionth, and a jump a thousandth of a period too early.
    assert not hm.verify(Sawtooth(f=f * (1.0 + 1e-6)), arc).ok
    early = hm.Samples(
        [0.0, 0.999 / f, 0.999 / f, 1.5 / f], [0, 0, 1, 1], {"x": [0.0, 0.999, -0.001, 0.5], "n": [0, 0, 1, 1]}
    )
    assert any("none was due" in str(violation) for violation in hm.verify(Sawtooth(f=f), early).violations)


@pytest.mark.parametrize("size", [1e-20, 1.0, 1e20])
def test_a_run_of_any_size_is_verified_and_what_is_wrong_is_seen(size):
    arc = hm.simulate(Ring(size=size), 7.0)
    assert hm.verify(Ring(size=size), arc).ok
    samples = arc.samples()
    samples.values["x"][5] += 1e-5 * size
    assert not hm.verify(Ring(size=size), samples).ok


class Waking(hm.HybridAutomaton):
    """At rest at zero until something comes from outside after 1 s: x' = max(t - 1, 0)^2 / unit^2 - x / unit."""

    x = hm.State(0.0, output=True)
    unit = hm.Parameter(1.0)

    def flow_map(self, s):
        t = s.t / s.unit
        return {"x": (np.maximum(t - 1.0, 0.0) ** 2 - s.x) / s.unit}


WOKEN = 4.0 - 2.0 * 2.0 + 2.0 - 2.0 * np.exp(-2.0)
"""x(3 s): of x' = r^2 - x with r = t - 1 from x = 0 at r = 0, r^2 - 2 r + 2 - 2 exp(-r) at r = 2."""


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("x", [0.0, 1e-300, 1e-20])
@pytest.mark.parametrize("method", ["DOP853", "RK45"])
def test_a_system_at_rest_at_zero_wakes(unit, x, method):
    arc = hm.simulate(Waking(x=x, unit=unit), 3.0 * unit, solver=hm.Solver(method=method))
    assert arc.end.x == pytest.approx(WOKEN, abs=1e-11)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_fmu_at_rest_at_zero_wakes(fmi, exported):
    path = str(exported(Waking(), "waking", fmi=fmi))
    for step in (3.0, 0.1):
        found = fmpy.simulate_fmu(path, stop_time=3.0, step_size=step, output_interval=step)
        assert found["x"][-1] == pytest.approx(WOKEN, abs=1e-11)


class Powers(hm.HybridAutomaton):
    """x' = t^k from zero: nothing to measure it by at first."""

    x = hm.State(0.0)
    k = hm.Parameter(7.0)

    def flow_map(self, s):
        return {"x": s.t**s.k}


@pytest.mark.parametrize("k", [1.0, 5.0, 7.0])
def test_a_state_that_grows_out_of_zero_is_followed(k):
    assert hm.simulate(Powers(k=k), 2.0).end.x == pytest.approx(2.0 ** (k + 1.0) / (k + 1.0), rel=1e-12)


class Beside(hm.HybridAutomaton):
    """A ring of small size beside a large state that has nothing to do with it; it counts half turns."""

    large = hm.State(1e5)
    x = hm.State(1e-9, output=True)
    v = hm.State(0.0)
    n = hm.DiscreteState(0, integer=True, output=True)
    side = hm.DiscreteState(1.0)

    def flow_map(self, s):
        return {"large": 0.0 * s.large, "x": 10.0 * s.v, "v": -10.0 * s.x}

    def jump_set(self, s):
        return hm.least(-s.x * s.side, -s.v * s.side)

    def jump_map(self, s):
        return {"n": s.n + 1, "side": -s.side}


@RUNS
@pytest.mark.parametrize(("size", "accuracy"), [(1e-6, 1e-8), (1e-9, 1e-4)])
def test_a_large_state_does_not_cost_a_small_one_its_digits(kind, size, accuracy, exported):
    if kind == "python":
        arc = hm.simulate(Beside(x=size), 10.0)
        n, x = arc.end.n, arc.end.x
    else:
        slave = AutomatonSlave("b", Beside(x=size)) if kind == "slave" else FmuSlave("b", exported(Beside(), "beside"))
        slave.set("x", size)
        final = run_event_exact(System([slave], {}), 10.0).final
        n, x = final["b.n"], final["b.x"]
    assert n == 32
    assert x / size == pytest.approx(np.cos(100.0), abs=accuracy)


class Bent(hm.HybridAutomaton):
    """Its guard is the smaller of one that is crossed at the end of the run, and of one that never is."""

    fast = hm.State(0.0)
    slow = hm.State(5e-11)
    n = hm.DiscreteState(0, integer=True, output=True)
    rate = hm.Parameter(1e5)

    def flow_map(self, s):
        return {"fast": s.rate, "slow": 0.0 * s.slow}

    def jump_set(self, s):
        return hm.least(s.fast - s.rate, s.slow - 1e-10)

    def jump_map(self, s):
        return {"n": s.n + 1, "fast": 0.0}


@pytest.mark.parametrize("rate", [1e5, 123.456, 7.0])
def test_a_guard_that_bends_at_the_end_of_a_run_is_not_taken_for_one_that_rises(rate, exported):
    for t_end in (0.5, 1.0, 1.5):
        assert hm.simulate(Bent(rate=rate), t_end).end.n == 0
    path = str(exported(Bent(), "bent"))
    found = fmpy.simulate_fmu(path, stop_time=2.0, step_size=1.0, output_interval=1.0, start_values={"rate": rate})
    assert found["n"].tolist() == [0, 0, 0]


@pytest.mark.parametrize("start", [1e3, 1e5])
def test_where_a_flow_set_ends_does_not_depend_on_how_large_a_state_once_was(start):
    class Pump(hm.HybridAutomaton):
        """Empties down to 1e-4, where nothing lets it go on."""

        p = hm.State(start)

        def flow_map(self, s):
            return {"p": -s.p}

        def flow_set(self, s):
            return s.p - 1e-4

    arc = hm.simulate(Pump(), 40.0)
    assert arc.stop is hm.Stop.BLOCKED
    assert arc.t[-1] == pytest.approx(np.log(start / 1e-4), abs=1e-6)
