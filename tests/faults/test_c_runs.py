"""The C harness runs each witness as Python does, in both versions and kinds, under the sanitizers."""

import pytest
from c_harness import VERSIONS
from c_runs import agree, co_simulation, model_exchange, python_run
from c_witnesses import POLYNOMIAL, WITNESSES

pytestmark = pytest.mark.faults


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", WITNESSES)
def test_co_simulation(name, fmi, started):
    witness = WITNESSES[name]
    arc = python_run(witness)
    harness = started(witness.automaton, fmi, "addresses")
    agree(witness, arc, co_simulation(harness, witness, events=fmi == "3.0"))
    agree(witness, arc, co_simulation(harness, witness, events=False, early=False, stop=False))
    if fmi == "2.0":
        agree(witness, arc, co_simulation(harness, witness, events=False, stop_at_events=True))
    else:
        agree(witness, arc, co_simulation(harness, witness, early=False))
        agree(witness, arc, co_simulation(harness, witness, update=1))
        agree(witness, arc, co_simulation(harness, witness, events=False, update=2))


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", POLYNOMIAL)
def test_model_exchange(name, fmi, started):
    witness = WITNESSES[name]
    if witness.changes:
        witness = type(witness)(witness.automaton, witness.t_end, witness.n)
    harness = started(witness.automaton, fmi, "addresses")
    agree(witness, python_run(witness), model_exchange(harness, witness))
