"""Channels with delay and loss: what arrives when, what is lost, and the drift of the mean."""

from dataclasses import replace

import numpy as np
import pytest
from catalogue_triggers import RING
from drawing import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from law_runs import compare, reported, reported_by_agents, run
from oracles.exact_laws import law_run
from random_scenarios import random_scenario

import hybrid_model as hm
from hybrid_model.consensus.laws.channels import link_seeds
from hybrid_model.consensus.runs.report import run_report
from hybrid_model.consensus.scenario.channel import Channel
from hybrid_model.consensus.scenario.files import load_scenario, read_scenario

SEEDS = st.integers(0, 2**32 - 1)


def drawn(seed, slots=16, **options):
    """As many slots as these runs need: each is a state of a compiled model."""
    rng = np.random.default_rng([seed, 1])
    channel = {"loss": rng.uniform(0.0, 0.6), "seed": int(rng.integers(0, 1000)), "slots": slots}
    if rng.random() < 0.7:
        channel["delay"] = rng.uniform(0.01, 0.3)
    kind = str(rng.choice(["dynamic", "mixed", "relative", "sampled"]))
    return random_scenario(seed, kind, channel=channel, **options)


@examples(2, 10)
@given(seed=SEEDS)
def test_a_run_over_a_channel_is_the_exact_one(seed):
    scenario = drawn(seed)
    exact, arc = law_run(scenario), run(scenario)
    compare(run_report(scenario, arc), exact)
    lost = sum(arc[name][-1].sum() for name in lost_names(scenario))
    assert lost == exact.lost


@examples(2, 4)
@given(seed=SEEDS)
def test_agents_that_meet_at_events_only_run_the_same(seed):
    scenario = drawn(seed, stop_time=2.0)
    compare(reported_by_agents(scenario), law_run(scenario))


@pytest.mark.long
@settings(max_examples=1000, deadline=None)
@given(seed=SEEDS)
def test_a_run_over_a_channel_is_the_exact_one_in_many_cases(seed):
    scenario = drawn(seed, slots=64)
    compare(reported(scenario), law_run(scenario))


def lost_names(scenario):
    linked = sorted({end for edge in scenario.network.edges for end in edge})
    return [f"agent{i}.channel.lost" for i in linked]


def test_the_drift_of_the_mean_by_hand():
    """Two agents broadcast together; the message from 1 to 2 is lost, that from 2 to 1 arrives.

    Before, the copies are right and the mean stays. After, agent 2 still pulls towards the start of agent 1, so the
    mean moves at the rate ``(x_1(0) - xhat_1)/2``.
    """
    seed = next(
        seed
        for seed in range(100)
        if draws(seed, receiver=2, sender=1)[0] < 0.5 and draws(seed, receiver=1, sender=2)[0] >= 0.5
    )
    entries = {
        "name": "two",
        "stop_time": 0.45,
        "network": {"agents": 2, "edges": [[1, 2]], "initial": [0.0, 1.0]},
        "weights": {"kind": "constant", "value": 1.0},
        "trigger": {"kind": "static", "threshold": 0.3},
        "channel": {"loss": 0.5, "seed": seed},
    }
    scenario = read_scenario(entries)
    arc = run(scenario)
    report = run_report(scenario, arc)
    np.testing.assert_allclose([times[0] for times in report.event_times], 0.3, rtol=1e-12)
    assert report.events_per_agent == [1, 1]
    # Agent 1: xhat_1 = .3 and x_1(0) = 0 for the remaining .15 s.
    assert report.mean_drift == pytest.approx(0.15 * 0.3 / 2, rel=1e-9)
    assert arc["agent2.channel.lost"][-1, 0] == 1
    assert arc["agent1.channel.lost"][-1, 0] == 0


def draws(seed, receiver, sender, count=1):
    """The first random numbers of a link, in whole-number arithmetic."""
    (state,) = link_seeds(seed, receiver, [sender])
    found = []
    for _ in range(count):
        state = 48271 * state % (2**31 - 1)
        found.append(state / (2**31 - 1))
    return found


def test_each_link_loses_the_broadcasts_that_its_numbers_say():
    scenario = replace(read_scenario(RING), channel=Channel(loss=0.4, seed=5), stop_time=8.0)
    arc = run(scenario)
    report = run_report(scenario, arc)
    # The neighbours of agent 1, in the order of its edges: 2 and 3.
    for place, sender in enumerate([2, 3]):
        count = report.events_per_agent[sender - 1]
        expected = sum(draw < 0.4 for draw in draws(5, 1, sender, count))
        assert arc["agent1.channel.lost"][-1, place] == expected
    assert sum(report.events_per_agent) > 10
    assert sum(arc[name][-1].sum() for name in lost_names(scenario)) > 0


def test_loss_happens_as_often_as_it_should():
    # Pooled over links; four standard deviations of a binomial count.
    numbers = np.array([draws(seed, 1, 2, 50) for seed in range(200)]).ravel()
    lost = np.count_nonzero(numbers < 0.3)
    assert abs(lost - 3000) < 4 * np.sqrt(10_000 * 0.3 * 0.7)


def test_links_have_numbers_of_their_own():
    seeds = [seed for receiver in range(1, 6) for seed in link_seeds(3, receiver, [1, 2, 3, 4, 5])]
    assert len(set(seeds)) == 25
    assert link_seeds(3, 2, [4, 1]) == link_seeds(3, 2, [1, 4])[::-1]


def test_copies_stay_as_close_as_the_delay_allows():
    """With a delay below the shortest gap ``|copy - x_j| <= c (1 + exp(beta delay)) exp(-beta t)`` (audit, 11)."""
    delay = 0.05
    scenario = replace(load_scenario("paper-a"), channel=Channel(delay=delay))
    arc = run(scenario)
    report = run_report(scenario, arc)
    assert delay < report.min_gap
    trigger = scenario.trigger
    bound = trigger.threshold * (1 + np.exp(trigger.decay * delay)) * np.exp(-trigger.decay * arc.t)
    worst = 0.0
    for receiver, senders in {1: [2, 4], 2: [1, 3], 3: [2, 4], 4: [3, 1]}.items():
        copies = arc[f"agent{receiver}.channel.received"]
        for place, sender in enumerate(senders):
            distance = np.abs(copies[:, place] - arc[f"agent{sender}.x"])
            # At the start the receivers take the values over in the first jumps.
            worst = max(worst, float(np.max((distance / bound)[arc.t > 0])))
    assert 0.5 < worst <= 1.0 + 1e-9


def test_without_delay_and_loss_the_mean_stays():
    assert reported(load_scenario("paper-a")).mean_drift < 1e-12


def test_too_many_broadcasts_under_way_end_the_run_with_a_message():
    scenario = replace(read_scenario(RING), channel=Channel(delay=3.0, slots=1))
    arc = run(scenario)
    assert arc.stop is hm.Stop.BLOCKED
    assert "flow set" in arc.message
