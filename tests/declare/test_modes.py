"""Classical hybrid automata: what a modal automaton is lowered to, and what is refused."""

import re

import numpy as np
import pytest

import hybrid_model as hm
from hybrid_model.models import Thermostat


class ModalThermostat(hm.ModalAutomaton):
    """The thermostat of the library as a classical hybrid automaton."""

    temperature = hm.State(20.0)
    lower = hm.Parameter(19.0)
    upper = hm.Parameter(21.0)

    def heat(self, s):
        return {"temperature": (35.0 - s.temperature) / 100.0}

    def cool(self, s):
        return {"temperature": (5.0 - s.temperature) / 100.0}

    def not_too_warm(self, s):
        return s.upper - s.temperature

    def not_too_cold(self, s):
        return s.temperature - s.lower

    modes = (hm.Mode("off", cool, not_too_cold), hm.Mode("on", heat, not_too_warm))
    switches = (
        hm.Switch("turn off", "on", "off", lambda self, s: s.temperature - s.upper),
        hm.Switch("turn on", "off", "on", lambda self, s: s.lower - s.temperature),
    )


def test_it_runs_like_the_same_automaton_written_with_sets():
    modal, plain = hm.simulate(ModalThermostat(mode="on"), 200.0), hm.simulate(Thermostat(), 200.0)
    assert [jump.t for jump in modal.jumps] == pytest.approx([jump.t for jump in plain.jumps], abs=1e-10)
    assert [jump.name for jump in modal.jumps] == ["turn " + jump.name for jump in plain.jumps]
    grid = np.linspace(0.0, 200.0, 31)
    assert np.array_equal(modal.at("mode", grid), plain.at("heating", grid))


def test_the_lowering_is_the_form_c_f_d_g():
    automaton = ModalThermostat(mode="off", temperature=20.5)
    run = hm.Execution(automaton)
    s = run.values()
    assert automaton.derivatives(s) == {"temperature": (5.0 - 20.5) / 100.0}
    assert automaton.flow_margin(s) == 1.5  # the invariant of "off"
    # Guards: "turn off" belongs to the other mode, so its margin is negative whatever the temperature.
    assert automaton.jump_margins(s) == [-0.5, -1.5]
    assert automaton.reset(1, s) == {"mode": 1}
    assert [
        (variable.name, variable.integer) for variable in automaton.of_kind(hm.declare.variables.Kind.DISCRETE)
    ] == [("mode", True)]


def test_traced_it_chooses_among_all_modes_what_a_run_evaluates_in_one():
    plain = hm.simulate(ModalThermostat(), 200.0, engine="python")
    traced = hm.simulate(ModalThermostat(), 200.0, engine="native")
    # Two solvers at a relative tolerance of 1e-13.
    assert [jump.t for jump in traced.jumps] == pytest.approx([jump.t for jump in plain.jumps], rel=1e-11)


class Blinker(hm.ModalAutomaton):
    """Dark for one second, lit for half a second, by time; a kick on state works in both modes."""

    x = hm.State(0.0)
    since = hm.DiscreteState(0.0)
    kicks = hm.DiscreteState(0, integer=True)

    modes = (hm.Mode("dark", lambda self, s: {"x": 1.0}), hm.Mode("lit"))
    switches = (
        hm.TimedSwitch("light", "dark", "lit", lambda self, s: s.since + 1.0, lambda self, s: {"since": s.t}),
        hm.TimedSwitch("darken", "lit", "dark", lambda self, s: s.since + 0.5, lambda self, s: {"since": s.t}),
    )
    transitions = (hm.Jump("kick", lambda self, s: s.x - 1.5, lambda self, s: {"x": 0.0, "kicks": s.kicks + 1}),)


def test_timed_switches_resting_modes_and_jumps_of_every_mode():
    arc = hm.simulate(Blinker(), 4.0)
    assert [(jump.name, jump.t) for jump in arc.jumps] == [
        ("light", 1.0),
        ("darken", 1.5),
        ("kick", pytest.approx(2.0, abs=1e-14)),
        ("light", 2.5),
        ("darken", 3.0),
        ("light", 4.0),  # switches come before the jumps of every mode
        ("kick", pytest.approx(4.0, abs=1e-14)),
    ]
    assert arc.at("x", 1.25) == pytest.approx(1.0, abs=1e-14)  # a mode without a flow map rests


def test_a_state_outside_the_invariant_without_an_enabled_switch_is_blocked():
    class Trapped(hm.ModalAutomaton):
        x = hm.State(0.0)
        modes = (hm.Mode("on", lambda self, s: {"x": 1.0}, lambda self, s: 1.0 - s.x),)

    arc = hm.simulate(Trapped(), 3.0)
    assert arc.stop is hm.Stop.BLOCKED
    assert arc.t[-1] == pytest.approx(1.0, abs=2e-9)


def test_maps_of_other_modes_need_not_be_defined_in_a_run():
    class Root(hm.ModalAutomaton):
        x = hm.State(1.0)
        modes = (
            hm.Mode("fall", lambda self, s: {"x": -1.0}),
            hm.Mode("root", lambda self, s: {"x": np.sqrt(s.x - 0.5)}),
        )
        switches = (hm.Switch("down", "root", "fall", lambda self, s: s.x - 3.0),)

    assert hm.simulate(Root(), 2.0).end.x == pytest.approx(-1.0, abs=1e-14)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: ModalThermostat(mode="idle"), "no mode 'idle'; it has 0 off, 1 on"),
        (lambda: ModalThermostat(mode=4), "no mode 4; it has 0 off, 1 on"),
        (lambda: type("Empty", (hm.ModalAutomaton,), {})(), "declare at least one"),
        (
            lambda: type("Twice", (hm.ModalAutomaton,), {"modes": (hm.Mode("a"), hm.Mode("a"))})(),
            "the modes ['a', 'a']",
        ),
        (
            lambda: type(
                "Astray",
                (hm.ModalAutomaton,),
                {"modes": (hm.Mode("a"),), "switches": (hm.Switch("s", "a", "b", lambda self, s: -1.0),)},
            )(),
            "no mode 'b'; it has a",
        ),
        (
            lambda: hm.simulate(
                type(
                    "Boolean",
                    (hm.ModalAutomaton,),
                    {"modes": (hm.Mode("a"),), "switches": (hm.Switch("s", "a", "a", lambda self, s: s.t > 1.0),)},
                )(),
                1.0,
            ),
            "the guard of 's' of Boolean is a boolean",
        ),
    ],
)
def test_mistakes_are_answered_by_name(build, words):
    with pytest.raises(hm.HybridModelError, match=re.escape(words)):
        build()


def test_a_run_starts_in_a_mode_by_its_name():
    both = hm.product("both", ModalThermostat("a"), ModalThermostat("b"))
    arc = hm.simulate(both, 1.0, starts={"a.mode": "on", "b.mode": 0}, engine="python")
    assert (arc.at("a.mode", 0.0), arc.at("b.mode", 0.0)) == (1, 0)
    assert hm.simulate(both, 1.0, starts={"a.mode": "on"}).at("a.mode", 0.0) == 1
    with pytest.raises(hm.DeclarationError, match=r"^both has no b\.mode 'idle'; it has 0 off, 1 on\.$"):
        hm.simulate(both, 1.0, starts={"b.mode": "idle"})


def test_a_guard_need_not_be_defined_in_other_modes():
    class Logarithm(hm.ModalAutomaton):
        x = hm.State(1.0)
        modes = (hm.Mode("a", lambda self, s: {"x": 1.0}), hm.Mode("b", lambda self, s: {"x": 1.0}))
        switches = (
            hm.Switch("on", "a", "b", lambda self, s: s.x - 2.0),
            hm.Switch("back", "b", "a", lambda self, s: np.log(s.x - 1.5), lambda self, s: {"x": 0.0}),
        )

    assert [jump.t for jump in hm.simulate(Logarithm(), 2.0).jumps] == pytest.approx([1.0, 1.5], abs=1e-13)
