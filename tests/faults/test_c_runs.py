"""The C harness runs each witness as Python does, in both versions and kinds, under the sanitizers."""

import pytest
from c_harness import VERSIONS
from c_runs import agree, agree_in_all_ways, model_exchange, python_run
from c_witnesses import POLYNOMIAL, WITNESSES

pytestmark = pytest.mark.faults


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", WITNESSES)
def test_co_simulation(name, fmi, started):
    witness = WITNESSES[name]
    agree_in_all_ways(witness, started(witness.automaton, fmi, "addresses"), fmi)


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", POLYNOMIAL)
def test_model_exchange(name, fmi, started):
    witness = WITNESSES[name]
    if witness.changes:
        witness = type(witness)(witness.automaton, witness.t_end, witness.n)
    harness = started(witness.automaton, fmi, "addresses")
    agree(witness, python_run(witness), model_exchange(harness, witness))
