"""One parametrised fixture for the tests of `hm.simulate`: each runs on the native engine and on the Python one."""

import functools

import pytest

import hybrid_model as hm


@pytest.fixture(scope="module", params=["auto", "python"], autouse=True)
def engine(request):
    """Which engine `hm.simulate` takes in a module's tests, unless a test asks for one by itself."""
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "python":
            patch.setattr(hm, "simulate", functools.partial(hm.simulate, engine="python"))
        yield request.param
