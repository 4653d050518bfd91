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
    assert len(result.events) == 28
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
    assert "b: 13 events at 1.87324039, 3.78459902" in capsys.readouterr().out


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


class Relay(hm.HybridAutomaton):
    """Takes over what it hears, and counts that where nobody sees it."""

    heard = hm.Input(0.0, discrete=True)
    u = hm.Input(0.0)
    sent = hm.DiscreteState(0.0, output=True)
    count = hm.DiscreteState(0.0)

    transitions = (
        hm.Jump("take", lambda self, s: (s.heard - s.sent) ** 2 - 0.25, lambda self, s: {"sent": s.heard}),
        hm.Jump("count", lambda self, s: s.u - s.count - 0.5, lambda self, s: {"count": s.u}),
    )


class Stairs(hm.HybridAutomaton):
    """Beats whose number is declared as if it flowed."""

    u = hm.Input(0.0)
    period = hm.Parameter(0.5)
    n = hm.DiscreteState(0.0)
    y = hm.Output()

    def outputs(self, s):
        return {"y": s.n}

    transitions = (hm.TimeEvent("beat", lambda self, s: (s.n + 1.0) * s.period, lambda self, s: {"n": s.n + 1.0}),)


class Follows(hm.HybridAutomaton):
    """Takes over what has come to its flowing input, as soon as that is a half away."""

    u = hm.Input(0.0)
    taken = hm.DiscreteState(0.0)
    y = hm.Output()

    def outputs(self, s):
        return {"y": s.taken}

    transitions = (hm.Jump("take", lambda self, s: (s.u - s.taken) ** 2 - 0.25, lambda self, s: {"taken": s.u}),)


@pytest.fixture
def slave(exported):
    """Slaves of models: automata in this process, or FMUs of a version."""

    def made(name, model, version, **starts):
        key = type(model).__name__.lower()
        found = FmuSlave(name, exported(model, key, version)) if version else AutomatonSlave(name, model)
        for variable, value in starts.items():
            found.set(variable, value)
        return found

    return made


@pytest.mark.parametrize("source", ["2.0", "3.0", None])
@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("discrete", [True, False])
def test_what_an_event_at_the_stop_time_brings_about_happens(source, order, discrete, slave):
    """One that handles its events inside does so at that time, and another one that hears of it: 0.5 and 1 s."""
    first, then = (Beats, Relay) if discrete else (Stairs, Follows)
    slaves = [slave("a", first(), source), slave("b", then(), "2.0"), slave("c", then(), "2.0")]
    into, out, sent = ("heard", "sent", "sent") if discrete else ("u", "y", "y")
    wires = {f"b.{into}": f"a.{sent}", f"c.{into}": f"b.{out}"}
    result = run_error_controlled(System(slaves[::order], wires), 1.0)
    assert [result.final[f"{name}.{out}"] for name in "abc"] == [2.0, 2.0, 2.0]
    assert result.t == 1.0
    for name in "abc":
        np.testing.assert_allclose(result.event_times(name), [0.5, 1.0], atol=1e-12, rtol=0)


@pytest.mark.parametrize("version", ["2.0", "3.0", None])
def test_an_event_behind_the_stop_time_by_rounding_is_not_taken(version, slave):
    """3 * 0.1 is above 0.3: the run ends where it is told to (rule 6)."""
    slaves = [slave("a", Beats(), version, period=0.1), slave("b", Relay(), "2.0")]
    result = run_error_controlled(System(slaves, {"b.heard": "a.sent"}), 0.3)
    assert (result.final["a.sent"], result.final["b.sent"]) == (2.0, 2.0)


@pytest.mark.parametrize("source", ["2.0", "3.0"])
@pytest.mark.parametrize("version", ["2.0", "3.0", None])
def test_events_that_a_signal_brings_about_are_listed_where_they_show(source, version, slave):
    slaves = [slave("a", Beats(), source), slave("b", Relay(), version), slave("hidden", Relay(), version)]
    wires = {"b.heard": "a.sent", "hidden.u": "a.sent"}
    result = run_error_controlled(System(slaves, wires), 1.2)
    kinds = {(event.t, event.block): event.kind for event in result.events}
    expected = dict.fromkeys([(0.5, "a"), (1.0, "a")], "seen" if source == "2.0" else "announced")
    expected |= dict.fromkeys([(0.5, "b"), (1.0, "b")], "received")
    if version is None:  # automata tell
        expected |= dict.fromkeys([(0.5, "hidden"), (1.0, "hidden")], "received")
    assert kinds == expected


@pytest.mark.parametrize("engine", ["native", "python"])
def test_the_event_exact_master_lists_what_a_signal_brings_about(engine):
    slaves = [AutomatonSlave("a", Beats(), engine=engine), AutomatonSlave("b", Relay(), engine=engine)]
    result = run_event_exact(System(slaves, {"b.heard": "a.sent"}), 1.2)
    assert [(event.t, event.block, event.kind) for event in result.events] == [
        (0.5, "a", "announced"),
        (0.5, "b", "received"),
        (1.0, "a", "announced"),
        (1.0, "b", "received"),
    ]


@pytest.mark.parametrize(("first", "second"), [("2.0", "2.0"), ("2.0", "3.0"), ("3.0", "2.0"), ("3.0", "3.0")])
@pytest.mark.parametrize("flowing", [True, False])
def test_times_that_differ_by_rounding_are_one_event_with_two_rows(first, second, flowing, slave):
    """3 * 0.7 is below 2.1 by rounding, as are 6 * 0.7 and 9 * 0.7; each of both is there once, with two rows."""
    model, into, out = (Stairs, "u", "y") if flowing else (Beats, "heard", "sent")
    slaves = [slave("a", model(), first, period=0.7), slave("b", model(), second, period=2.1)]
    wires = {f"b.{into}": f"a.{out}", f"a.{into}": f"b.{out}"}
    result = run_error_controlled(System(slaves, wires), 6.5, output_interval=1.0)
    np.testing.assert_allclose(result.event_times("a"), 0.7 * np.arange(1, 10), atol=1e-11, rtol=0)
    np.testing.assert_allclose(result.event_times("b"), 2.1 * np.arange(1, 4), atol=1e-11, rtol=0)
    for t in 2.1 * np.arange(1, 4):
        rows = [k for k, time in enumerate(result.times) if abs(time - t) < 1e-9]
        n, m = round(t / 0.7), round(t / 2.1)
        assert [(result.signals[f"a.{out}"][k], result.signals[f"b.{out}"][k]) for k in rows] == [
            (n - 1, m - 1),
            (n, m),
        ]


@pytest.mark.parametrize(("first", "second"), [("2.0", "2.0"), ("2.0", "3.0"), ("3.0", "2.0")])
def test_stairs_are_enclosed_by_where_their_fmus_have_stopped(first, second, slave):
    """Halving takes some 43 steps of both, each in more than one way; where an FMU has stopped its event is."""
    slaves = [slave("a", Stairs(), first, period=0.5), slave("b", Stairs(), second, period=0.3)]
    result = run_error_controlled(System(slaves, {"b.u": "a.y", "a.u": "b.y"}), 4.0)
    np.testing.assert_allclose(result.event_times("a"), 0.5 * np.arange(1, 9), atol=1e-11, rtol=0)
    np.testing.assert_allclose(result.event_times("b"), 0.3 * np.arange(1, 14), atol=1e-11, rtol=0)
    assert result.steps < 60 * len(result.events)


class Rise(hm.HybridAutomaton):
    """Rises with time, and begins anew at each cue."""

    cue = hm.Input(0.0, discrete=True)
    seen = hm.DiscreteState(0.0)
    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": 1.0}

    transitions = (
        hm.Jump("reset", lambda self, s: (s.cue - s.seen) ** 2 - 0.25, lambda self, s: {"x": 0.0, "seen": s.cue}),
    )


class Warden(hm.HybridAutomaton):
    """Gives a cue when its input has come to one, and is ready again when it is below a half."""

    u = hm.Input(0.0)
    ready = hm.DiscreteState(1.0)
    cue = hm.DiscreteState(0.0, output=True)

    transitions = (
        hm.Jump(
            "give",
            lambda self, s: hm.least(s.u - 1.0, s.ready - 0.5),
            lambda self, s: {"cue": s.cue + 1.0, "ready": 0.0},
        ),
        hm.Jump("rest", lambda self, s: hm.least(0.5 - s.u, 0.5 - s.ready), lambda self, s: {"ready": 1.0}),
    )


@pytest.mark.parametrize("source", ["2.0", "3.0", None])
@pytest.mark.parametrize("warden", ["2.0", "3.0", None])
@pytest.mark.parametrize("order", [1, -1])
def test_a_signal_that_its_receiver_resets_at_the_same_instant(source, warden, order, slave):
    """One cue each second, also where the one that rises foretells that nothing happens until the end."""
    slaves = [slave("a", Rise(), source), slave("b", Warden(), warden)]
    result = run_error_controlled(System(slaves[::order], {"a.cue": "b.cue", "b.u": "a.x"}), 3.5)
    np.testing.assert_allclose(result.event_times("b"), [1.0, 2.0, 3.0], atol=1e-11, rtol=0)
    assert result.final["a.x"] == pytest.approx(0.5, abs=1e-11)


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
