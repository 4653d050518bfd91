"""Slaves that handle their events inside, FMI 2.0 above all, with discrete signals between them: events not lost."""

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.cli.main import main
from cosim.errors import CosimError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_error_controlled, run_event_exact
from cosim.system import System

WIRES = {"a.heard": "b.sent", "b.heard": "a.sent"}
T_END = 40.0


class Sends(hm.HybridAutomaton):
    """An agent: its state goes to what it hears, and it sends it when it has gone on by a part of what is left."""

    heard = hm.Input(0.0, discrete=True)
    x = hm.State(0.0, output=True)
    sent = hm.DiscreteState(0.0, output=True)
    part = hm.Parameter(0.03)

    def flow_map(self, s):
        return {"x": 0.1 * (s.heard - s.sent)}

    def jump_set(self, s):
        return (s.x - s.sent) ** 2 - s.part * (s.heard - s.sent) ** 2 - 1e-6

    def jump_map(self, s):
        return {"sent": s.x}


def agents(kind):
    return [kind("a"), kind("b")]


def starts(slaves):
    for slave, x, part in zip(slaves, (0.0, 1.0), (0.03, 0.05), strict=True):
        for name, value in {"x": x, "sent": x, "part": part}.items():
            slave.set(name, value)
    return slaves


@pytest.fixture(scope="module")
def exact():
    system = System(starts(agents(lambda name: AutomatonSlave(name, Sends()))), WIRES)
    result = run_event_exact(system, T_END)
    assert len(result.events) == 24
    return result


@pytest.mark.parametrize("versions", [("2.0", "2.0"), ("3.0", "2.0")])
def test_fmus_that_end_their_steps_at_events_meet_there(versions, exported, exact):
    """An event is where it is, not where a step begins to show it, which is up to 2e-11 of the time before it."""
    named = zip("ab", versions, strict=True)
    slaves = starts([FmuSlave(name, exported(Sends(), "sends", version)) for name, version in named])
    result = run_error_controlled(System(slaves, WIRES), T_END)
    for name in "ab":
        # Errors of earlier events are in the later ones.
        np.testing.assert_allclose(result.event_times(name), exact.event_times(name), atol=1e-11, rtol=0)
        assert result.final[f"{name}.x"] == pytest.approx(exact.final[f"{name}.x"], abs=1e-12)
    # Two slaves go on towards the end, return from there to the event, and settle with what was sent.
    assert result.steps < 7 * len(exact.events)
    assert "after which its steps end" in result.treatment["b"]


def test_the_command_meets_fmi2_at_its_events(exported, tmp_path, capsys):
    path = exported(Sends(), "sends", "2.0")
    (tmp_path / "system.toml").write_text(
        f"[experiment]\nstop_time = {T_END}\n"
        f'[components.a]\nfmu = "{path}"\n'
        f'[components.b]\nfmu = "{path}"\nstart = {{ x = 1.0, sent = 1.0, part = 0.05 }}\n'
        '[connections]\n"a.heard" = "b.sent"\n"b.heard" = "a.sent"\n'
    )
    assert main(["cosim", str(tmp_path)]) == 0
    assert "b: 9 events at 1.87324039, 3.78459902" in capsys.readouterr().out


class Hides(hm.HybridAutomaton):
    """Counts the halves that its state rises by, and shows it nowhere."""

    u = hm.Input(0.0)
    x = hm.State(0.0, output=True)
    n = hm.DiscreteState(0, integer=True)

    def flow_map(self, s):
        return {"x": s.u}

    def jump_set(self, s):
        return s.x - 0.5 * (s.n + 1)

    def jump_map(self, s):
        return {"n": s.n + 1}


class Rises(hm.HybridAutomaton):
    """Time, which is looked at every 0.8 s without consequences."""

    x = hm.State(0.0, output=True)
    n = hm.DiscreteState(0, integer=True)

    def flow_map(self, s):
        return {"x": 1.0}

    transitions = (hm.TimeEvent("look", lambda self, s: 0.8 * (s.n + 1), lambda self, s: {"n": s.n + 1}),)


@pytest.mark.parametrize("version", ["", "2.0", "3.0"])
def test_events_that_change_no_output_are_listed(version, exported):
    """x = t^2/2 is k/2 at sqrt(k)."""
    kind = (lambda name, a: FmuSlave(name, exported(a, name, version))) if version else AutomatonSlave
    system = System([kind("rises", Rises()), kind("hides", Hides())], {"hides.u": "rises.x"})
    result = run_error_controlled(system, 2.1)
    np.testing.assert_allclose(result.event_times("hides"), np.sqrt([1, 2, 3, 4]), atol=1e-9, rtol=0)
    np.testing.assert_allclose(result.event_times("rises"), [0.8, 1.6], atol=1e-12, rtol=0)
    kinds = {(event.block, event.kind) for event in result.events}
    assert kinds == {("hides", "stopped"), ("rises", "stopped" if version == "2.0" else "announced")}


def test_an_output_that_nobody_hears_of_shows_events_of_fmus_without_event_mode(stranger):
    """It counts at 0.5, 1, 1.5 s, is searched alone, and one of its outputs counts its steps."""
    slave = FmuSlave("a", stranger(events=False))
    slave.set("rate", 2.0)
    result = run_error_controlled(System([slave], {}), 1.6, output_interval=0.4)
    np.testing.assert_allclose(result.event_times("a"), [0.5, 1.0, 1.5], atol=1e-9, rtol=0)
    assert [result.signals["a.count"][k] for k, t in enumerate(result.times) if t == result.events[0].t] == [0, 1]
    assert "a.steps, which each step changes, tells of none" in result.treatment["a"]


@pytest.mark.parametrize("events", [True, False])
def test_what_cannot_save_its_state_is_run_again_up_to_where_it_is_to_return(events, stranger, monkeypatch):
    """A stranger that sends at 0.5, 1, 1.5 s, with event mode or without, to another one that cannot go back either."""
    path = stranger(states=False, events=events)

    def run():
        slaves = [FmuSlave("a", path), FmuSlave("b", path)]
        slaves[0].set("rate", 2.0)
        return run_error_controlled(System(slaves, {"b.int32_in": "a.count"}), 1.6, output_interval=0.4)

    result = run()
    assert "goes back by a new run" in result.treatment["a"]
    np.testing.assert_allclose(result.event_times("a"), [0.5, 1.0, 1.5], atol=1e-9, rtol=0)
    assert result.final["b.int32_out"] == 3
    assert result.final["a.x"] == pytest.approx(0.2)
    monkeypatch.setattr("cosim.replayed_slave.MOST_REPEATED", 3)
    with pytest.raises(CosimError, match=r"cannot save its state, and .* use the fixed-step master"):
        run()


class Saw(hm.HybridAutomaton):
    """A saw: it rises along a line and falls from one to zero."""

    x = hm.State(0.0, output=True)
    slope = hm.Parameter(0.7)

    def flow_map(self, s):
        return {"x": s.slope}

    transitions = (hm.Jump("fall", lambda self, s: s.x - 1.0, lambda self, s: {"x": 0.0}),)


class Integral(hm.HybridAutomaton):
    u = hm.Input(0.0)
    total = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"total": s.u}


class Beats(hm.HybridAutomaton):
    """Sends its number, every period."""

    heard = hm.Input(0.0, discrete=True)
    period = hm.Parameter(0.5)
    sent = hm.DiscreteState(0.0, output=True)

    transitions = (
        hm.TimeEvent("beat", lambda self, s: (s.sent + 1.0) * s.period, lambda self, s: {"sent": s.sent + 1.0}),
    )


@pytest.mark.parametrize("version", ["2.0", None])
def test_what_flows_from_zero_does_not_jump(version, exported):
    """The integral of 0.7 t from zero: each step of no length changes it by a large part of what it was."""
    source = FmuSlave("a", exported(Saw(), "saw", version)) if version else AutomatonSlave("a", Saw())
    slaves = [source, FmuSlave("b", exported(Integral(), "integral", "2.0"))]
    result = run_error_controlled(System(slaves, {"b.u": "a.x"}), 2.0)
    # It has fallen once: a triangle of height 1, and a part of another.
    assert result.final["b.total"] == pytest.approx(0.5 / 0.7 + 0.35 * (2.0 - 1.0 / 0.7) ** 2, abs=1e-8)
    np.testing.assert_allclose(result.event_times("a"), [1.0 / 0.7], atol=1e-7, rtol=0)
    assert result.event_times("b").size == 0


@pytest.mark.parametrize("announcing", ["a", "b"])
def test_an_announced_event_is_listed_beside_a_hidden_one(announcing, exported):
    """To keep the row before the hidden one all go back, and have no event there."""
    slaves = [FmuSlave(n, exported(Beats(), "beats", "3.0" if n == announcing else "2.0")) for n in "ab"]
    slaves[1].set("period", 0.25)
    result = run_error_controlled(System(slaves, WIRES), 1.1, output_interval=0.1)
    np.testing.assert_allclose(result.event_times("a"), [0.5, 1.0], atol=1e-12, rtol=0)
    np.testing.assert_allclose(result.event_times("b"), [0.25, 0.5, 0.75, 1.0], atol=1e-12, rtol=0)


class CountsFalls(hm.HybridAutomaton):
    """Counts how often its input has fallen."""

    u = hm.Input(0.0)
    high = hm.DiscreteState(0.0)
    count = hm.DiscreteState(0.0, output=True)

    transitions = (
        hm.Jump("rise", lambda self, s: hm.least(s.u - 0.75, 0.5 - s.high), lambda self, s: {"high": 1.0}),
        hm.Jump(
            "fall",
            lambda self, s: hm.least(0.25 - s.u, s.high - 0.5),
            lambda self, s: {"high": 0.0, "count": s.count + 1.0},
        ),
    )


def test_an_event_that_was_named_and_is_taken_a_little_before_is_listed_once(exported):
    slaves = [FmuSlave("a", exported(Saw(), "saw", "2.0")), FmuSlave("b", exported(CountsFalls(), "counts", "2.0"))]
    result = run_error_controlled(System(slaves, {"b.u": "a.x"}), 2.0)
    for name in "ab":
        np.testing.assert_allclose(result.event_times(name), [1.0 / 0.7], atol=1e-7, rtol=0)
    assert result.final["b.count"] == 1.0
