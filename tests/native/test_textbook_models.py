"""Nine models as a user writes them, in neither engine's library: both engines against each other and exact runs."""

import numpy as np
import pytest
from oracles import exact_textbook
from textbook_models import TEXTBOOK

import hybrid_model as hm
from hybrid_model.declare.variables import Kind


@pytest.fixture(scope="module", params=list(TEXTBOOK))
def runs(request):
    made, t_end = TEXTBOOK[request.param]
    automaton = made()
    native, python = (hm.simulate(automaton, t_end, engine=engine) for engine in ("native", "python"))
    return request.param, t_end, native, python


def test_both_engines_run_alike(runs):
    _, t_end, native, python = runs
    assert native.stop is python.stop is hm.Stop.HORIZON
    assert [jump.name for jump in native.jumps] == [jump.name for jump in python.jumps]
    # Two solvers at a relative tolerance of 1e-13; none of the nine is chaotic: errors fade, or grow with the jumps.
    one, other = ([jump.t for jump in arc.jumps] for arc in (native, python))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)
    times = np.linspace(0.0, t_end, 201)
    between = times[np.abs(times[:, None] - np.array(other)).min(axis=1) > 1e-6]
    for variable in native.automaton.of_kind(Kind.STATE, Kind.DISCRETE):
        expected = python.at(variable.name, between)
        close = 1e-10 * max(1e-3, np.abs(expected).max())
        np.testing.assert_allclose(native.at(variable.name, between), expected, rtol=0, atol=close)


def test_the_run_is_the_exact_one(runs):
    name, t_end, native, _ = runs
    events, x_end = getattr(exact_textbook, name)(t_end)
    assert len(events) >= 5
    assert [jump.name for jump in native.jumps] == [name for name, _ in events]
    # Two solvers at a relative tolerance of 1e-13 would be 1e-12 apart; margins are crossed at slopes of 0.01 or more.
    np.testing.assert_allclose([jump.t for jump in native.jumps], [t for _, t in events], rtol=0, atol=1e-10)
    states = np.concatenate([np.atleast_1d(native.end[v.name]) for v in native.automaton.of_kind(Kind.STATE)])
    np.testing.assert_allclose(states, x_end, rtol=0, atol=1e-10 * max(1.0, np.abs(x_end).max()))
