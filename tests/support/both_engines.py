"""One parametrised fixture for the tests of `hm.simulate`: each runs on the native engine and on the Python one."""

import functools
import inspect

import pytest

import hybrid_model as hm


def on_both_engines(metafunc):
    """What `pytest_generate_tests` of a room does: the tests of modules that run something do so twice.

    Tests that ask for an engine themselves run once.
    """
    runs = "simulate(" in inspect.getsource(metafunc.module) and "engine=" not in inspect.getsource(metafunc.function)
    if runs and "engine" not in metafunc.fixturenames:
        metafunc.fixturenames.append("engine")
        metafunc.parametrize("engine", ["auto", "python"], indirect=True, scope="module")


@pytest.fixture(scope="module")
def engine(request):
    """Which engine `hm.simulate` takes, unless a test asks for one by itself."""
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "python":
            patch.setattr(hm, "simulate", functools.partial(hm.simulate, engine="python"))
        yield request.param
