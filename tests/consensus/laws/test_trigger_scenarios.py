"""The trigger and the channel in scenario files, and networks of agents under every law as automata and as FMUs."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from catalogue_triggers import CHANNELS, LAWS, RING

import hybrid_model as hm
from cosim.consensus import fmu_system, in_process_system, network_report
from cosim.errors import MisfitError
from cosim.masters import run_event_exact
from hybrid_model.consensus.laws.closed_loop import closed_loop, scenario_agents
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.channel import Channel
from hybrid_model.consensus.scenario.definition import replace_trigger
from hybrid_model.consensus.scenario.files import read_scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind

# The limits of the agreement test.
TIME_TOLERANCE = 1e-7
STATE_TOLERANCE = 1e-8

GIVEN = {
    "static": {"threshold": 0.5},
    "dynamic": {"threshold": 0.5, "decay": 0.1},
    "mixed": {"offset": 0.1, "threshold": 0.5, "decay": 0.1},
    "relative": {"sigma": 0.5, "floor": 1e-4},
    "girard": {"sigma": 0.5, "theta": 1.0, "leak": 0.1, "reserve": 0.25},
    "self-triggered": {"threshold": 0.5},
    "sampled": {"threshold": 0.5, "period": 0.1},
    "periodic": {"period": 0.1},
    "continuous": {},
}
OPTIONAL = {"relative": "decay", "self-triggered": "decay", "sampled": "decay"}


def with_trigger(**trigger):
    return {**copy.deepcopy(RING), "trigger": trigger}


def test_every_kind_is_here():
    # What is of the user's own is in test_own_trigger.py.
    assert set(GIVEN) == {kind.value for kind in TriggerKind if kind is not TriggerKind.OWN}


@pytest.mark.parametrize("kind", GIVEN)
def test_a_trigger_has_the_numbers_that_the_file_gives(kind):
    assert read_scenario(with_trigger(kind=kind, **GIVEN[kind])).trigger == Trigger(TriggerKind(kind), **GIVEN[kind])


@pytest.mark.parametrize(("kind", "key"), OPTIONAL.items())
def test_a_decay_may_be_given(kind, key):
    assert getattr(read_scenario(with_trigger(kind=kind, **GIVEN[kind], **{key: 0.3})).trigger, key) == 0.3


@pytest.mark.parametrize(("kind", "key"), [(kind, key) for kind, numbers in GIVEN.items() for key in numbers])
def test_a_missing_number_is_named(kind, key):
    numbers = {name: value for name, value in GIVEN[kind].items() if name != key}
    with pytest.raises(ScenarioError, match=rf"\[trigger\] has no '{key}'; it must be a number"):
        read_scenario(with_trigger(kind=kind, **numbers))


@pytest.mark.parametrize(("kind", "key"), [(kind, key) for kind, numbers in GIVEN.items() for key in numbers])
def test_a_number_out_of_range_is_named(kind, key):
    with pytest.raises(ScenarioError, match=rf"\[trigger\] {key} is -1.0; it must"):
        read_scenario(with_trigger(kind=kind, **{**GIVEN[kind], key: -1.0}))


@pytest.mark.parametrize("kind", GIVEN)
def test_a_number_of_another_law_is_named(kind):
    other = next(key for key in ("theta", "period") if key not in GIVEN[kind])
    with pytest.raises(ScenarioError, match=rf"\[trigger\] has the unknown key '{other}'. .*Known keys: kind"):
        read_scenario(with_trigger(kind=kind, **GIVEN[kind], **{other: 1.0}))
    with pytest.raises(ScenarioError, match=rf"{other} is 1.0, but the trigger '{kind}' has no {other}"):
        Trigger(TriggerKind(kind), **GIVEN[kind], **{other: 1.0})


def test_a_share_of_one_is_too_much():
    with pytest.raises(ScenarioError, match=r"sigma is 1\.0; it must lie between 0 and 1, both excluded"):
        Trigger(TriggerKind.RELATIVE, sigma=1.0, floor=1e-3)


def test_levels():
    np.testing.assert_allclose(
        Trigger(TriggerKind.MIXED, 0.5, 0.1, offset=0.2).level([0.0, 10.0]), [0.7, 0.2 + 0.5 / np.e], rtol=1e-15
    )
    for kind in ("relative", "girard", "periodic", "continuous"):
        trigger = Trigger(TriggerKind(kind), **GIVEN[kind])
        assert not trigger.has_level
        with pytest.raises(ScenarioError, match=f"the trigger '{kind}' compares the error with no function of time"):
            trigger.level(0.0)


def test_replacing_a_trigger_takes_only_numbers_that_are_there():
    mixed = read_scenario(with_trigger(kind="mixed", **GIVEN["mixed"]))
    assert replace_trigger(mixed, "static").trigger == Trigger(TriggerKind.STATIC, 0.5)
    with pytest.raises(
        ScenarioError, match="'mixed' of scenario 'ring' does not have the numbers of the trigger 'girard'"
    ):
        replace_trigger(mixed, "girard")
    with pytest.raises(ScenarioError, match="'periodic' of scenario 'ring' does not have"):
        replace_trigger(read_scenario(with_trigger(kind="periodic", period=0.1)), "static")


class TestChannel:
    def test_as_given(self):
        table = {"delay": 0.1, "loss": 0.2, "seed": 3, "slots": 2}
        assert read_scenario({**RING, "channel": table}).channel == Channel(0.1, 0.2, 3, 2)
        assert read_scenario({**RING, "channel": {}}).channel.ideal
        assert read_scenario(RING).channel.ideal

    @pytest.mark.parametrize(
        ("table", "message"),
        [
            ({"dely": 1}, r"\[channel\] has the unknown key 'dely'. Did you mean 'delay'\?"),
            ({"delay": -0.1}, "delay is -0.1; it must be a finite time that is not negative"),
            ({"loss": 1.0}, "loss is 1.0; it must be a probability from 0 to below 1"),
            ({"loss": -0.1}, "loss is -0.1; it must be a probability"),
            ({"seed": -1}, "seed is -1; it must be a whole number from 0"),
            ({"seed": 1.5}, "seed is 1.5; it must be a whole number"),
            ({"slots": 0}, "slots is 0; it must be at least 1"),
        ],
    )
    def test_refusals(self, table, message):
        with pytest.raises(ScenarioError, match=message):
            read_scenario({**RING, "channel": table})

    def test_continuous_agents_send_nothing_to_delay(self):
        with pytest.raises(ScenarioError, match="the trigger 'continuous' sends none"):
            read_scenario({**RING, "trigger": {"kind": "continuous"}, "channel": {"delay": 0.1}})


def test_continuous_agents_do_not_meet_at_events():
    scenario = read_scenario(with_trigger(kind="continuous"))
    with pytest.raises(MisfitError, match="changes along flows"):
        run_event_exact(in_process_system(scenario), 1.0)


NETWORKS = {
    **{law: replace(read_scenario(RING), trigger=trigger) for law, trigger in LAWS.items()},
    **{name: replace(read_scenario(RING), channel=channel) for name, channel in CHANNELS.items()},
}
PAIR = {
    **RING,
    "network": {"agents": 2, "edges": [[1, 2]], "initial": [1.0, -0.4]},
    "weights": {"kind": "constant", "value": 0.6},
}
NETWORKS["pair_self_triggered"] = replace(read_scenario(PAIR), trigger=LAWS["self_triggered"])
QUICK = ("relative", "pair_self_triggered", "loss")
"""One law that hears its neighbours, one that computes ahead, one channel; the others are left to the long run. The C
code of an agent that computes ahead grows with its neighbours and takes long to compile, so there are two agents."""


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n in QUICK else [pytest.mark.long]) for n in NETWORKS])
def test_agents_as_fmus_and_as_automata_run_like_the_closed_loop(name, exported):
    scenario = NETWORKS[name]
    loop = run_report(scenario, hm.simulate(closed_loop(scenario), scenario.stop_time))
    assert sum(loop.events_per_agent) > 3
    fmus = {
        agent: exported(automaton, f"ring_{name}_{agent}") for agent, automaton in scenario_agents(scenario).items()
    }
    for system in (in_process_system(scenario), fmu_system(scenario, fmus)):
        report = network_report(scenario, run_event_exact(system, scenario.stop_time))
        assert report.events_per_agent == loop.events_per_agent
        for times, expected in zip(report.event_times, loop.event_times, strict=True):
            np.testing.assert_allclose(times, expected, rtol=0, atol=TIME_TOLERANCE)
        np.testing.assert_allclose(report.x_end, loop.x_end, rtol=0, atol=STATE_TOLERANCE)
