"""States as bytes: they can be kept, moved to another process and continued there bit for bit; others are refused."""

import ctypes as c
import hashlib
import struct

import pytest
from child_python import run_child
from fmi_driver.binary import ERROR, OK
from fmi_driver.journey import SETTINGS, Journey
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from witnesses import Mix, Ramps

HEADER, CHECKSUM = 64, slice(24, 32)
POINTS = [0.31, 0.52, 0.97]
STARTS = {"limit_a": 0.3, "rate_b": 2.0, "limit_b": 1.1, "first": 0.45, "period": 0.2}
LABELS = pytest.mark.parametrize("label", SETTINGS)


def on_the_way(make, label, t=0.4):
    journey = Journey(make(Mix, label), 0.0, 2.0, push=0.1)
    journey.go_to(t)
    return journey


@LABELS
def test_another_instance_continues_bit_for_bit(label, make):
    journey = on_the_way(make, label)
    data, place = journey.component.bytes(), journey.place()
    expected = [journey.go_to(t) for t in POINTS]
    other = on_the_way(make, label, t=0.9)
    status, pointer = other.component.deserialize(data)
    assert status == OK
    assert other.component.serialize(pointer) == data
    other.component.load(pointer)
    other.component.forget(pointer)
    other.go_to_place(place)
    assert [other.go_to(t) for t in POINTS] == expected
    assert other.component.bytes() == journey.component.bytes()
    assert other.component.log == journey.component.log == []


CHILD = f"""
import hashlib, sys
from pathlib import Path
from fmi_driver.binary import OK, Binary
from fmi_driver.journey import Journey, instance
path, label, task, file = sys.argv[1:]
journey = Journey(instance(Binary(path), label), 0.0, 2.0, push=0.1)
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
    environment = {"PYTHONHASHSEED": str(seed), "PADDING": "x" * 100 * seed}
    return run_child(CHILD, path, label, task, file, seconds=120, **environment).splitlines()


@pytest.mark.parametrize("label", ["2.0 CS", "3.0 CS", "3.0 ME"])
def test_two_processes_write_the_same_bytes_and_a_third_continues_them(label, binary, make, tmp_path):
    path = binary(Mix, SETTINGS[label]["fmi"]).fmu
    first, second = (child(path, label, "write", tmp_path / f"{seed}", seed) for seed in (1, 2))
    assert first == second
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()
    here = on_the_way(make, label)
    assert here.component.bytes() == (tmp_path / "1").read_bytes()
    announced = repr(here.update.next_time if here.update else None)
    assert child(path, label, announced, tmp_path / "1", 3) == first[1:]
    assert [repr(here.go_to(t)) for t in POINTS] == first[1:-1]
    assert hashlib.sha256(here.component.bytes()).hexdigest() == first[-1]


def refused(component, data, before):
    """Whether bytes are refused without any effect."""
    component.log.clear()
    status, pointer = component.deserialize(data)
    assert (status, pointer.value) == (ERROR, None)
    [text] = component.errors
    assert component.binary.function("DeserializeFMUState") in text
    return component.bytes() == before


@pytest.mark.parametrize("label", ["2.0 ME", "3.0 CS"])
def test_every_flipped_bit_of_the_header_and_every_truncation_is_refused(label, make):
    component = on_the_way(make, label).component
    data = component.bytes()
    for bit in range(8 * HEADER):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        assert refused(component, bytes(flipped), data), bit
    for size in [*range(HEADER + 9), *range(HEADER + 9, len(data), 101), len(data) - 1]:
        assert refused(component, data[:size], data), size
    for more in (b"\0", b"\0" * 8, data):
        assert refused(component, data + more, data)


def test_bytes_of_another_model_or_version_are_refused(make):
    ramps = make(Ramps, "3.0 CS")
    data = {label: on_the_way(make, label).component.bytes() for label in ("2.0 CS", "3.0 CS")}
    for label in data:
        component = on_the_way(make, label).component
        own = component.bytes()
        assert refused(component, ramps.bytes(), own)
        assert refused(component, data["3.0 CS" if label == "2.0 CS" else "2.0 CS"], own)


def test_a_state_of_another_kind_of_instance_is_refused_where_that_has_no_such_mode(make):
    """Within one model the bytes are those of the model; what an instance cannot be in, it does not become."""
    exchange, stepping = (on_the_way(make, label).component for label in ("3.0 ME", "3.0 CS without events"))
    for one, other in ((exchange, stepping), (stepping, exchange)):
        before = one.bytes()
        status, pointer = one.deserialize(other.bytes())
        assert status == OK
        assert one.call("SetFMUState", pointer) == ERROR
        assert one.bytes() == before
        one.forget(pointer)
        assert one.call("SetFMUState", None) == ERROR


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(at=st.integers(0), byte=st.integers(1, 255), tail=st.binary(max_size=40))
def test_random_damage_is_refused(at, byte, tail, make):
    component = on_the_way(make, "2.0 CS", 0.05).component
    data = bytearray(before := component.bytes())
    data[at % len(data)] ^= byte
    assert refused(component, bytes(data), before)
    if tail:
        assert refused(component, before + tail, before)
    assert refused(component, tail, before)


FORGED = """
import random, struct, sys
from pathlib import Path
from fmi_driver.binary import OK, Binary
from fmi_driver.journey import Journey, instance
path, label, rounds = sys.argv[1:]
rng = random.Random(int(rounds))
binary = Binary(path)
component = Journey(instance(binary, label), 0.0, 2.0).component
data = component.serialize(component.save())
fresh = Journey(instance(binary, label), 0.0, 2.0).go_to(0.5)
values = [float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 5e-324, -0.0, 1e18, -1.0]

def checksum(block):
    total = 14695981039346656037
    for byte in block:
        total = (total ^ byte) * 1099511628211 % 2**64
    return struct.pack("<Q", total)

taken = 0
for _ in range(int(rounds)):
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
    [("2.0 CS", 20), ("3.0 ME", 300), *(pytest.param(label, n, marks=pytest.mark.long) for label, n in MANY.items())],
)
def test_forged_bytes_with_a_right_checksum_do_no_harm(label, rounds, binary):
    """Whoever can compute the checksum can put in anything: no crash, no hang, and a reset heals all."""
    path = binary(Mix, SETTINGS[label]["fmi"]).fmu
    _, taken, _, equal = run_child(FORGED, path, label, rounds, seconds=60 + rounds).split()
    assert int(taken) > rounds // 10
    assert equal == "True"


def test_places_are_what_they_are(make):
    """What the tests above take for granted of the header."""
    component = on_the_way(make, "3.0 CS").component
    data = component.bytes()
    assert struct.unpack("<Q", data[16:24])[0] == len(data) - HEADER
    assert data[32:HEADER] == component.binary.token
    assert any(data[CHECKSUM])
    too_few = (c.c_ubyte * 10)()
    pointer = component.save()
    assert component.call("SerializeFMUState", pointer, too_few, c.c_size_t(10)) == ERROR
    assert not any(too_few)
    component.forget(pointer)
