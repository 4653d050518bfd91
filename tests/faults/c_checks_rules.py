"""What must hold of states that are saved, of the calling rules, and of values, in the C harness.

As in c_checks_runs.py, each check takes `start(automaton, fmi)`, which gives a harness.
"""

import itertools
import math
import random
import struct

from c_harness import NONE, VERSIONS, Instance
from c_runs import MODES, go_to_mode, has_mode, only, step_to
from c_witnesses import WITNESSES
from witnesses import Ramps

import hybrid_model as hm
from fmu.describe.variables import Bank
from hybrid_model.models import BouncingBall

TESTED = ("ball", "ramps", "timers", "mix", "flow_first")


def walk(instance, fmi, t, rng, n, inputs):
    """Steps of random lengths, some with an input that is set; all that can be seen after each, and the last time."""
    seen, events = [], fmi == "3.0" and instance.events
    for _ in range(n):
        if inputs and rng.random() < 0.3:
            if events:
                instance.do("plain", "event")
            instance.set(rng.choice(inputs), rng.uniform(-0.1, 1.0))
            if events:
                instance.iterate()
        target = t + rng.choice([1e-3, 0.02, 0.02, 0.11, 0.2])
        step_to(instance, t, target, events)
        t = target
        seen.append(instance.values())
    return seen, t


def check_branches(start):
    """From any point a run can be gone on from twice, in the same instance and in another, bit for bit."""
    for name, fmi, events in itertools.product(TESTED, VERSIONS, (True, False)):
        automaton = WITNESSES[name].automaton
        inputs = [name for name in ("command", "push") if any(v.name == name for v in automaton.variables)]
        harness = start(automaton, fmi)
        for seed in range(4):
            rng = random.Random(seed)
            first = Instance(harness, 0, events=events)
            first.boot()
            if events and fmi == "3.0":
                first.iterate()
            _, t = walk(first, fmi, 0.0, rng, 1 + 3 * seed, inputs)
            # No more than two seconds in all: the ball comes to rest then.
            first.do("save", 0)
            at = first.values()
            ahead = random.Random(seed)
            once, _ = walk(first, fmi, t, ahead, 8, inputs)
            first.do("load", 0)
            assert first.values() == at
            twice, _ = walk(first, fmi, t, random.Random(seed), 8, inputs)
            assert twice == once, (name, fmi, events, seed)
            first.do("bytes", 0)
            other = Instance(harness, 1, events=events)
            # Nothing of the other's own is left.
            parameter = next(v for v in harness.variables if v.bank is Bank.PARAMETER)
            other.set(parameter.name, [5.0] * parameter.size)
            other.do("parse", 1)
            other.do("load", 1)
            assert other.values() == at
            elsewhere, _ = walk(other, fmi, t, random.Random(seed), 8, inputs)
            assert elsewhere == once, (name, fmi, events, seed)
            other.do("bytes", 0)
            before = harness.ask("showbytes")
            other.do("save", 2)
            other.do("load", 1)
            other.do("save", 2)
            other.do("bytes", 2)
            assert harness.ask("showbytes") == before
            for slot in (0, 1, 2):
                other.do("drop", slot)
            first.free()
            other.free()


def check_reset(start):
    """Whatever was done before, a reset makes an instance like new."""
    for name, fmi in itertools.product(("ball", "mix", "timers"), VERSIONS):
        harness = start(WITNESSES[name].automaton, fmi)
        fresh = Instance(harness, 0)
        new = fresh.values()
        for kind, mode in itertools.product(("cs", "me"), MODES):
            if not has_mode(mode, fmi, kind):
                continue
            used = Instance(harness, 1, kind=kind)
            go_to_mode(used, mode, fmi)
            if mode == "step":
                used.do("step", 0.0, 0.9)
            used.do("plain", "reset")
            assert used.values() == new, (name, kind, mode)
            if kind == "cs":
                used.do("save", 0)
                used.do("bytes", 0)
                again = harness.ask("showbytes")
                fresh.do("save", 1)
                fresh.do("bytes", 1)
                assert harness.ask("showbytes") == again
            used.free()
        for slot in (0, 1):
            fresh.do("drop", slot)
        fresh.free()


def check_zeno_is_forgotten(start):
    """After an accumulation, a reset and an earlier state begin anew."""
    harness = start(BouncingBall(), "3.0")
    instance = Instance(harness, events=False, early=False)
    for _ in range(2):
        instance.boot()
        instance.step(0.0, 1.0)
        instance.do("save", 0)
        instance.step(1.0, 0.5)
        after = instance.values()
        assert instance.step(1.5, 2.0)[1]
        assert instance.call("step", 3.5, 0.1)[0] == 3
        instance.do("load", 0)
        assert not instance.step(1.0, 0.5)[1]
        assert instance.values() == after
        instance.do("plain", "reset")


def sum_of(data):
    """FNV-1a, as the runtime has it."""
    total = 14695981039346656037
    for byte in data:
        total = (total ^ byte) * 1099511628211 % 2**64
    return total


def signed(data, body):
    """The bytes of a saved state with another body, and the checksum of that."""
    return data[:24] + struct.pack("<Q", sum_of(body)) + data[32:64] + body


def check_bytes(start):
    """A single wrong bit anywhere, a byte more or less, or numbers that no run has: refused, nothing is lost."""
    rng = random.Random(1)
    for fmi in VERSIONS:
        harness = start(WITNESSES["ramps"].automaton, fmi)
        instance = Instance(harness)
        instance.boot()
        instance.do("save", 0)
        instance.do("bytes", 0)
        [good] = harness.ask("showbytes")
        data = bytes.fromhex(good)
        before = instance.values()

        def refused(wrong, slot=1, harness=harness, instance=instance):
            harness.ask("givebytes", bytes(wrong).hex())
            status, _ = instance.call("parse", slot)
            return status == 3

        assert data[:8] == b"HYBRIDS\n"
        for place in [*range(64), *(rng.randrange(64, len(data)) for _ in range(40))]:
            wrong = bytearray(data)
            wrong[place] ^= 1 << rng.randrange(8)
            assert refused(wrong), place
        for wrong in (data[:-1], data + b"\0", data[:63], data[:8], b"\0", bytes(len(data)), b"\xff" * 200):
            assert refused(wrong)
        # With a right checksum, but a mode that there is not, or no time.
        body = data[64:]
        mode_place = struct.calcsize("dd")
        live = body.index(struct.pack("<i", 8 if fmi == "3.0" else 16), mode_place)
        assert live == mode_place
        for changed in (struct.pack("<i", 3), struct.pack("<i", 256), struct.pack("<i", -1)):
            wrong = body[:mode_place] + changed + body[mode_place + 4 :]
            assert refused(signed(data, wrong))
        # With a right checksum, and not enough or too much.
        for wrong in (body[:-16], body[:16], b"", body + bytes(16)):
            assert refused(signed(data, wrong)), len(wrong)
        # Every number in turn is another, or none: what is taken up nevertheless must not harm the host.
        patterns = [struct.pack("<d", number) for number in (math.nan, -math.inf, 1e300, -1.0)] + [
            b"\xff" * 8,
            bytes(8),
        ]
        for place, pattern in itertools.product(range(0, len(body) - 8, 8), patterns):
            wrong = body[:place] + pattern + body[place + 8 :]
            if not refused(signed(data, wrong)):
                victim = Instance(harness, 1)
                if victim.call("load", 1)[0] == 0:
                    victim.call("values")
                    victim.call("update")
                    victim.call("plain", "step")
                    victim.call("step", 0.0, 0.01)
                victim.free()
                harness.ask("log")
        assert instance.values() == before
        # The place of a state that was there before is given back.
        harness.ask("givebytes", good)
        instance.do("parse", 1)
        held = harness.ask("memory")[0]
        instance.do("parse", 1)
        instance.do("save", 1)
        assert harness.ask("memory")[0] == held
        assert refused(data[:-1])
        assert harness.ask("memory")[0] == held
        instance.do("load", 1)
        assert instance.values() == before
        for slot in (0, 1, 1):
            instance.do("drop", slot)
        instance.free()
        assert harness.ask("memory")[0] == "0"


def check_states_of_another_kind(start):
    """A state of Model Exchange is none for Co-Simulation where the mode is another's; nothing is none at all."""
    for fmi in VERSIONS:
        harness = start(BouncingBall(), fmi)
        exchange, stepper = Instance(harness, 0, kind="me"), Instance(harness, 1)
        go_to_mode(exchange, "continuous", fmi)
        go_to_mode(stepper, "step", fmi)
        exchange.do("save", 0)
        stepper.do("save", 1)
        assert stepper.call("load", 0)[0] == 3
        assert exchange.call("load", 1)[0] == 3
        assert stepper.call("load", 5)[0] == 3
        stepper.do("load", 1)


# What each call without values does to the mode; where nothing is said it is refused.
NEXT = {
    "end": {"initialization": "first"},
    "event": {"step": "event", "continuous": "event"},
    "step": {"event": "step"},
    "continuous": {"event": "continuous"},
    "terminate": dict.fromkeys(("event", "step", "continuous"), "terminated"),
    "reset": dict.fromkeys(MODES, "instantiated"),
    "configure": {"instantiated": "configuration"},
    "configured": {"configuration": "instantiated"},
    "evaluate": {},
    "cancel": {},
}


def next_mode(call, mode, fmi, kind, events):
    """The mode after a call; None if it is refused."""
    to = NEXT[call].get(mode)
    if to == "first":
        to = "event" if kind == "me" or (fmi == "3.0" and events) else "step"
    if call == "event" and kind == "me" and fmi == "2.0" and mode == "event":
        to = "event"
    if call == "event" and kind == "cs" and (fmi == "2.0" or not events):
        return None
    if to in ("step", "continuous") and to != ("continuous" if kind == "me" else "step"):
        return None
    return to


def check_modes(start):
    """Every call in every mode: what the standard allows leads to the next mode, the rest leaves all as it was."""
    for fmi, kind, events in itertools.product(VERSIONS, ("cs", "me"), (True, False)):
        harness = start(BouncingBall(), fmi)
        for mode, call in itertools.product(MODES, NEXT):
            if not has_mode(mode, fmi, kind) or (kind == "cs" and mode == "event" and not events):
                continue
            instance = Instance(harness, kind=kind, events=events, logging=False)
            go_to_mode(instance, mode, fmi)
            before, to = instance.values(), next_mode(call, mode, fmi, kind, events)
            status, _ = instance.call("plain", call)
            if status == -1:
                assert call in ("configure", "configured", "evaluate", "step", "cancel")
                to = None
            else:
                assert status == (3 if to is None else 0), (fmi, kind, events, mode, call)
                # One line a refusal, and none otherwise.
                assert len(instance.log()) == (to is None)
            if to is None:
                assert instance.values() == before
            in_event_mode = (to or mode) == "event"
            status, _ = instance.call("update")
            assert (status == 0) == in_event_mode, (fmi, kind, mode, call)
            status, _ = instance.call("begin", 0.0, NONE, NONE)
            assert (status == 0) == ((to or mode) == "instantiated")
            harness.ask("log")
            instance.free()


def check_step_arguments(start):
    """Steps of no length, without end, with gaps or beyond the stop time are refused; rounding is none of these."""
    for fmi in VERSIONS:
        harness = start(WITNESSES["ramps"].automaton, fmi)
        instance = Instance(harness, events=False, early=False)
        instance.boot(0.0, 1.0)
        for n, h in ((3, 1.0 / 3.0), (60, 1.0 / 60.0), (10, 0.1)):
            t = 0.0
            for _ in range(n):
                instance.step(t, h)
                assert instance.get("time") == t + h
                t += h  # an importer that adds up: the last step ends a rounding beside the stop time
            wrong = [(t, 0.5), (t, 1e-9), (t - 0.1, 0.1), (t + 1e-9, 1e-3), (t, 0.0), (t, -0.1), (t, math.nan)]
            wrong += [(t, math.inf), (math.nan, 0.1), (math.inf, 0.1), (-math.inf, 0.1), (t, 1e308)]
            seen = instance.values()
            for at, size in wrong:
                status, _ = instance.call("step", float(at), float(size))
                assert status == 3, (at, size)
                assert instance.values() == seen
            instance.do("plain", "reset")
            instance.boot(0.0, 1.0)
        for start_time, stop, tolerance in (
            (math.nan, NONE, NONE),
            (math.inf, NONE, NONE),
            (1.0, 0.5, NONE),
            (0.0, math.inf, NONE),
            (0.0, NONE, 0.0),
            (0.0, NONE, -1.0),
            (0.0, NONE, math.inf),
        ):
            other = Instance(harness, 1)
            assert other.call("begin", start_time, stop, tolerance)[0] == 3, (start_time, stop, tolerance)
            other.boot(-2.0, -1.0)
            other.free()


def check_values(start):
    """What may be set when, and that a value that is refused changes nothing."""
    for fmi, kind in itertools.product(VERSIONS, ("cs", "me")):
        harness = start(WITNESSES["mix"].automaton, fmi)
        for mode in MODES:
            if not has_mode(mode, fmi, kind):
                continue
            instance = Instance(harness, kind=kind)
            go_to_mode(instance, mode, fmi)
            before = mode in ("instantiated", "initialization")
            allowed = {
                "period": before,
                "x[1]": before or mode == "continuous",
                "count[1]": before,
                "total": False,
                "time": False,
            }
            allowed |= {"push": mode not in ("configuration", "terminated"), "der(x[1])": False}
            for name, may in allowed.items():
                held = instance.get(name)
                values = instance.values()
                for bad in (math.nan, math.inf, -math.inf) if "count" not in name else ():
                    assert instance.call("set", harness.places[name], bad)[0] == 3, (mode, name, bad)
                    assert instance.values() == values
                status, _ = instance.call("set", harness.places[name], held + 1.0)
                assert (status == 0) == may, (fmi, kind, mode, name)
                if may:
                    assert instance.get(name) == held + 1.0
                    instance.set(name, held)
                assert instance.values() == values, (mode, name)
            assert instance.call("get", 10000)[0] == 3
            assert instance.call("set", 10000, 1.0)[0] == 3
            if fmi == "3.0" and before:
                held = instance.get("drive")
                assert instance.call("set", harness.places["drive"], 5.0, math.nan)[0] == 3
                assert instance.call("set", harness.places["drive"], 5.0)[0] == 3
                assert instance.call("set", harness.places["drive"], 5.0, 5.0, 5.0)[0] == 3
                assert instance.get("drive") == held
            harness.ask("log")
            instance.free()


class Computed(hm.HybridAutomaton):
    """Its start follows from a parameter; its output from the start."""

    a = hm.Parameter(2.0)
    x = hm.State(computed=True)
    y = hm.Output()

    def start_map(self, s):
        return {"x": s.a**2}

    def flow_map(self, s):
        return {"x": -s.x}

    def outputs(self, s):
        return {"y": 3.0 * s.x}


def check_start_values(start):
    """Shown before the run begins as they will be, and after what is set; outputs follow what is set at any time."""
    for fmi in VERSIONS:
        harness = start(Computed(), fmi)
        instance = Instance(harness, events=False)
        assert (instance.get("x"), instance.get("y")) == (4.0, 12.0)
        instance.begin()
        instance.set("a", 3.0)
        assert (instance.get("y"), instance.get("x")) == (27.0, 9.0)
        assert instance.call("set", harness.places["x"], 1.0)[0] == 3
        instance.do("plain", "end")
        assert (instance.get("x"), instance.get("y")) == (9.0, 27.0)
        instance.step(0.0, 1.0)
        assert abs(instance.get("y") - 27.0 * math.exp(-1.0)) < 1e-10
        other = Instance(start(WITNESSES["mix"].automaton, fmi), events=False)
        other.boot()
        other.step(0.0, 0.1)
        total = other.get("total")
        other.set("push", 0.5)
        assert abs(other.get("total") - total - 0.5) < 1e-15


def check_memory(start):
    """Each allocation that fails gives no instance and loses nothing; nothing is left when all are freed."""
    for fmi in VERSIONS:
        harness = start(Ramps(), fmi)
        for n in range(1, 12):
            harness.ask("fail", n)
            instance = Instance(harness)
            harness.ask("fail", 0)
            assert harness.ask("memory")[0] == ("0" if instance.status else "5")
            instance.free()
        assert n > 5
        assert harness.ask("memory")[0] == "0"


def check_messages(start):
    """Names and messages are no formats, the name is the instance's own, and switches of the log are obeyed."""
    for fmi in VERSIONS:
        harness = start(BouncingBall(), fmi)
        for name in ("%s%n", "plain"):
            instance = Instance(harness, name=name, logging=False, events=False)
            instance.boot()
            assert instance.call("plain", "end")[0] == 3
            assert only(instance.log()).startswith(name + ":")
            instance.step(0.0, 1.0)
            assert instance.log() == []
            instance.do("debug", 1, "-")
            instance.step(1.0, 0.3)
            assert len(instance.log()) == 1
            instance.do("debug", 1, b"logStatusError".hex())
            instance.step(1.3, 0.4)
            assert instance.log() == []
            assert instance.call("debug", 1, b"logNothing".hex())[0] == 3
            assert len(instance.log()) == 1
            instance.free()
        for wrong in ({"name": None}, {"name": " "}, {"token": "none"}, {"token": "0"}):
            refused = Instance(harness, **wrong)
            assert (refused.status, len(refused.log())) == (3, 1)


RULE_CHECKS = {name: function for name, function in list(globals().items()) if name.startswith("check_")}
