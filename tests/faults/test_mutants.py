"""Tests have teeth: each of many faults in the runtime is seen by a check, and the runtime as it is passes them all.

A fault is killed by a check that fails on its own assertion, by a promise that the harness looks after, or because the
process ends or hangs.  That a changed runtime does not compile kills nothing: that is an error of the table.
"""

from dataclasses import replace

import pytest
from c_checks_rules import RULE_CHECKS
from c_checks_runs import RUN_CHECKS
from c_harness import Fallen, Harness, generated
from mutants import MUTANTS

from fmu.build.binaries import own_files

CHECKS = RUN_CHECKS | RULE_CHECKS


def judge(builder, changed, names):
    """The first check that fails, with what it said; None if all of them hold."""
    for name in names:
        running = []

        def start(automaton, fmi, running=running):
            program = builder.build(automaton, fmi, "plain", changed)
            # A second is a thousand times what the longest call of a check takes, and what all of them take.
            running.append(Harness(program, generated(automaton, fmi)[1], time_limit=10.0, whole=30.0))
            return running[-1]

        try:
            CHECKS[name](start)
        except AssertionError as fault:
            return name, fault
        finally:
            for harness in running:
                harness.process.kill()
                harness.process.communicate()
    return None


def order(first):
    return [first, *(name for name in CHECKS if name != first)]


@pytest.mark.faults
def test_the_runtime_as_it_is_survives(builder):
    assert judge(builder, {}, CHECKS) is None


def test_there_are_enough_of_them():
    assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS) >= 90


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_its_place_is_there(mutant):
    """Quick, so that a refactoring of the C files does not leave a fault behind."""
    file, text = mutant.changed()
    assert text != own_files(file)[0].read_text()
    assert mutant.first in CHECKS


def test_blanks_and_comments_do_not_count_and_other_functions_do_not_either():
    start = next(mutant for mutant in MUTANTS if mutant.name == "start values as declared")
    spread = replace(start, old="  if(view  ==\n\n VIEW_START)")
    assert spread.changed() == start.changed()
    for lost in (replace(start, at="engine_reverse"), replace(start, at="nowhere"), replace(start, old="view")):
        with pytest.raises(AssertionError, match="there must be one"):
            lost.changed()


@pytest.mark.faults
@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_killed(mutant, builder):
    fault = judge(builder, dict([mutant.changed()]), order(mutant.first))
    assert fault is not None, f"nobody sees it: {mutant.breaks}"
    name, error = fault
    print(f"killed by {name}: {'Fallen' if isinstance(error, Fallen) else 'assertion'}")
