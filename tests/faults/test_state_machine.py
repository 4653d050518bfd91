"""The state machine of both versions and kinds at random, under the sanitizers, with values that are known.

Hypothesis chooses calls, legal and illegal.  A model of the standard's modes says which of them succeed; the values are
those of the run in Python, whatever was called on the way.  The rule `boot` brings an instance back into a run from
wherever it is: without it most walks would end in Terminated, where little can be seen.
"""

import math
from typing import ClassVar

import pytest
from c_checks_rules import next_mode
from c_harness import NONE, Harness, Instance, generated
from c_runs import STATE_TOLERANCE, Exchange, step_to, watched
from c_witnesses import WITNESSES
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

import hybrid_model as hm

pytestmark = pytest.mark.faults
STEP = 0.05
CALLS = ("end", "event", "step", "continuous", "terminate", "reset", "configure", "configured", "evaluate", "cancel")
WRONG = (0.0, -0.1, math.nan, math.inf, -math.inf)
USES = {"2.0 CS": ("2.0", "cs", True), "2.0 ME": ("2.0", "me", True), "3.0 ME": ("3.0", "me", True)}
USES |= {"3.0 CS": ("3.0", "cs", True), "3.0 CS without events": ("3.0", "cs", False)}


class Importer(RuleBasedStateMachine):
    """One instance at a time; `k` counts the steps of its run, `t_over` is where the model's run ends."""

    program: ClassVar = None
    use: ClassVar = ("3.0", "cs", True)
    witness: ClassVar = WITNESSES["ball"]
    arc: ClassVar = None

    def __init__(self):
        super().__init__()
        self.fmi, self.kind, self.events = self.use
        variables = generated(self.witness.automaton, self.fmi)[1]
        self.harness = Harness(self.program, variables, time_limit=20.0)
        self.names = watched(self.harness)
        self.saved, self.bytes = {}, None
        self.instance = self.exchange = None
        self.new()

    def teardown(self):
        self.harness.ask("free", 0)
        # Saved states need an instance to be given back.
        last = Instance(self.harness, kind=self.kind)
        for slot in list(self.saved):
            last.do("drop", slot)
        last.free()
        living, _ = self.harness.ask("memory")
        self.harness.close()
        assert living == "0"

    # The model of the standard.

    def new(self):
        if self.kind == "me":
            self.exchange = Exchange(self.harness, self.witness)
            self.instance = self.exchange.instance
        else:
            self.instance = Instance(self.harness, kind=self.kind, events=self.events)
        self.mode, self.k = "instantiated", 0

    @property
    def t(self):
        return STEP * self.k

    def begin(self):
        self.instance.begin()
        self.mode, self.k = "initialization", 0
        if self.exchange:
            self.exchange.t = 0.0

    def plain(self, call):
        to = next_mode(call, self.mode, self.fmi, self.kind, self.events)
        status, _ = self.instance.call("plain", call)
        if status == -1:
            return
        assert status == (3 if to is None else 0), (self.mode, call)
        if to is not None:
            if call == "reset":
                self.k = 0
            if to == "continuous":
                self.exchange.read_states()
            self.mode = to

    def settle(self):
        """Out of Event Mode, all updates done."""
        if self.mode == "event" and self.exchange:
            self.exchange.settle()
            self.mode = "continuous"
        elif self.mode == "event":
            self.instance.iterate()
            self.mode = "step"

    # Legal ways.

    @rule()
    def boot(self):
        self.plain("reset")
        self.begin()
        self.plain("end")
        self.settle()

    @precondition(lambda self: self.mode in ("event", "step", "continuous"))
    @rule(n=st.integers(1, 12))
    def advance(self, n):
        """On through the run, up to shortly before the impacts accumulate."""
        self.settle()
        for _ in range(n):
            if self.t >= 2.25:
                return
            if self.exchange:
                self.exchange.advance(STEP * (self.k + 1))
            else:
                step_to(self.instance, self.t, STEP * (self.k + 1), self.events and self.fmi == "3.0")
            self.k += 1

    @precondition(lambda self: self.mode == "event")
    @rule()
    def update(self):
        again, terminate, _, time = self.instance.update()
        assert not terminate
        assert time is None or time >= self.t
        if self.exchange and not again:
            self.exchange.next = time

    @rule(call=st.sampled_from(CALLS))
    def any_plain_call(self, call):
        self.plain(call)

    @rule()
    def begin_in_any_mode(self):
        if self.mode == "instantiated":
            self.begin()
        else:
            assert self.instance.call("begin", 0.0, NONE, NONE)[0] == 3

    @rule(kept=st.booleans())
    def free(self, kept):
        """States that were saved outlive the instance."""
        if not kept:
            for slot in list(self.saved):
                self.instance.do("drop", slot)
            self.saved = {}
        self.instance.free()
        self.new()

    # Saved states.

    @rule(slot=st.integers(0, 3))
    def save(self, slot):
        self.instance.do("save", slot)
        place = (self.exchange.t, self.exchange.next, self.exchange.x.copy()) if self.exchange else None
        self.saved[slot] = (self.mode, self.k, self.instance.values(), place)

    @rule(slot=st.integers(0, 3))
    def load(self, slot):
        if slot not in self.saved:
            assert self.instance.call("load", slot)[0] == 3
            return
        self.instance.do("load", slot)
        self.mode, self.k, values, place = self.saved[slot]
        assert self.instance.values() == values
        if place:
            self.exchange.t, self.exchange.next, self.exchange.x = place[0], place[1], place[2].copy()

    @rule(slot=st.integers(0, 3))
    def drop(self, slot):
        self.instance.do("drop", slot)
        self.saved.pop(slot, None)

    @precondition(lambda self: self.saved)
    @rule(to=st.integers(0, 3), place=st.integers(0, 1 << 16), mask=st.integers(0, 255), cut=st.integers(0, 3))
    def through_bytes(self, to, place, mask, cut):
        """A state that goes through bytes is the same; bytes that are changed or cut are no state."""
        slot = min(self.saved)
        self.instance.do("bytes", slot)
        [data] = self.harness.ask("showbytes")
        wrong = bytearray.fromhex(data)
        wrong[place % len(wrong)] ^= mask
        wrong = wrong[: len(wrong) - cut]
        self.harness.ask("givebytes", wrong.hex())
        status, _ = self.instance.call("parse", to)
        assert (status == 0) == (mask == 0 and cut == 0)
        if status == 0:
            self.saved[to] = self.saved[slot]

    # What is refused, or changes nothing.

    @rule()
    def nulls(self):
        self.instance.call("nulls")

    @rule(name=st.sampled_from(["h", "v", "g", "time", "der(v)"]), value=st.sampled_from([math.nan, math.inf, 1.0]))
    def set_what_must_not_be(self, name, value):
        # An importer that integrates may set states by their names as well.
        may = self.mode in ("instantiated", "initialization", *(["continuous"] if name in ("h", "v") else []))
        if not math.isfinite(value) or not may or name in ("time", "der(v)"):
            assert self.instance.call("set", self.harness.places[name], value)[0] == 3

    @rule(size=st.sampled_from(WRONG), gap=st.sampled_from((0.0, 1e-3, -1e-3, math.nan, math.inf)))
    def wrong_step(self, size, gap):
        assert self.instance.call("step", self.t + gap, size)[0] == 3
        if gap != 0.0:
            assert self.instance.call("step", self.t + gap, STEP)[0] == 3

    @rule(reference=st.integers(0, 60), known=st.integers(0, 60), forward=st.booleans())
    def derivatives(self, reference, known, forward):
        status, _ = self.instance.call("partial", forward, reference, known)
        assert status in (-1, 0, 3)
        assert status != 0 or self.mode not in ("instantiated", "configuration")

    @rule(clock=st.integers(0, 20))
    def others(self, clock):
        self.instance.call("rates")
        self.instance.call("interval", clock)
        self.instance.call("completed") if self.mode != "continuous" else None
        self.instance.call("vector", "indicators", 2)
        self.instance.call("debug", True, b"logEvents".hex())
        self.instance.call("get", 5000 + clock)

    @invariant()
    def values_are_those_of_the_run(self):
        if self.mode not in ("step", "continuous", "event", "terminated"):
            return
        for name in self.names:
            value = self.instance.get(name)
            assert abs(value - float(self.arc.at(name, self.t))) <= STATE_TOLERANCE, (name, self.t, value)
        # The log does not grow without end.
        self.instance.log()


@pytest.mark.parametrize("use", USES)
def test_any_calls(use, builder):
    witness = WITNESSES["ball"]
    program = builder.build(witness.automaton, USES[use][0], "addresses")
    arc = hm.simulate(witness.automaton, 2.3)
    members = {"program": program, "use": USES[use], "arc": arc}
    machine = type(f"Importer {use}", (Importer,), members)
    run_state_machine_as_test(
        machine,
        settings=settings(
            max_examples=60,
            stateful_step_count=40,
            deadline=None,
            suppress_health_check=list(HealthCheck),
        ),
    )
