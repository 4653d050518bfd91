import functools
import gc
import hashlib
import os
import re
import time

import pytest
from fmi_driver.binary import Binary
from fmi_driver.journey import SETTINGS, instance
from hypothesis import HealthCheck, settings

from fmu.export import export_fmu
from hybrid_model.native.build.cache_folder import cache_root, zig_folder

# Nothing that depends on the speed of the machine may decide about a verdict: no deadline, no check for slowness.
TIMELESS = {"database": None, "deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("same", derandomize=True, **TIMELESS)
settings.register_profile("fresh", derandomize=False, print_blob=True, **TIMELESS)
# `make test` draws the same cases each time; `make test-long` asks for the other profile, with a seed.
settings.load_profile("same")

# Modules and collected tests stay to the end: looking through them for garbage took a third of the time of collecting.
gc.disable()


def pytest_collection_finish():
    gc.freeze()
    gc.enable()


def fingerprint(automaton):
    """Tells models apart that go by one key, such as two classes of one name in two files."""
    kind = type(automaton)
    jumps = [jump.name for jump in automaton.jumps]
    told = f"{kind.__module__}.{kind.__qualname__} {automaton.priority} {jumps} {automaton.variables!r}"
    return hashlib.sha256(told.encode()).hexdigest()[:16]


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory):
    """The folder for temporary files that all processes of this run of the tests share."""
    root = tmp_path_factory.getbasetemp()
    return root.parent if "PYTEST_XDIST_WORKER" in os.environ else root


@pytest.fixture(scope="session", autouse=True)
def cache(run_folder):
    """What is compiled is kept for this run; the user's cache is left alone, apart from zig's, which takes minutes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ZIG_GLOBAL_CACHE_DIR", str(zig_folder()))
        patch.setenv("HYBRID_FMU_CACHE", str(run_folder / "cache"))
        yield


@pytest.fixture(scope="session")
def forget_models():
    """Delete what is kept of exported models, so that they are built again; objects of the engine stay."""

    def forget():
        for pattern in ("*-model", "*-library"):
            for file in (cache_root() / "built").glob(f"?/{pattern}"):
                file.unlink(missing_ok=True)

    return forget


def once(path, make):
    """Make a file once for all processes of a run: whoever makes the claim makes it, the others wait for it."""
    claim = path.with_name(f"{path.name}.claim")
    while not path.exists():
        try:
            claim.mkdir()
        except FileExistsError:
            time.sleep(0.05)
            continue
        try:
            make()
        finally:
            claim.rmdir()
    return path


@pytest.fixture(scope="session")
def exported(tmp_path_factory, run_folder):
    """Export an automaton once a session, key and version, whatever the number of test processes."""
    own = tmp_path_factory.mktemp("exports")

    def export(automaton, key=None, fmi="3.0", clocks=True):
        key = (key or automaton.name) + ("" if fmi == "3.0" else f"-fmi{fmi}") + ("" if clocks else "-no-clocks")
        folder = run_folder / "fmus" / fingerprint(automaton)
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{key}.fmu"

        def make():
            os.replace(export_fmu(automaton, own / f"{key}.fmu", fmi=fmi, clocks=clocks), path)

        # The first export of a version compiles what all of them share.
        shared = run_folder / f"objects-{fmi}"
        once(shared, lambda: (once(path, make), shared.touch()))
        return once(path, make)

    return export


@pytest.fixture(scope="session")
def binary(exported):
    """Load the FMU of a class of automata in a version, once a session."""

    @functools.cache
    def load(automaton, fmi="3.0"):
        key = re.sub(r"(?<!^)(?=[A-Z])", "_", automaton.__name__).lower()
        return Binary(exported(automaton(), key, fmi))

    return load


@pytest.fixture
def make(binary):
    """Make an instance of a class of automata in a setting; it is freed at the end of the test."""
    made = []

    def make(automaton, label, **options):
        made.append(instance(binary(automaton, SETTINGS[label]["fmi"]), label, **options))
        return made[-1]

    yield make
    for component in made:
        if component.handle is not None:
            component.free()
