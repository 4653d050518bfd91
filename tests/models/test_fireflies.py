"""Fireflies against an oracle in rational arithmetic, against the return map of two, and as a network."""

from fractions import Fraction

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.masters import run_event_exact
from cosim.system import System
from hybrid_model.models import Fireflies, Firefly, FireflyNetwork

# A rounding of a flash time, some ulp, grows by 1 + coupling a flash until the fireflies are together: 1.3**30 is 2600.
GROWN = 1e-11


def exact_flashes(phases, coupling, t_end):
    """Flashes (t, firefly) in rational arithmetic, event by event."""
    phase, gain = [Fraction(p) for p in phases], 1 + Fraction(coupling)
    t, flashes = Fraction(0), []
    while True:
        wait = 1 - max(phase)
        if t + wait > t_end:
            return flashes
        t += wait
        phase = [p + wait for p in phase]
        while any(p >= 1 for p in phase):
            i = next(k for k, p in enumerate(phase) if p >= 1)
            flashes.append((float(t), i))
            phase = [Fraction(0) if k == i else min(Fraction(1), gain * p) for k, p in enumerate(phase)]


def flashes_of(arc):
    """Flashes (t, firefly) of `Fireflies` or of a `FireflyNetwork`."""
    if isinstance(arc.automaton, FireflyNetwork):
        return [
            (jump.t, int(jump.name.removeprefix("firefly").removesuffix(".flash")) - 1)
            for jump in arc.jumps
            if jump.name.endswith(".flash")
        ]
    return [(jump.t, int(np.argmax(jump.z_after - jump.z_before))) for jump in arc.jumps]


def drawn_starts():
    rng = np.random.default_rng(11)
    return [[float(p) for p in rng.uniform(0.0, 1.0, count)] for count in (2, 2, 3, 5, 8)]


@pytest.mark.parametrize("phases", drawn_starts())
@pytest.mark.parametrize("coupling", [0.05, 0.3])
@pytest.mark.parametrize("model", ["one", "network"])
def test_flashes_are_those_of_rational_arithmetic(phases, coupling, model):
    automaton = Fireflies(phase=phases, coupling=coupling) if model == "one" else FireflyNetwork(phases, coupling)
    arc = hm.simulate(automaton, 6.05)
    expected = exact_flashes(phases, coupling, 6.05)
    assert len(expected) > 8
    assert [i for _, i in flashes_of(arc)] == [i for _, i in expected]
    assert [t for t, _ in flashes_of(arc)] == pytest.approx([t for t, _ in expected], abs=GROWN)


def instants(flashes):
    """The flashes grouped by equal times."""
    groups = []
    for t, i in flashes:
        if groups and groups[-1][0] == t:
            groups[-1][1].append(i)
        else:
            groups.append((t, [i]))
    return groups


@pytest.mark.parametrize("phases", drawn_starts())
def test_all_come_to_flash_together_and_stay_together(phases):
    """Mirollo and Strogatz: synchrony from almost every start, by absorption in finite time."""
    arc = hm.simulate(Fireflies(phase=phases, coupling=0.2), 25.0)
    groups = instants(flashes_of(arc))
    everybody = list(range(len(phases)))
    together = [t for t, group in groups if group == everybody]
    assert together
    assert groups[0][1] != everybody
    # From then on no other flashes, one a second, in the order of the fireflies.
    assert [t for t, _ in groups if t >= together[0]] == together
    assert np.diff(together) == pytest.approx(1.0, abs=1e-13)
    # Equal but for the rounding of one flow, which each flash sets back to nothing.
    assert np.ptp(arc.end.phase) < 1e-15
    # Absorbed fireflies never part: the number of flashes at one instant does not fall for any two in a group.
    for (_, group), (_, later) in zip(groups, groups[len(phases) :], strict=False):
        assert not set(group) & set(later) or set(group) <= set(later)


@pytest.mark.parametrize(("coupling", "offset"), [(0.25, 1e-3), (0.25, -1e-3), (0.5, 1e-4), (0.1, 0.02)])
def test_two_fireflies_leave_the_repelling_fixed_point_by_the_return_map(coupling, offset):
    gain = 1.0 + coupling
    fixed = gain / (1.0 + gain)
    # One at 0 and the other at p: the flash comes after 1 - p, and the distance from the fixed point takes the factor
    # -gain, until the flash finds the other so near that it takes it along.
    p, t, expected = fixed + offset, 0.0, []
    for k in range(200):
        p = fixed + (-gain) ** k * offset
        t += 1.0 - p
        expected.append(t)
        if gain * (1.0 - p) >= 1.0:
            break
    flashes = flashes_of(hm.simulate(Fireflies(phase=[0.0, fixed + offset], coupling=coupling), t + 2.5))
    alone, last = flashes[: len(expected) - 1], len(expected)
    # The deviation grows by the gain, and a rounding of the start with it: a distance of 1 from a start of `offset`.
    assert [t for t, _ in flashes[:last]] == pytest.approx(expected, abs=1e-14 / abs(offset))
    assert [i for _, i in alone] == [(k + 1) % 2 for k in range(last - 1)]
    assert [len(group) for _, group in instants(flashes)] == [1] * (last - 1) + [2, 2, 2]


def test_at_the_fixed_point_two_fireflies_take_turns():
    # coupling 2: the fixed point 3/4 and all phases are binary fractions. Roundings grow by 3 a flash: 3**12 ulp.
    flashes = flashes_of(hm.simulate(Fireflies(phase=[0.0, 0.75], coupling=2.0), 3.1))
    assert [i for _, i in flashes] == [1, 0] * 6
    assert [t for t, _ in flashes] == pytest.approx(0.25 * np.arange(1, 13), abs=3.0**12 * 1e-15)


def test_without_coupling_each_keeps_its_own_time():
    phases = [0.1, 0.45, 0.8]
    flashes = flashes_of(hm.simulate(Fireflies(phase=phases, coupling=0.0), 5.05))
    expected = sorted((k - p, i) for i, p in enumerate(phases) for k in range(1, 7) if k - p <= 5.05)
    assert [i for _, i in flashes] == [i for _, i in expected]
    assert [t for t, _ in flashes] == pytest.approx([t for t, _ in expected], abs=1e-13)


def test_pulses_at_one_instant_act_one_after_the_other():
    firefly = Firefly(others=2, phase=0.3, coupling=0.1)
    arc = hm.simulate(firefly, 0.3, inputs={"received": hm.Signal(lambda t: [t >= 0.2, 2 * (t >= 0.2)], [0.2])})
    assert [jump.name for jump in arc.jumps] == ["pulse"] * 3
    assert arc.event_times("pulse") == pytest.approx([0.2] * 3, abs=1e-14)
    assert arc.end.phase == pytest.approx(0.5 * 1.1**3 + 0.1, abs=1e-14)


@pytest.mark.parametrize("phases", drawn_starts())
def test_fireflies_as_blocks_of_their_own_meet_at_flashes_only(phases):
    names = [f"firefly{k + 1}" for k in range(len(phases))]
    blocks = [
        AutomatonSlave(name, Firefly(others=len(phases) - 1, phase=p)) for name, p in zip(names, phases, strict=True)
    ]
    wires = {
        f"{name}.received[{k + 1}]": f"{other}.flashes"
        for name in names
        for k, other in enumerate(other for other in names if other != name)
    }
    result = run_event_exact(System(blocks, wires), 6.05)
    ticks = [(tick.t, names.index(tick.slave)) for tick in result.ticks]
    expected = exact_flashes(phases, 0.3, 6.05)
    assert [i for _, i in ticks] == [i for _, i in expected]
    assert [t for t, _ in ticks] == pytest.approx([t for t, _ in expected], abs=GROWN)
