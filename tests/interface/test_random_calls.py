"""Random sequences of calls against a model of the calling rules and a run of the automaton.

The machine keeps by itself which mode an instance must be in and what has been done to it. What is forbidden must be
refused and leave every byte of the state alone; what is read must not matter; and wherever time has passed, the values
must be those of `simulate` with the same inputs, whatever has been saved, restored, moved, reset or refused on the way.
"""

import ctypes as c
import functools
import math
from typing import NamedTuple

import hypothesis
import pytest
from fmi_driver.binary import DISCARD, ERROR, OK, doubles, references
from fmi_driver.calls import TABLE
from fmi_driver.component import Component, Update
from fmi_driver.exchange import Exchange
from fmi_driver.journey import SETTINGS
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)
from witnesses import Mix

import hybrid_model as hm

STATE_TOLERANCE = 1e-8  # the project's limit
NEAR_A_JUMP = 1e-9  # on which side of it a point lies is decided by rounding
LAST = 2.4
LABELS = {**SETTINGS, "3.0 CS watched": SETTINGS["3.0 CS"],
          "3.0 CS watched without events": {"fmi": "3.0", "kind": "cs", "early": True}}  # fmt: skip
READING = [
    # Calls that leave every byte as it is, where they are allowed.
    "SetDebugLogging", "GetFloat64", "GetInt32", "GetBoolean", "GetString", "SetFloat64", "SetInt32", "SetBoolean",
    "GetFMUState", "SerializedFMUStateSize", "SerializeFMUState", "GetDirectionalDerivative", "GetAdjointDerivative",
    "GetOutputDerivatives", "GetRealStatus", "GetBooleanStatus", "GetStatus", "GetContinuousStates",
    "GetContinuousStateDerivatives", "GetEventIndicators", "GetNominalsOfContinuousStates",
    "GetNumberOfContinuousStates", "GetNumberOfEventIndicators", "GetClock", "SetClock",
]  # fmt: skip
OFTEN, SELDOM = st.integers(0, 5).map(bool), st.integers(0, 5).map(lambda k: k == 5)
"""Walks that end too soon find nothing: what ends them is done by one draw in six."""
SHOWN = ["x[1]", "x[2]", "count[1]", "count[2]", "rounds"]


class History(NamedTuple):
    """What a run depends on: its start, changed start values, and inputs as (time, value)."""

    t_start: float
    first: float
    changes: tuple


class Place(NamedTuple):
    """All that the machine knows of an instance."""

    mode: str
    t: float
    update: Update | None
    settled: bool
    pending: bool
    start: float
    history: History


@functools.lru_cache(maxsize=400)
def reference(history):
    """The run that the automaton has by itself."""
    times = [t for t, _ in history.changes]

    def push(t):
        return [0.0, *(value for at, value in history.changes if at <= t)][-1]

    inputs = {"push": hm.Signal(push, sorted(set(times)))} if times else {}
    return hm.simulate(Mix(x=[history.first, 0.3]), LAST + 0.5, t_start=history.t_start, inputs=inputs)


class Calls(RuleBasedStateMachine):
    """Rules for an instance of one setting."""

    label = ""
    load = None

    def __init__(self):
        super().__init__()
        self.setting = LABELS[self.label]
        self.binary = self.load(Mix, self.setting["fmi"])
        self.steps_before_return = math.inf
        self.saved = []  # (pointer, bytes, place)
        self.samples = []
        self.make()

    def make(self):
        options = {key: value for key, value in self.setting.items() if key != "fmi"}
        if "watched" in self.label:
            options["intermediate"] = self.watch
        self.component = Component(self.binary, **options)
        self.component.saved = self.component.save()
        self.component.saved_bytes = self.component.serialize(self.component.saved)
        self.forget_everything()

    def forget_everything(self):
        self.mode, self.t, self.update, self.settled, self.pending = "instantiated", 0.0, None, False, False
        self.start, self.history = 0.0, History(0.0, 0.0, ())

    def place(self):
        return Place(self.mode, self.t, self.update, self.settled, self.pending, self.start, self.history)

    def go_to(self, place):
        self.mode, self.t, self.update, self.settled, self.pending, self.start, self.history = place

    def watch(self, environment, time, set_requested, get_allowed, finished, may_end, asked, end):
        self.steps_before_return -= 1
        if self.steps_before_return <= 0 and may_end:
            asked[0], end[0] = True, time

    @property
    def has_event_mode(self):
        return self.setting["kind"] == "me" or bool(self.setting.get("events"))

    @property
    def moving(self):
        """The mode in which time passes."""
        return "continuous" if self.setting["kind"] == "me" else "step"

    def allowed(self, row):
        case = TABLE[row]
        allowed = self.mode in (case.cs if self.setting["kind"] == "cs" else case.me)
        return allowed and not (row == "EnterEventMode" and not self.has_event_mode)

    def rows(self):
        return [row for row, case in TABLE.items() if case.version in (0, self.binary.version)]

    # From Instantiated to a run.

    @initialize(quick=OFTEN, t_start=st.sampled_from([0.0, 0.0, 1.0]), first=st.sampled_from([0.0, 0.2]))
    def begin(self, quick, t_start, first):
        if quick:
            self.boot(t_start, first)

    @rule(t_start=st.sampled_from([0.0, 0.0, 1.0]), first=st.sampled_from([0.0, 0.2]), now=SELDOM)
    def boot_anew(self, t_start, first, now):
        if now or self.mode in ("instantiated", "initialization", "terminated"):
            self.boot(t_start, first)

    def boot(self, t_start, first):
        """Wherever the instance is: to a run, by the shortest way."""
        if self.mode != "instantiated":
            self.reset()
        self.enter_initialization(t_start)
        self.set_start(first)
        self.exit_initialization()
        if self.mode == "event":
            self.settle_and_leave()

    @precondition(lambda self: self.mode == "instantiated")
    @rule(t_start=st.sampled_from([0.0, 1.0]))
    def enter_initialization(self, t_start):
        assert self.component.enter_initialization(t_start, t_start + 50.0, None) == OK
        self.mode, self.t = "initialization", t_start
        self.start = t_start
        self.history = self.history._replace(t_start=t_start)

    @precondition(lambda self: self.mode in ("instantiated", "initialization"))
    @rule(first=st.sampled_from([0.0, 0.2]))
    def set_start(self, first):
        self.component.set("x[1]", first)
        self.history = self.history._replace(first=first)

    @precondition(lambda self: self.mode == "initialization")
    @rule()
    def exit_initialization(self):
        self.component.do("ExitInitializationMode")
        self.mode = "event" if self.has_event_mode else "step"
        self.update, self.settled, self.pending = None, False, False

    @precondition(lambda self: self.mode == "instantiated" and self.binary.version == 3)
    @rule()
    def configure(self):
        self.component.do("EnterConfigurationMode")
        self.mode = "configuration"
        self.refuse("EnterInitializationMode")
        self.component.do("ExitConfigurationMode")
        self.mode = "instantiated"

    @rule(now=SELDOM)
    def start_anew(self, now):
        if now:
            self.reset()

    def reset(self):
        self.component.do("Reset")
        self.forget_everything()
        assert self.component.bytes() == self.component.saved_bytes, "reset is not as new"

    @precondition(lambda self: self.mode in ("event", "step", "continuous"))
    @rule(now=SELDOM)
    def terminate(self, now):
        if now:
            self.component.do("Terminate")
            self.mode = "terminated"

    # Events.

    @precondition(lambda self: self.mode == "event")
    @rule()
    def update_once(self):
        self.update = self.component.update()
        assert self.update.status == OK
        assert not self.update.terminate
        assert self.update.next_time is None or self.update.next_time > self.t, "an event in the past"
        self.settled = not self.update.again

    @precondition(lambda self: self.mode == "event" and self.settled)
    @rule()
    def leave_event_mode(self):
        self.component.do("EnterStepMode" if self.moving == "step" else "EnterContinuousTimeMode")
        self.mode, self.pending = self.moving, False

    @precondition(lambda self: self.mode == "event")
    @rule()
    def settle_and_leave(self):
        for _ in range(20):
            self.update_once()
            if self.settled:
                return self.leave_event_mode()
        raise AssertionError("20 event iterations")

    @precondition(lambda self: self.mode == self.moving and self.has_event_mode)
    @rule()
    def enter_event_mode(self):
        self.component.do("EnterEventMode")
        self.mode, self.settled = "event", False

    # Time.

    @rule(n=st.integers(1, 4), h=st.sampled_from([0.01, 0.07, 0.2, 0.41]), short=st.sampled_from([0.0, 1e-10]))
    def advance(self, n, h, short=0.0):
        """So many communication steps, with the events that come up; `short` of them, who integrates stops."""
        if self.mode == "event":
            self.settle_and_leave()
        if self.mode != self.moving:
            return
        for _ in range(n):
            target = self.t + h
            if target > LAST:
                return
            if self.moving == "continuous":
                self.integrate(target, short)
            for _ in range(200):
                if self.t >= target:
                    break
                self.step_once(target - self.t)
                if self.pending:
                    self.enter_event_mode()
                    self.settle_and_leave()
            assert self.t >= target, "no progress"
            self.look()

    @rule()
    def go_on(self):
        """A walk has to get somewhere."""
        if self.mode not in ("event", self.moving):
            self.boot(0.0, 0.0)
        self.advance(2, 0.07)

    @rule(h=st.sampled_from([0.013, 0.11]))
    def go_on_a_little(self, h):
        self.advance(1, h)

    def integrate(self, target, short):
        exchange = Exchange(self.component, short=short)
        record = exchange.run([self.t, target], self.update)
        assert not record.ended
        self.t, self.update = exchange.t, exchange.update

    @precondition(lambda self: self.mode == "step" and self.t < LAST)
    @rule(h=st.sampled_from([0.02, 0.3]), returning=st.sampled_from([math.inf, math.inf, 1, 3]))
    def single_step(self, h, returning):
        self.steps_before_return = returning
        self.step_once(h)
        self.steps_before_return = math.inf

    def step_once(self, h):
        found = self.component.step(self.t, h)
        assert found.status == OK, self.component.log[-2:]
        assert not found.terminate
        assert self.t <= found.time <= self.t + h
        assert found.early == (found.time < self.t + h)
        assert not found.early or self.setting.get("early")
        assert found.event or found.time > self.t
        assert not found.event or self.setting.get("events")
        self.t, self.pending = found.time, found.event

    @precondition(lambda self: self.mode in ("initialization", "event", "step", "continuous"))
    @rule(push=st.sampled_from([0.0, 0.3, -0.2]))
    def set_input(self, push):
        self.component.set("push", push)
        changes = tuple(change for change in self.history.changes if change[0] < self.t)
        self.history = self.history._replace(changes=(*changes, (self.t, push)))
        self.settled = False

    # What must not matter.

    @rule(data=st.data())
    def forbidden(self, data):
        self.refuse(data.draw(st.sampled_from([row for row in self.rows() if not self.allowed(row)])))

    def refuse(self, row):
        before = self.component.bytes()
        self.component.log.clear()
        assert self.component.call(row.strip(), *TABLE[row].arguments(self.component)) == ERROR
        self.check_refusal(row.strip(), before)

    def check_refusal(self, name, before):
        [line] = self.component.log
        assert (line.status, line.category) == (ERROR, "logStatusError")
        assert self.binary.function(name) in line.text
        assert self.component.bytes() == before
        self.component.log.clear()

    @rule(data=st.data())
    def reading(self, data):
        rows = [row for row in READING if row in self.rows() and self.allowed(row)]
        row = data.draw(st.sampled_from(rows))
        before = self.component.bytes()
        found = self.component.call(row, *TABLE[row].arguments(self.component))
        assert found == TABLE[row].status
        self.component.values()
        assert self.component.bytes() == before
        self.component.log.clear()

    @rule(
        name=st.sampled_from(["push", "x[1]", "drive[2]", "total", "time", "none"]),
        value=st.sampled_from([math.nan, math.inf, -math.inf, None]),
        room=st.sampled_from([0, 1, 2, 2**31]),
        function=st.sampled_from(["Get", "Set"]),
    )
    def bad_access(self, name, value, room, function):
        """Numbers that are none, references to nothing, wrong counts, null pointers."""
        number = 2**32 - 1
        if name != "none":
            number = self.binary.reference(self.binary.elements[name][0])
        correct = name != "none" and room == math.prod(self.binary.variables[self.binary.elements[name][0]].shape or ())
        if self.binary.version == 2:
            correct = name != "none"
        if correct and function == "Get":
            value = None
        array = None if value is None else doubles([value] * 2)
        more = () if self.binary.version == 2 else (c.c_size_t(room),)
        before = self.component.bytes()
        self.component.log.clear()
        function = f"{function}Float64"
        status = self.component.call(function, references([number]), c.c_size_t(1), array, *more)
        assert status == ERROR
        self.check_refusal(function, before)

    @precondition(lambda self: self.mode == "step")
    @rule(
        gap=st.sampled_from([0.0, 0.0, 0.1, -0.1, math.nan, math.inf]),
        h=st.sampled_from([0.0, -0.1, math.nan, math.inf, -math.inf, 1e308, 60.0, 0.1]),
    )
    def bad_step(self, gap, h):
        if (gap, h) == (0.0, 0.1):
            return
        before = self.component.bytes()
        self.component.log.clear()
        assert self.component.step(self.t + gap, h).status == ERROR
        self.check_refusal("DoStep", before)

    @precondition(lambda self: self.mode == "continuous")
    @rule(value=st.sampled_from([math.nan, math.inf, -math.inf]), n=st.sampled_from([0, 1, 3, 2**40]))
    def bad_states(self, value, n):
        before = self.component.bytes()
        for function, arguments in (
            ("SetTime", (c.c_double(value),)),
            ("SetContinuousStates", (doubles([0.1, value]), c.c_size_t(2))),
            ("SetContinuousStates", (doubles([0.1, 0.2, 0.3]), c.c_size_t(n))),
            ("SetContinuousStates", (None, c.c_size_t(2))),
        ):
            self.component.log.clear()
            assert self.component.call(function, *arguments) == ERROR
            self.check_refusal(function, before)

    @precondition(lambda self: self.mode == self.moving and self.t > 0.0)
    @rule(push=st.sampled_from([1e308, -1e308, 1e200, 5e-324, -0.0]))
    def extreme(self, push):
        """There and back: whatever comes of it, the state from before is as good as ever.

        Not at t = 0: floats lie so close there that an FMU takes jumps for minutes until its budget is used up.
        """
        pointer = self.component.save()
        before = self.component.serialize(pointer)
        self.component.set("push", push)
        if self.moving == "step":
            assert self.component.step(self.t, 0.1).status in (OK, DISCARD, ERROR)
        else:
            assert self.component.vector("GetContinuousStateDerivatives", 2)[0] in (OK, DISCARD)
            assert self.component.completed()[0] == OK
        for name in ("x", "total"):
            for element in [e for e, (whole, _) in self.binary.elements.items() if whole.partition("[")[0] == name]:
                whole, index = self.binary.elements[element]
                status, values = self.component.whole("Get", whole)
                assert math.isfinite(values[index]) if status == OK else status == ERROR
        self.component.load(pointer)
        self.component.forget(pointer)
        self.component.log.clear()
        assert self.component.bytes() == before

    # Saved states.

    @rule(data=st.data())
    def save(self, data):
        """Into a new state, or over one that there is."""
        old = data.draw(st.integers(-2, len(self.saved) - 1)) if self.saved else -1
        pointer = self.component.save(self.saved.pop(old)[0] if old >= 0 else None)
        self.saved.append((pointer, self.component.serialize(pointer), self.place()))
        if len(self.saved) > 4:
            self.component.forget(self.saved.pop(0)[0])

    @precondition(lambda self: self.saved)
    @rule(data=st.data())
    def restore(self, data):
        pointer, content, place = data.draw(st.sampled_from(self.saved))
        assert self.component.serialize(pointer) == content, "a saved state has changed"
        self.component.load(pointer)
        self.go_to(place)
        assert self.component.bytes() == content

    @precondition(lambda self: self.saved)
    @rule(data=st.data())
    def free_a_state(self, data):
        pointer, _, _ = self.saved.pop(data.draw(st.integers(0, len(self.saved) - 1)))
        for _ in range(2):
            self.component.forget(pointer)
            assert pointer.value is None
        self.component.do("FreeFMUState", None)

    @rule()
    def move(self):
        """To a new instance, by bytes; so go the saved states."""
        now = self.component.bytes()
        old, place = self.component, self.place()
        contents = [(content, place) for _, content, place in self.saved]
        for pointer, _, _ in self.saved:
            old.forget(pointer)
        self.make()
        self.saved = []
        for content, at in contents:
            status, pointer = self.component.deserialize(content)
            assert status == OK
            self.saved.append((pointer, content, at))
        status, pointer = self.component.deserialize(now)
        assert status == OK
        old.forget(old.saved)
        old.free()
        self.component.load(pointer)
        self.component.forget(pointer)
        self.go_to(place)
        assert self.component.bytes() == now

    @rule(at=st.integers(0), bit=st.integers(0, 7), cut=st.integers(1, 4000))
    def damaged(self, at, bit, cut):
        before = self.component.bytes()
        flipped = bytearray(before)
        flipped[at % len(flipped)] ^= 1 << bit
        for data in (bytes(flipped), before[: max(0, len(before) - cut)], before + b"\0" * cut):
            self.component.log.clear()
            status, pointer = self.component.deserialize(data)
            assert (status, pointer.value) == (ERROR, None)
            self.check_refusal("DeserializeFMUState", before)

    # The oracle.

    @invariant()
    def look(self):
        """Values are those of the automaton; compared at once, so that a failing walk is short."""
        if self.mode not in ("step", "continuous") or self.pending:
            return
        get = self.component.get
        assert get("time") == self.t
        x = [get(name) for name in SHOWN]
        push = self.history.changes[-1][1] if self.history.changes else 0.0
        assert get("push") == push
        arc = reference(self.history)
        if any(abs(jump.t - self.t) < NEAR_A_JUMP for jump in arc.jumps):
            return
        assert get("total") == x[0] * x[1] + push + self.t
        expected = [*arc.at("x", [self.t])[0], *arc.at("count", [self.t])[0], arc.at("rounds", [self.t])[0]]
        for name, value, wanted in zip(SHOWN, x, expected, strict=True):
            assert abs(value - wanted) < STATE_TOLERANCE, (name, self.t, value, wanted)

    def teardown(self):
        for pointer, _, _ in self.saved:
            self.component.forget(pointer)
        self.component.forget(self.component.saved)
        self.component.free()


def run(label, binary, examples, steps, **options):
    machine = type("Machine", (Calls,), {"label": label, "load": staticmethod(binary)})
    run_state_machine_as_test(
        machine,
        settings=hypothesis.settings(
            max_examples=examples,
            stateful_step_count=steps,
            deadline=None,
            suppress_health_check=list(hypothesis.HealthCheck),
            **options,
        ),
    )


@pytest.mark.parametrize("label", LABELS)
def test_random_calls(label, binary):
    run(label, binary, 16, 25)


@pytest.mark.long
@pytest.mark.parametrize("label", LABELS)
def test_many_random_calls(label, binary):
    run(label, binary, 200, 40)
