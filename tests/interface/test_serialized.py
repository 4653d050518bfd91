"""States as bytes: they can be kept, moved to another process and continued there bit for bit; others are refused."""

import ctypes as c
import hashlib
import os
import struct
import subprocess
import sys
from pathlib import Path

import pytest
from fmu_driver2 import ERROR, OK, Binary
from fmu_driver_journey import SETTINGS, Journey, instance
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from witnesses import Mix, Ramps

SUPPORT = str(Path(__file__).parents[1] / "support")
HEADER, CHECKSUM = 64, slice(24, 32)
POINTS = [0.31, 0.52, 0.97]
STARTS = {"limit_a": 0.3, "rate_b": 2.0, "limit_b": 1.1, "first": 0.45, "period": 0.2}
LABELS = pytest.mark.parametrize("label", SETTINGS)


@pytest.fixture(scope="module")
def paths(exported):
    return {
        (name, fmi): exported(automaton, name, fmi)
        for name, automaton in (("mix", Mix()), ("ramps", Ramps()))
        for fmi in ("2.0", "3.0")
    }


@pytest.fixture(scope="module")
def binaries(paths):
    return {name: {fmi: Binary(paths[name, fmi]) for fmi in ("2.0", "3.0")} for name in ("mix", "ramps")}


def on_the_way(binaries, label, t=0.4):
    journey = Journey(instance(binaries["mix"], label), 0.0, 2.0, push=0.1)
    journey.go_to(t)
    return journey


def state_bytes(component):
    pointer = component.save()
    data = component.serialize(pointer)
    component.forget(pointer)
    return data


@LABELS
def test_another_instance_continues_bit_for_bit(label, binaries):
    journey = on_the_way(binaries, label)
    data, place = state_bytes(journey.component), journey.place()
    expected = [journey.go_to(t) for t in POINTS]
    other = on_the_way(binaries, label, t=0.9)
    status, pointer = other.component.deserialize(data)
    assert status == OK
    assert other.component.serialize(pointer) == data
    other.component.load(pointer)
    other.component.forget(pointer)
    other.go_to_place(place)
    assert [other.go_to(t) for t in POINTS] == expected
    assert state_bytes(other.component) == state_bytes(journey.component)
    assert other.component.log == journey.component.log == []
    other.component.free()
    journey.component.free()


CHILD = f"""
import hashlib, sys
from pathlib import Path
sys.path.insert(0, {SUPPORT!r})
from fmu_driver2 import OK, Binary
from fmu_driver_journey import Journey, instance
path, label, fmi, task, file = sys.argv[1:]
journey = Journey(instance({{fmi: Binary(Path(path))}}, label), 0.0, 2.0, push=0.1)
component = journey.component
if task == "write":
    journey.go_to(0.4)
    Path(file).write_bytes(component.serialize(component.save()))
    print(repr(journey.place()))
else:
    status, pointer = component.deserialize(Path(file).read_bytes())
    assert status == OK
    component.load(pointer)
    Update = type(journey.update) if journey.update else None
    if journey.exchange:
        journey.t, journey.update = 0.4, journey.update._replace(next_time=eval(task))
    else:
        journey.t = 0.4
for t in {POINTS}:
    print(repr(journey.go_to(t)))
print(hashlib.sha256(component.serialize(component.save())).hexdigest())
"""


def child(path, label, task, file, seed):
    command = [sys.executable, "-c", CHILD, str(path), label, SETTINGS[label]["fmi"], task, str(file)]
    environment = os.environ | {"PYTHONHASHSEED": str(seed), "PADDING": "x" * 100 * seed}
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, env=environment)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.parametrize("label", ["2.0 CS", "3.0 CS", "3.0 ME"])
def test_two_processes_write_the_same_bytes_and_a_third_continues_them(label, paths, binaries, tmp_path):
    path = paths["mix", SETTINGS[label]["fmi"]]
    first, second = (child(path, label, "write", tmp_path / f"{seed}", seed) for seed in (1, 2))
    assert first == second
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()
    here = on_the_way(binaries, label)
    assert state_bytes(here.component) == (tmp_path / "1").read_bytes()
    announced = repr(here.update.next_time if here.update else None)
    assert child(path, label, announced, tmp_path / "1", 3) == first[1:]
    assert [repr(here.go_to(t)) for t in POINTS] == first[1:-1]
    assert hashlib.sha256(state_bytes(here.component)).hexdigest() == first[-1]
    here.component.free()


def refused(component, data, before):
    """Whether bytes are refused without any effect."""
    component.log.clear()
    status, pointer = component.deserialize(data)
    assert (status, pointer.value) == (ERROR, None)
    [text] = component.errors
    assert component.binary.function("DeserializeFMUState") in text
    return state_bytes(component) == before


@pytest.mark.parametrize("label", ["2.0 ME", "3.0 CS"])
def test_every_flipped_bit_of_the_header_and_every_truncation_is_refused(label, binaries):
    component = on_the_way(binaries, label).component
    data = state_bytes(component)
    for bit in range(8 * HEADER):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        assert refused(component, bytes(flipped), data), bit
    for size in [*range(HEADER + 9), *range(HEADER + 9, len(data), 101), len(data) - 1]:
        assert refused(component, data[:size], data), size
    for more in (b"\0", b"\0" * 8, data):
        assert refused(component, data + more, data)
    component.free()


def test_bytes_of_another_model_or_version_are_refused(binaries):
    ramps = instance(binaries["ramps"], "3.0 CS")
    data = {label: state_bytes(on_the_way(binaries, label).component) for label in ("2.0 CS", "3.0 CS")}
    for label in data:
        component = on_the_way(binaries, label).component
        own = state_bytes(component)
        assert refused(component, state_bytes(ramps), own)
        assert refused(component, data["3.0 CS" if label == "2.0 CS" else "2.0 CS"], own)
        component.free()
    ramps.free()


def test_a_state_of_another_kind_of_instance_is_refused_where_that_has_no_such_mode(binaries):
    """Within one model the bytes are those of the model; what an instance cannot be in, it does not become."""
    exchange, stepping = (on_the_way(binaries, label).component for label in ("3.0 ME", "3.0 CS without events"))
    for one, other in ((exchange, stepping), (stepping, exchange)):
        before = state_bytes(one)
        status, pointer = one.deserialize(state_bytes(other))
        assert status == OK
        assert one.call("SetFMUState", pointer) == ERROR
        assert state_bytes(one) == before
        one.forget(pointer)
        assert one.call("SetFMUState", None) == ERROR
    exchange.free()
    stepping.free()


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(at=st.integers(0), byte=st.integers(1, 255), tail=st.binary(max_size=40))
def test_random_damage_is_refused(at, byte, tail, binaries):
    component = on_the_way(binaries, "2.0 CS", 0.05).component
    data = bytearray(before := state_bytes(component))
    data[at % len(data)] ^= byte
    assert refused(component, bytes(data), before)
    if tail:
        assert refused(component, before + tail, before)
    assert refused(component, tail, before)
    component.free()


FORGED = """
import random, struct, sys
from pathlib import Path
sys.path.insert(0, {support!r})
from fmu_driver2 import OK, Binary
from fmu_driver_journey import Journey, instance
path, label, fmi, seed = sys.argv[1:]
rng = random.Random(int(seed))
binaries = {{fmi: Binary(Path(path))}}
component = Journey(instance(binaries, label), 0.0, 2.0).component
data = component.serialize(component.save())
fresh = Journey(instance(binaries, label), 0.0, 2.0).go_to(0.5)
values = [float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 5e-324, -0.0, 1e18, -1.0]

def checksum(block):
    total = 14695981039346656037
    for byte in block:
        total = (total ^ byte) * 1099511628211 % 2**64
    return struct.pack("<Q", total)

taken = 0
for _ in range({rounds}):
    forged = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 3, 30])):
        at = 64 + 8 * rng.randrange((len(data) - 64) // 8)
        if rng.random() < 0.6:
            forged[at : at + 8] = struct.pack("<d", rng.choice(values))
        elif rng.random() < 0.5:
            forged[at : at + 4] = struct.pack("<i", rng.choice([-1, 0, 1, 2, 3, 8, 16, 32, 64, 2**31 - 1]))
        else:
            forged[at : at + 8] = rng.randbytes(8)
    forged[24:32] = checksum(forged[64:])
    status, pointer = component.deserialize(bytes(forged))
    if status == OK:
        if component.call("SetFMUState", pointer) == OK:
            taken += 1
            for name, (whole, _) in component.binary.elements.items():
                component.whole("Get", whole)
            time = component.whole("Get", "time")[1][0]
            if component.kind == "cs":
                component.step(time, 1e-3)
                component.step(time + 1e-3, 0.1)
            else:
                component.update()
                component.vector("GetContinuousStateDerivatives", component.binary.n_states)
                component.completed()
        component.forget(pointer)
    component.do("Reset")
    component.log.clear()
again = Journey(component, 0.0, 2.0).go_to(0.5)
print("taken", taken, "equal", repr(again) == repr(fresh))
"""


# In Co-Simulation a state with huge rates costs a call all the solver steps that it may take.
MANY = {label: 2000 if setting["kind"] == "me" else 150 for label, setting in SETTINGS.items()}


@pytest.mark.parametrize(
    ("label", "rounds"),
    [("2.0 CS", 60), ("3.0 ME", 300), *(pytest.param(label, n, marks=pytest.mark.long) for label, n in MANY.items())],
)
def test_forged_bytes_with_a_right_checksum_do_no_harm(label, rounds, paths):
    """Whoever can compute the checksum can put in anything: no crash, no hang, and a reset heals all."""
    fmi = SETTINGS[label]["fmi"]
    script = FORGED.format(support=SUPPORT, rounds=rounds)
    command = [sys.executable, "-c", script, str(paths["mix", fmi]), label, fmi, str(rounds)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60 + rounds)
    assert done.returncode == 0, done.stderr[-2000:]
    _, taken, _, equal = done.stdout.split()
    assert int(taken) > rounds // 10
    assert equal == "True"


def test_places_are_what_they_are(binaries):
    """What the tests above take for granted of the header."""
    component = on_the_way(binaries, "3.0 CS").component
    data = state_bytes(component)
    assert struct.unpack("<Q", data[16:24])[0] == len(data) - HEADER
    assert data[32:HEADER] == component.binary.token
    assert any(data[CHECKSUM])
    too_few = (c.c_ubyte * 10)()
    pointer = component.save()
    assert component.call("SerializeFMUState", pointer, too_few, c.c_size_t(10)) == ERROR
    assert not any(too_few)
    component.forget(pointer)
    component.free()
