"""Which signals depend on each other at once, by the descriptions of FMUs: order of start values, loops in full."""

from zipfile import ZipFile

import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.errors import CosimError
from cosim.feedthrough import in_order
from cosim.fmu_slave import FmuSlave
from cosim.isolation.isolated_slave import IsolatedSlave
from cosim.masters import run_error_controlled, run_fixed_step
from cosim.masters.start import transfer_start
from cosim.system import System


class Doubles(hm.HybridAutomaton):
    u = hm.Input(0.0)
    y = hm.Output()
    apart = hm.State(3.0, output=True)

    def outputs(self, s):
        return {"y": 2.0 * s.u}

    def flow_map(self, s):
        return {"apart": s.u}


@pytest.fixture(params=["2.0", "3.0"])
def path(request, exported):
    return exported(Doubles(), "doubles", request.param)


def slaves(path, count, kind=FmuSlave):
    return [kind(f"d{k}", path) for k in range(count)]


def test_start_values_go_along_a_chain_once(path, monkeypatch):
    transfers = []
    monkeypatch.setattr(
        "cosim.masters.start.transfer_start", lambda *given: transfers.append(str(given[1])) or transfer_start(*given)
    )
    wires = {f"d{k}.u": f"d{k - 1}.y" for k in reversed(range(1, 5))}
    chain = slaves(path, 5)
    chain[0].set("u", 1.0)
    system = System(chain, wires)
    assert run_error_controlled(system, 0.1).final["d4.y"] == 32.0
    once = [f"d{k - 1}.y -> d{k}.u" for k in range(1, 5)]
    assert list(map(str, in_order(system))) == once
    assert transfers == once * 2  # the second time to see that nothing changes


@pytest.mark.parametrize("kind", [FmuSlave, IsolatedSlave])
def test_a_loop_at_rest_is_refused_in_full(kind, path):
    """0 = 2 * 0, and so is nothing else: yet it is an equation that no master of explicit steps solves."""
    wires = {"d1.u": "d0.y", "d2.u": "d1.y", "d0.u": "d2.y"}
    system = System(slaves(path, 3, kind), wires)
    with pytest.raises(
        CosimError, match=r"d\d.y -> d\d.u, d\d.y -> d\d.u and d\d.y -> d\d.u depend on each other at once"
    ):
        run_error_controlled(system, 1.0)
    for slave in system.slaves.values():
        slave.close()


def test_what_an_output_does_not_depend_on_makes_no_loop(path):
    """x' = y and y' = x from 3 and 3: both are 3 exp(t)."""
    result = run_error_controlled(System(slaves(path, 2), {"d1.u": "d0.apart", "d0.u": "d1.apart"}), 0.5)
    assert result.final["d0.apart"] == pytest.approx(3.0 * 1.6487212707001282, rel=1e-6)


class Passes(hm.HybridAutomaton):
    u = hm.Input(0.0)
    y = hm.Output()

    def outputs(self, s):
        return {"y": s.u}


@pytest.mark.parametrize(("automaton", "step"), [(Passes, None), (Doubles, 0.1)])
def test_steps_of_a_solver_count_where_there_is_something_to_integrate(automaton, step, exported, tmp_path):
    """A description that gives the length of internal steps, as those of the Reference FMUs do, states or none."""
    path = tmp_path / "stepping.fmu"
    with ZipFile(exported(automaton(), automaton.__name__.lower())) as plain, ZipFile(path, "w") as written:
        for name in plain.namelist():
            content = plain.read(name)
            if name == "modelDescription.xml":
                assert content.count(b"<CoSimulation ") == 1
                content = content.replace(b"<CoSimulation ", b'<CoSimulation fixedInternalStepSize="0.1" ')
            written.writestr(name, content)
    first, second = slaves(path, 2)
    assert (first.internal_step, first.default_step) == (step, 0.1)
    wave = AutomatonSlave("wave", Wave())
    result = run_fixed_step(System([wave, first, second], {"d0.u": "wave.y", "d1.u": "d0.y"}), 1.0, 0.5)
    assert ("--master error-controlled looks between them" in result.treatment["d0"]) == (step is not None)


class Wave(hm.HybridAutomaton):
    y = hm.Output()

    def outputs(self, s):
        return {"y": s.t}
