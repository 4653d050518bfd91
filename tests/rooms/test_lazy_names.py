"""Names that packages import when they are asked for: all there, and what is heavy is not imported without need."""

import importlib
import subprocess
import sys

import pytest

PACKAGES = ["hybrid_model", "hybrid_model.consensus"]
HEAVY = ("scipy", "matplotlib", "networkx", "control", "casadi", "fmpy", "lxml")


def imported(program):
    """The packages of `HEAVY` that a program has imported in the end."""
    program += f"\nimport sys\nprint(*[name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize("name", PACKAGES)
def test_each_public_name_is_there(name):
    package = importlib.import_module(name)
    assert all(getattr(package, public) is not None for public in package.__all__)


@pytest.mark.parametrize("name", PACKAGES)
def test_other_names_are_missed_as_elsewhere(name):
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nonsense'"):
        _ = importlib.import_module(name).nonsense
    with pytest.raises(ImportError, match=f"cannot import name 'nonsense' from '{name}'"):
        exec(f"from {name} import nonsense")


def test_a_name_that_is_also_a_module_is_the_function():
    """Whoever imports the module `hybrid_model.simulate` first."""
    program = "import hybrid_model.simulate\nimport hybrid_model as hm\nassert callable(hm.simulate)"
    assert imported(program) == set()


@pytest.mark.parametrize(
    ("program", "needed"),
    [
        ("import hybrid_model", set()),
        ("import hybrid_model.consensus", set()),
        ("import hybrid_model.models", set()),
        ("import cosim.cli.main", set()),
        ("from hybrid_model.native.networks.network import trace_any", {"casadi"}),
        ("import fmu.export", {"casadi", "scipy"}),
        ("import cosim.cli.main, cosim.cli.export", {"casadi", "scipy"}),
    ],
)
def test_only_what_is_needed_is_imported(program, needed):
    assert imported(program) == needed
