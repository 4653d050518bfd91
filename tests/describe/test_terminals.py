"""Terminals: agents plug together by them, and other automata get theirs by the same rule."""

from dataclasses import replace

import pytest
from catalogue import cases
from description_cases import BOTH, described, elements, schema
from lxml import etree

import hybrid_model as hm
from fmu.describe.terminals import KIND, terminals, terminals_and_icons
from fmu.describe.variables import Fmi
from hybrid_model.models import BouncingBall
from hybrid_model.native.networks.network import network_trace


def found(automaton, fmi):
    return {t.name: (t.sends, dict(t.members)) for t in terminals(described(automaton, fmi))}


def test_an_agent_sends_one_broadcast_and_hears_one_of_each_neighbour():
    assert found(cases()["agent2_dynamic"].automaton, Fmi.V3_0) == {
        "broadcast": (True, {"value": "broadcast", "clock": "broadcast_clock"}),
        "neighbours[1]": (False, {"value": "neighbours[1]"}),
        "neighbours[2]": (False, {"value": "neighbours[2]"}),
    }


def test_without_clocks_a_terminal_holds_the_value_alone():
    assert found(cases()["agent2_dynamic"].automaton, Fmi.V2_0)["broadcast"] == (True, {"value": "broadcast"})


@pytest.mark.parametrize("fmi", BOTH)
def test_agents_plug_together_by_matching_member_names(fmi):
    """What an importer does with the rule `bus`: join the members that both terminals have."""
    for name in ("agent2_dynamic", "vector_agent"):
        blocks = found(cases()[name].automaton, fmi)
        sent = next(members for sends, members in blocks.values() if sends)
        for sends, heard in blocks.values():
            if not sends:
                joined = {heard[member]: sent[member] for member in heard if member in sent}
                # Nothing that is heard stays open, and elements meet elements.
                assert set(joined) == set(heard.values())
    assert joined == {"neighbours[2,1]": "broadcast[1]", "neighbours[2,2]": "broadcast[2]"}


def test_other_automata_by_the_same_rule():
    firefly = found(cases()["firefly"].automaton, Fmi.V3_0)
    # A count that is all there is to hear is the message.
    assert firefly["flashes"] == (True, {"value": "flashes", "clock": "flash"})
    loop = found(cases()["event_triggered_lti_loop"].automaton, Fmi.V3_0)
    assert loop["feedback.u"] == (True, {"value[1]": "feedback.u[1]", "clock": "feedback.updated"})
    assert found(BouncingBall(), Fmi.V3_0) == {}


class TwoJumps(hm.HybridAutomaton):
    """Both jumps change `either`; one changes `first`; `computed` follows `first`; `mixed` also follows the input."""

    either = hm.DiscreteState(0.0, output=True)
    first = hm.DiscreteState(0.0, output=True)
    u = hm.Input(0.0, discrete=True)
    computed = hm.Output(discrete=True)
    mixed = hm.Output(discrete=True)
    one = hm.Clock("one")
    two = hm.Clock("two")

    transitions = (
        hm.Jump("one", lambda self, s: s.t - 1.0 - s.first, lambda self, s: {"first": s.first + 1, "either": 1.0}),
        hm.Jump(
            "two", lambda self, s: s.t - 2.0 - s.either, lambda self, s: {"either": s.either + 2, "first": s.first}
        ),
    )

    def outputs(self, s):
        return {"computed": 2.0 * s.first, "mixed": s.first + s.u}


def test_a_clock_belongs_to_what_changes_at_its_ticks_alone():
    blocks = found(TwoJumps(), Fmi.V3_0)
    assert blocks["either"] == (True, {"value": "either"})
    assert blocks["first"] == (True, {"value": "first", "clock": "one"})
    assert blocks["computed"] == (True, {"value": "computed", "clock": "one"})
    assert blocks["mixed"] == (True, {"value": "mixed"})


@pytest.mark.parametrize("fmi", BOTH)
def test_the_file_is_valid_and_names_variables_that_exist(fmi):
    validator = schema(Fmi.V3_0, "TerminalsAndIcons")
    for name in ("agent2_dynamic", "bouncing_ball", "vector_agent"):
        description = described(cases()[name].automaton, fmi)
        document = terminals_and_icons(description)
        assert validator.validate(etree.fromstring(document)), validator.error_log
        members = elements(document, "Terminals/Terminal/TerminalMemberVariable")
        assert {member.get("variableName") for member in members} <= set(description.names)
        for terminal in elements(document, "Terminals/Terminal"):
            assert (terminal.get("terminalKind"), terminal.get("matchingRule")) == (KIND, "bus")
            own = [member.get("memberName") for member in terminal.findall("TerminalMemberVariable")]
            assert len(set(own)) == len(own) > 0


@pytest.mark.parametrize("name", ["paper_dynamic", "firefly_network"])
def test_a_network_of_tables_has_the_terminals_of_the_whole(name):
    automaton = cases()[name].automaton
    whole = described(automaton, Fmi.V3_0)
    tables = replace(whole, traced=network_trace(automaton))
    assert terminals(tables) == terminals(whole)
    assert any("clock" in dict(terminal.members) for terminal in terminals(tables))
    assert tables.states_reset == whole.states_reset
