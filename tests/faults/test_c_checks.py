"""The checks that changed runtimes are judged by, of the runtime as it is: all of them hold."""

import pytest
from c_checks_rules import RULE_CHECKS
from c_checks_runs import RUN_CHECKS

pytestmark = pytest.mark.faults
CHECKS = RUN_CHECKS | RULE_CHECKS


@pytest.mark.parametrize("flavour", ["plain", "addresses"])
@pytest.mark.parametrize("name", CHECKS)
def test_holds(name, flavour, started):
    CHECKS[name](lambda automaton, fmi: started(automaton, fmi, flavour))
