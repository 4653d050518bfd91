"""Tests that draw their cases: the same ones each time, unless fresh ones are asked for."""

from hypothesis import given, settings
from hypothesis import strategies as st

drawn = []


def is_fresh(config):
    return config.getoption("--hypothesis-profile") == "fresh"


def test_the_profile_is_the_one_that_was_asked_for(pytestconfig):
    assert settings.default.derandomize is not is_fresh(pytestconfig)
    # A slow machine changes no verdict.
    assert settings.default.deadline is None


@settings(max_examples=5)
@given(st.integers(0, 10**9))
def keep(number):
    drawn.append(number)


def test_a_second_run_draws_the_same(pytestconfig):
    if is_fresh(pytestconfig) and pytestconfig.getoption("--hypothesis-seed") is None:
        return
    keep()
    first = list(drawn)
    drawn.clear()
    keep()
    assert drawn == first
