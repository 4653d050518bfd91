"""The boost converter against matrix exponentials: events, states, and the textbook's voltages in steady state."""

from itertools import pairwise

import numpy as np
import pytest
from oracles.affine_modes import AffineMode
from scipy.optimize import brentq

import hybrid_model as hm
from hybrid_model.models import BoostConverter

E, L, C, D, T = 24.0, 500e-6, 100e-6, 0.5, 50e-6
# Events are located to a few ulp of t, below 1e-18 s; the current's error of 1e-12 A over slopes of 1e4 A/s is more.
TIME = 1e-14
# Some forty flows, each to the solver's relative 1e-13, of voltages below 100 V.
STATE = 1e-9


def modes(load):
    """Switch closed, diode conducting, diode blocked; the states are current and voltage."""
    decay = -1.0 / (load * C)
    return (
        AffineMode([[0.0, 0.0], [0.0, decay]], [E / L, 0.0]),
        AffineMode([[0.0, -1.0 / L], [1.0 / C, decay]], [E / L, 0.0]),
        AffineMode([[0.0, 0.0], [0.0, decay]]),
    )


def one_period(load, x):
    """Events of one period from `x` at its begin: [(time since, name, state)], and the state at its end."""
    closed, conducting, blocked = modes(load)
    x = closed.at(x, D * T)
    events = [(D * T, "open", x)]
    dry = conducting.first_rise(x, lambda state: -state[0], (1 - D) * T)
    if dry is None:
        return events, conducting.at(x, (1 - D) * T)
    x = conducting.at(x, dry) * [0.0, 1.0]
    return [*events, (D * T + dry, "block", x)], blocked.at(x, (1 - D) * T - dry)


def periods(load, x, count):
    found = []
    for k in range(count):
        events, end = one_period(load, x)
        found += [(k * T, "close", np.asarray(x)), *((k * T + since, name, state) for since, name, state in events)]
        x = end
    return found, x


def run(load, x, t_end):
    return hm.simulate(BoostConverter(load=load, current=x[0], voltage=x[1]), t_end)


@pytest.mark.parametrize(
    ("load", "x", "names"),
    [(20.0, (4.0, 47.0), {"close", "open"}), (500.0, (0.0, 72.0), {"close", "open", "block"})],
)
def test_events_and_states_against_matrix_exponentials(load, x, names):
    expected, end = periods(load, x, 20)
    arc = run(load, x, 20 * T - 1e-9)
    assert {jump.name for jump in arc.jumps} == names
    assert [jump.name for jump in arc.jumps] == [name for _, name, _ in expected]
    assert [jump.t for jump in arc.jumps] == pytest.approx([t for t, _, _ in expected], abs=TIME)
    assert np.array([jump.x_after for jump in arc.jumps]) == pytest.approx(
        np.array([state for _, _, state in expected]), abs=STATE
    )
    # The run ends 1 ns before the period does, in which neither state moves by more than 5e4 per s.
    assert [arc.end.current, arc.end.voltage] == pytest.approx(end, abs=5e-5)


def mean(arc, name, cuts):
    """Mean over a time by Gauss-Legendre quadrature between events, exact to rounding for these exponentials."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    total = 0.0
    for a, b in pairwise(cuts):
        total += (b - a) / 2 * weights @ arc.at(name, (a + b) / 2 + (b - a) / 2 * nodes)
    return total / (cuts[-1] - cuts[0])


def steady_state(load, period):
    """State at the begin of a period in continuous conduction: the map over one period is affine, its fixed point."""
    closed, conducting, _ = modes(load)
    image = np.array(
        [conducting.at(closed.at(x, D * period), (1 - D) * period) for x in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]]
    )
    return np.linalg.solve(np.eye(2) - (image[1:] - image[0]).T, image[0])


def test_continuous_conduction_has_the_textbook_voltage_in_steady_state():
    load, voltage, errors = 20.0, E / (1 - D), []
    for period in (T, T / 2):
        start, ripple = steady_state(load, period), D * period / (load * C)
        arc = hm.simulate(BoostConverter(load=load, period=period, current=start[0], voltage=start[1]), 5 * period)
        assert [arc.end.current, arc.end.voltage] == pytest.approx(start, abs=STATE)
        assert not len(arc.event_times("block"))
        cuts = np.array([4.0, 4.5, 5.0]) * period
        errors.append(mean(arc, "voltage", cuts) / voltage - 1)
        assert abs(errors[-1]) < ripple
        # Peak to peak, the ripple is the load's current times the closed time over the capacitance, to first order.
        swing = np.ptp(arc.at("voltage", np.linspace(4 * period, 5 * period, 401)))
        assert swing == pytest.approx(ripple * voltage, rel=2 * ripple)
        assert mean(arc, "current", cuts) == pytest.approx(voltage / load / (1 - D), rel=ripple)
    # The textbook averages over a period; what it leaves out is of second order in the period.
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)


def test_discontinuous_conduction_has_the_textbook_voltage_in_steady_state():
    load = 500.0
    voltage = brentq(lambda v: one_period(load, (0.0, v))[1][1] - v, 50.0, 100.0, xtol=1e-12)
    arc = run(load, (0.0, voltage), 5 * T)
    assert arc.end.voltage == pytest.approx(voltage, abs=STATE)
    assert len(arc.event_times("block")) == 5
    dry = arc.event_times("block")[-1]
    ratio = (1 + np.sqrt(1 + 4 * D**2 / (2 * L / (load * T)))) / 2
    # Up to the relative ripple of the voltage, at most T/(load C) = 0.1 %.
    assert mean(arc, "voltage", [4 * T, 4.5 * T, dry, 5 * T]) == pytest.approx(E * ratio, rel=T / (load * C))
    assert np.all(arc.at("current", np.linspace(dry, 5 * T, 20)[1:-1]) == 0.0)


def test_a_blocked_diode_conducts_again_when_the_output_has_fallen_to_the_source():
    load, start = 20.0, 24.05
    arc = hm.simulate(BoostConverter(load=load, voltage=start, mode=2, k=1), 0.9 * T)
    exact = load * C * np.log(start / (E - 1e-6))
    assert [jump.name for jump in arc.jumps] == ["conduct"]
    # A voltage error of 1e-12 V over the slope of 12 V/ms.
    assert arc.jumps[0].t == pytest.approx(exact, abs=1e-15 + 1e-16)
    assert arc.end.current > 0.0


def test_the_current_never_flows_back():
    arc = run(500.0, (0.0, 72.0), 40 * T)
    # Rounding and interpolation of the current near 1 A, at a few 1e-11 A.
    assert arc["current"].min() >= -1e-10
