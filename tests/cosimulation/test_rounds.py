"""A step of all FMUs, and a reading of all, made by one call in C: the same as one by one in Python."""

import contextlib

import pytest
from strangers import FAILS

from cosim import rounds
from cosim.consensus import fmu_system
from cosim.errors import CosimError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_fixed_step
from cosim.system import System
from fmu.export import export_fmu
from hybrid_model.consensus.laws.closed_loop import scenario_agents
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.models import BouncingBall


@contextlib.contextmanager
def no_compiler(monkeypatch):
    with monkeypatch.context() as without:
        without.setenv("CC", "/there/is/none")
        rounds._library.cache_clear()
        assert rounds._library() is None
        yield
    rounds._library.cache_clear()


def both_ways(monkeypatch, system, *arguments, **options):
    """Return the results, or errors, with and without the library in C."""

    def outcome():
        try:
            return run_fixed_step(system, *arguments, **options)
        except CosimError as error:
            return str(error)

    assert rounds._library() is not None
    in_c = outcome()
    with no_compiler(monkeypatch):
        return in_c, outcome()


@pytest.mark.parametrize("versions", [("3.0",), ("2.0",), ("3.0", "2.0")])
def test_a_network_of_either_version_takes_the_same_values(versions, tmp_path, monkeypatch):
    scenario = load_scenario("paper-a")
    fmus = {
        name: export_fmu(automaton, tmp_path / f"{name}.fmu", fmi=versions[k % len(versions)])
        for k, (name, automaton) in enumerate(scenario_agents(scenario).items())
    }
    system = fmu_system(scenario, fmus)
    slaves = list(system.slaves.values())
    # In an order that is not that of the slaves: values go back to their names.
    record = sorted(system.output_names, key=lambda name: name[::-1])
    in_c, in_python = both_ways(monkeypatch, system, 5.0, 0.01, record=record)
    assert in_c == in_python
    assert in_c.steps == 500 * len(slaves)
    assert sum(in_c.final[f"{slave.name}.events"] for slave in slaves) > 3


def test_an_fmu_that_ends_the_run_ends_it_with_its_message(tmp_path, monkeypatch):
    path = export_fmu(BouncingBall(), tmp_path / "ball.fmu")
    slaves = [FmuSlave(name, path) for name in ("high", "low", "middle")]
    for slave, height in zip(slaves, (3.0, 0.1, 2.0), strict=True):
        slave.set("h", height)
    in_c, in_python = both_ways(monkeypatch, System(slaves, {}), 10.0, 0.01, record=["high.h", "low.h"])
    assert in_c == in_python
    assert in_c.ended.name == "ZENO"
    assert in_c.message.startswith("low: ")
    assert in_c.steps % 3 == 2  # the third was not stepped any more


def test_an_error_says_what_the_fmu_said_in_that_call(stranger, monkeypatch):
    slaves = [FmuSlave(name, stranger(name)) for name in ("well", "fails")]
    slaves[1].set("behaviour", FAILS)
    in_c, in_python = both_ways(monkeypatch, System(slaves, {}), 1.0, 0.1, record=["well.x", "fails.x"])
    assert in_c == in_python
    assert in_c.startswith("fails: fmi3DoStep failed: ")
    assert "no message" not in in_c


def test_slaves_that_are_not_all_fmus_here_are_stepped_one_by_one(tmp_path):
    path = export_fmu(BouncingBall(), tmp_path / "ball.fmu")
    assert rounds.stepping_round([FmuSlave("ball", path), object()]) is None
