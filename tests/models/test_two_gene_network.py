"""The two-gene network against its closed form: exponentials and logarithms, switch by switch."""

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import TwoGeneNetwork

# Twenty flights, each to the solver's 1e-13, over slopes of at least 0.2 per s.
TIME = 1e-10

SLOW = {"k1": 2.0, "k2": 0.5, "g1": 1.3, "g2": 0.4, "threshold1": 0.7, "threshold2": 0.6, "h1": 0.2, "h2": 0.15}
DEFAULT = {"k1": 1.0, "k2": 1.0, "g1": 1.0, "g2": 1.0, "threshold1": 0.6, "threshold2": 0.5, "h1": 0.1, "h2": 0.05}


def switches(p, count, x1=0.6, x2=0.3):
    """Times, names and concentrations at the switches, in the order q1 on, q2 on, q1 off, q2 off."""
    t, q1, q2, found = 0.0, 0, 0, []
    for n in range(count):
        target1, target2 = p["k1"] * (1 - q2) / p["g1"], p["k2"] * q1 / p["g2"]
        if n % 2 == 0:
            edge = p["threshold1"] + (p["h1"] if q1 == 0 else -p["h1"])
            tau = np.log((target1 - x1) / (target1 - edge)) / p["g1"]
            name, q1 = ("q1_on", 1) if q1 == 0 else ("q1_off", 0)
        else:
            edge = p["threshold2"] + (p["h2"] if q2 == 0 else -p["h2"])
            tau = np.log((target2 - x2) / (target2 - edge)) / p["g2"]
            name, q2 = ("q2_on", 1) if q2 == 0 else ("q2_off", 0)
        t += tau
        x1 = target1 + (x1 - target1) * np.exp(-p["g1"] * tau)
        x2 = target2 + (x2 - target2) * np.exp(-p["g2"] * tau)
        found.append((t, name, x1, x2))
    return found


@pytest.mark.parametrize("values", [DEFAULT, SLOW])
def test_switching_times_and_concentrations(values):
    exact = switches(values, 20)
    arc = hm.simulate(TwoGeneNetwork(**values), exact[-1][0] + 1e-6)
    assert [jump.name for jump in arc.jumps] == [name for _, name, _, _ in exact]
    assert [jump.t for jump in arc.jumps] == pytest.approx([t for t, _, _, _ in exact], abs=TIME)
    assert [jump.x_after[0] for jump in arc.jumps] == pytest.approx([x1 for _, _, x1, _ in exact], abs=TIME)
    assert [jump.x_after[1] for jump in arc.jumps] == pytest.approx([x2 for _, _, _, x2 in exact], abs=TIME)


def test_runs_from_far_apart_approach_one_limit_cycle():
    ends = []
    for x1, x2 in [(0.6, 0.3), (0.1, 0.44)]:
        arc = hm.simulate(TwoGeneNetwork(x1=x1, x2=x2), 40.0)
        assert {jump.name for jump in arc.jumps} == {"q1_on", "q2_on", "q1_off", "q2_off"}
        last = next(jump for jump in reversed(arc.jumps) if jump.name == "q1_on")
        ends.append((np.diff(arc.event_times("q1_on"))[-1], last.x_after[1]))
    # Each round shrinks the distance to the cycle by some e^-4; more than ten rounds.
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)
    # And the same from the closed form, at the 60th switch.
    exact = switches(DEFAULT, 60)
    assert ends[0][0] == pytest.approx(exact[56][0] - exact[52][0], abs=1e-9)


def test_a_threshold_above_what_the_gene_can_hold_is_never_reached():
    arc = hm.simulate(TwoGeneNetwork(threshold1=1.2), 30.0)
    assert arc.jumps == []
    assert [arc.end.x1, arc.end.x2] == pytest.approx([1.0 - 0.4 * np.exp(-30.0), 0.3 * np.exp(-30.0)], abs=1e-12)
