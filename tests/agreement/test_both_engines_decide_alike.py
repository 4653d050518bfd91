"""Rules that the engine in Python and the engine in C decide each by itself: the same model ends alike in both."""

import re
from pathlib import Path

import numpy as np
import pytest
from small_automata import Ramp
from witnesses import FlowFirst

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.errors import CosimError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact
from cosim.result import Ended
from cosim.system import System
from hybrid_model import scales
from hybrid_model.models import BouncingBall
from hybrid_model.reference.zeno import GAPS


def run_fmu(exported, automaton, t_end, *, t_start=0.0):
    """The engine in C, event by event."""
    path = exported(automaton, f"alike_{automaton.name}")
    return run_event_exact(System([FmuSlave("a", path)], {}), t_end, t_start=t_start)


class AlmostTogether(hm.HybridAutomaton):
    """Two time events some thousand ulp apart, but less than an ulp of 1 s; the later one is declared first."""

    order = hm.DiscreteState(0, integer=True, output=True)
    late = hm.DiscreteState(0, integer=True)
    early = hm.DiscreteState(0, integer=True)

    transitions = (
        hm.TimeEvent(
            "late",
            lambda self, s: np.where(s.late < 1, 0.001 + 1e-15, np.inf),
            lambda self, s: {"order": 10 * s.order + 2, "late": 1},
        ),
        hm.TimeEvent(
            "early",
            lambda self, s: np.where(s.early < 1, 0.001, np.inf),
            lambda self, s: {"order": 10 * s.order + 1, "early": 1},
        ),
    )


def test_time_events_are_one_time_by_ulps_of_their_own_size(exported):
    arc = hm.simulate(AlmostTogether(), 0.002)
    assert [(jump.name, jump.t) for jump in arc.jumps] == [("early", 0.001), ("late", 0.001 + 1e-15)]
    assert arc.end.order == run_fmu(exported, AlmostTogether(), 0.002).final["a.order"] == 12


class Halves(hm.HybridAutomaton):
    """An integer that a jump makes a fraction."""

    k = hm.DiscreteState(1, integer=True, output=True)
    more = hm.Parameter(0.5)

    transitions = (hm.TimeEvent("tick", lambda self, s: 1.0 * s.k, lambda self, s: {"k": s.k + s.more}),)


class Still(hm.HybridAutomaton):
    """A time event whose jump leaves its time as it is."""

    k = hm.DiscreteState(0, integer=True, output=True)

    transitions = (hm.TimeEvent("tick", lambda self, s: 1.0 + 0.0 * s.k, lambda self, s: {"k": s.k + 1}),)


class StillInside(Still):
    """The same as a breakpoint of the flow."""

    transitions = (
        hm.TimeEvent("tick", lambda self, s: 1.0 + 0.0 * s.k, lambda self, s: {"k": s.k + 1}, internal=True),
    )


class YesOrNo(hm.HybridAutomaton):
    """A flow set that is 1 inside and 0 outside: as a margin it is never left."""

    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": 1.0}

    def flow_set(self, s):
        return np.where(s.x <= 1.0, 1.0, 0.0)


class YesOrNoJump(hm.HybridAutomaton):
    """Under flow priority a jump set of 0 and 1, which is looked at although the flow goes on."""

    priority = hm.Priority.FLOW
    x = hm.State(0.0, output=True)

    def flow_map(self, s):
        return {"x": 1.0}

    def flow_set(self, s):
        return 3.0 - s.x

    def jump_set(self, s):
        return np.where(s.x >= 1.0, 1.0, 0.0)

    def jump_map(self, s):
        return {"x": 0.0}


@pytest.mark.parametrize(
    ("automaton", "words"),
    [
        (Halves(name="Rounded", more=2.0**-40), ["k", f"{1 + 2**-40:.17g}", "t = 1 ", "must stay a whole number"]),
        (Halves(name="Long", more=3e9), ["k", "3000000001", "t = 1 ", "whole number from -2147483648 to 2147483647"]),
        (Halves(), ["k", "1.5", "t = 1 ", "tick", "declared integer and must stay a whole number"]),
        (Still(), ["time event 'tick' was due at 1 s and after its jump is due at 1 s", "move its time on"]),
        (StillInside(), ["time event 'tick' was due at 1 s and after its jump is due at 1 s", "move its time on"]),
        (YesOrNo(), ["margin of the flow set", "is 0 or 1 along the flow", "as if it said no or yes"]),
        (YesOrNoJump(), ["margin of jump 'jump' is 0 or 1 along the flow", "as if it said no or yes"]),
    ],
    ids=lambda given: given.name if isinstance(given, hm.HybridAutomaton) else "",
)
def test_what_a_model_must_not_do_is_refused(automaton, words, exported):
    with pytest.raises(hm.SimulationError) as refused:
        hm.simulate(automaton, 2.5)
    result = run_fmu(exported, automaton, 2.5)
    assert result.ended is Ended.TERMINATED
    for word in words:
        assert word in str(refused.value)
        assert word in result.message


def test_integers_have_32_bits(exported):
    arc = hm.simulate(Halves(name="Longest", more=2.0**31 - 2), 2.0)
    assert arc.end.k == run_fmu(exported, Halves(name="Longest", more=2.0**31 - 2), 2.0).final["a.k"] == 2**31 - 1


class HalfStart(hm.HybridAutomaton):
    """An integer whose computed start value is a fraction."""

    p = hm.Parameter(0.5)
    k = hm.DiscreteState(integer=True, computed=True, output=True)

    def start_map(self, s):
        return {"k": s.p}


def test_a_computed_start_value_of_an_integer_is_whole(exported):
    with pytest.raises(hm.SimulationError, match=r"k = 0.5 at the start: it is declared integer"):
        hm.simulate(HalfStart(), 1.0)
    with pytest.raises(CosimError, match=r"k = 0\.5 at the start: it is declared integer"):
        run_fmu(exported, HalfStart(), 1.0)


class Catching(hm.HybridAutomaton):
    """A timer with ticks that are due before the run begins."""

    behind = hm.Parameter(0.0)
    k = hm.DiscreteState(0, integer=True, output=True)

    def next_time(self, s):
        return 1e-3 * (s.k + 1.0 - s.behind)

    def tick(self, s):
        return {"k": s.k + 1}

    transitions = (hm.TimeEvent("tick", next_time, tick),)


class CatchingInside(Catching):
    """The same as breakpoints of the flow."""

    transitions = (hm.TimeEvent("tick", Catching.next_time, Catching.tick, internal=True),)


@pytest.mark.parametrize("kind", [Catching, CatchingInside])
@pytest.mark.parametrize(("first", "second"), [(1000, 0), (700, 700), (1001, 0), (0, 1001)])
def test_each_jump_at_one_instant_is_counted_by_itself(kind, first, second, exported):
    both = hm.Composition(f"{kind.__name__}{first}_{second}", {"a": kind(behind=first), "b": kind(behind=second)})
    arc = hm.simulate(both, 0.5e-3)
    if max(first, second) <= 1000:
        assert arc.stop is hm.Stop.HORIZON
        assert run_fmu(exported, both, 0.5e-3).final == {"a.a.k": first, "a.b.k": second}
        return
    told = f"1001 jumps of '{'a' if first else 'b'}.tick' at one instant, t = 0 s: its time is still not after"
    assert arc.stop is hm.Stop.ZENO
    assert told in arc.message
    try:
        message = run_fmu(exported, both, 0.5e-3).message
    except CosimError as refused:  # breakpoints are taken when initialization ends
        message = str(refused)
    assert f"Zeno: {told}" in message


class Chatter(Ramp):
    """Jumps 9 ulp of 1 s apart."""

    heard = hm.Clock("moved")


class TwoJumpsAnImpact(BouncingBall):
    """Each impact is a cascade of two jumps of one name."""

    half = hm.DiscreteState(0, integer=True)

    def jump_set(self, s):
        return hm.greatest(hm.least(-s.h, -s.v), s.half - 0.5)

    def jump_map(self, s):
        return {"h": 0.0, "v": np.where(s.half < 0.5, s.v, -s.e * s.v), "half": 1 - s.half}


@pytest.mark.parametrize(
    ("automaton", "t_start"), [(Chatter(threshold=2e-15), 1.0), (TwoJumpsAnImpact(), 0.0), (BouncingBall(e=0.8), 0.0)]
)
def test_an_accumulation_is_seen_at_the_same_jump(automaton, t_start, exported):
    arc = hm.simulate(automaton, t_start + 5.0, t_start=t_start)
    result = run_fmu(exported, automaton, t_start + 5.0, t_start=t_start)
    assert arc.stop is hm.Stop.ZENO
    assert result.ended is Ended.ZENO
    assert len(result.ticks) == len(arc.jumps)


def test_only_a_record_bounds_the_number_of_jumps_of_a_run(exported):
    """A block of a co-simulation is not recorded: it goes on beyond `max_jumps`, as its FMU does."""
    late = Catching(behind=0)

    class After(AutomatonSlave):
        def start(self, t_start, t_stop, **options):
            super().start(t_start, t_stop, **options)
            self._running.run.j = hm.ZenoGuard().max_jumps

    assert hm.simulate(late, 5.5e-3, zeno=hm.ZenoGuard(max_jumps=3)).stop is hm.Stop.JUMPS
    result = run_event_exact(System([After("a", late, engine="python")], {}), 5.5e-3)
    assert result.ended is Ended.HORIZON
    assert result.final == run_fmu(exported, late, 5.5e-3).final == {"a.k": 5}


def test_models_carry_every_number_that_the_engine_in_c_reads():
    """A name that one side lacks would be a zero in C."""
    folder = Path(hm.__file__).parent / "engine"
    engine = "\n".join(file.read_text(encoding="utf-8") for file in sorted(folder.rglob("*.h")))
    fields = re.search(r"typedef struct \{([^}]*)\} ModelScales;", engine)[1]
    names = re.findall(r"(\w+)(?:\[\w+\])?[,;]", fields)
    assert sorted(names) == sorted(scales.of_models())
    assert int(re.search(r"#define N_REACH_AT (\d+)", engine)[1]) == len(scales.REACH_AT)
    assert int(re.search(r"#define N_GAPS (\d+)", engine)[1]) == GAPS


class Nominal(FlowFirst):
    """Tells the size of its state, which the run has not shown at the start."""

    x = hm.State(0.0, nominal=1.0, output=True)


@pytest.mark.parametrize(
    ("kind", "t_stop"),
    [
        *((FlowFirst, t_stop) for t_stop in (None, 5.5, 1e6, 1e9, 1e12)),
        *((Nominal, t_stop) for t_stop in (None, 5.5, 1e12, 1e15, 1e18)),
    ],
)
def test_a_distant_end_or_none_changes_nothing_at_a_border(exported, kind, t_stop):
    """At the start x = 0 has shown no size: what the end of the run makes of its steps must not hide where it goes."""
    turns = [1.0, 2.0, 3.0, 4.0, 5.0]
    if t_stop is not None:
        arc = hm.simulate(kind(), t_stop, zeno=hm.ZenoGuard(max_jumps=5))
        assert [jump.t for jump in arc.jumps[:5]] == pytest.approx(turns, abs=1e-12)
    slave = FmuSlave("a", exported(kind(), f"distant_end_{kind.__name__}"))
    slave.start(0.0, t_stop, events=False)
    slave.begin()
    made = slave.step(0.0, 5.4)
    assert made.reached == 5.4
    assert slave.get("turns") == 5
    slave.close()


MARGINS = {
    "square": lambda x: (1.0 + x) ** 2 - 1.0 - x,
    "exponential": lambda x: np.exp(x) - 1.0 - x / 2,
    "root": lambda x: np.sqrt((1.0 + x) ** 2 + 1.0) - np.sqrt(2.0) - x / 2,
}


@pytest.mark.parametrize("kind", MARGINS)
@pytest.mark.parametrize("t_end", [1.0, 1e6])
def test_a_margin_whose_terms_cancel_at_the_start_rises_all_the_same(exported, kind, t_end):
    """A very short look ahead sees nothing of a term beside one, and would take the rest for the whole."""

    class Rising(hm.HybridAutomaton):
        x = hm.State(0.0, output=True)
        rate = hm.Parameter(1.0)
        jumped = hm.DiscreteState(0, integer=True, output=True)
        priority = hm.Priority.FLOW

        def flow_map(self, s):
            return {"x": s.rate}

        def flow_set(self, s):
            return MARGINS[kind](s.x)

        def jump_set(self, s):
            return 1.0 + 0.0 * s.x

        def jump_map(self, s):
            return {"jumped": s.jumped + 1}

    automaton = Rising(name=f"Rising_{kind}", rate=1.0 / t_end)
    assert hm.simulate(automaton, t_end).jumps == []
    assert run_fmu(exported, automaton, t_end).final["a.jumped"] == 0
