"""Every function in every mode of every kind of instance: what the standard allows works, the rest is refused.

A refused call returns Error, logs one line with its name, and leaves every byte of the instance's state as it was. So
nobody has to free an instance because of a slip: the standard would permit to end it there.
"""

import ctypes as c
import subprocess

import pytest
from fmi_driver.binary import DISCARD, ERROR, OK, Binary
from fmi_driver.calls import TABLE
from fmi_driver.component import Component
from fmi_driver.journey import SETTINGS
from witnesses import Cascade, Ramps

from fmu.export import export_fmu

LABELS = pytest.mark.parametrize("label", SETTINGS)


def modes_of(setting):
    """The modes that an instance of a kind can be in."""
    modes = ["instantiated", "initialization", "terminated"]
    if setting["fmi"] == "3.0":
        modes.append("configuration")
    if setting["kind"] == "me" or setting.get("events"):
        modes.append("event")
    return [*modes, "continuous" if setting["kind"] == "me" else "step"]


@pytest.fixture
def in_mode(make):
    """Lead an instance into a mode; it knows the bytes of its state there."""

    def in_mode(label, mode):
        component = make(Ramps, label)
        if mode == "configuration":
            component.do("EnterConfigurationMode")
        elif mode != "instantiated":
            assert component.enter_initialization() == OK
            component.set("limit_a", 0.7)
            if mode != "initialization":
                component.do("ExitInitializationMode")
            if mode not in ("initialization", "event") and component.starts_in_event_mode:
                component.settle()
            if mode == "terminated":
                component.do("Terminate")
        component.saved = component.save()
        component.saved_bytes = component.serialize(component.saved)
        return component

    return in_mode


def rows(setting):
    return [name for name, case in TABLE.items() if case.version in (0, int(setting["fmi"][0]))]


@pytest.mark.parametrize(("label", "row"), [(label, row) for label, s in SETTINGS.items() for row in rows(s)])
def test_calls_are_allowed_in_their_modes_only(label, row, in_mode):
    setting, case, name = SETTINGS[label], TABLE[row], row.strip()
    allowed = case.cs if setting["kind"] == "cs" else case.me
    for mode in modes_of(setting):
        component = in_mode(label, mode)
        # Without events there is no Event Mode to enter, whatever the mode.
        legal = mode in allowed and not (name == "EnterEventMode" and label == "3.0 CS without events")
        found = component.call(name, *case.arguments(component))
        if legal:
            assert (mode, found) == (mode, case.status), component.log
            assert len(component.log) == (case.status != OK)
        else:
            assert (mode, found) == (mode, ERROR)
            [line] = component.log
            assert (line.status, line.category) == (ERROR, "logStatusError")
            assert line.text.startswith("block: ")
            assert component.binary.function(name) in line.text
            assert ("eventModeUsed" in line.text) == (mode in allowed)
            assert component.bytes() == component.saved_bytes
        component.forget(component.saved)


@pytest.mark.parametrize(("label", "row"), [(label, row) for label, s in SETTINGS.items() for row in rows(s)])
def test_null_pointers_are_refused(label, row, in_mode):
    """Each pointer of each function by itself, also the instance, in a mode in which the call is allowed."""
    setting, case, name = SETTINGS[label], TABLE[row], row.strip()
    allowed = case.cs if setting["kind"] == "cs" else case.me
    mode = next((mode for mode in modes_of(setting) if mode in allowed), "initialization")
    component = in_mode(label, mode)
    arguments, binary = case.arguments(component), component.binary
    function = getattr(binary.functions, binary.function(name))
    assert function(c.c_void_p(None), *arguments) == ERROR
    for k, argument in enumerate(arguments):
        if isinstance(argument, c._SimpleCData) and not isinstance(argument, c.c_void_p):
            continue
        found = component.call(name, *arguments[:k], None, *arguments[k + 1 :])
        nothing_there = argument is None and mode in allowed  # no pointer is needed for no values
        if nothing_there or name == "FreeFMUState":
            assert (found, component.log) == (OK, [])
        elif case.status == DISCARD and mode in allowed:
            assert found == DISCARD
        else:
            assert (k, found, len(component.log)) == (k, ERROR, 1)
            assert binary.function(name) in component.log[0].text
            assert component.bytes() == component.saved_bytes
        component.log.clear()
    component.forget(component.saved)


def test_the_table_has_every_function(binary):
    """What the headers declare and the table does not hold is tested by its own tests."""
    for fmi in ("2.0", "3.0"):
        loaded = binary(Ramps, fmi)
        listed = subprocess.run(["nm", "-D", "--defined-only", str(loaded.library)], capture_output=True, text=True)
        symbols = {line.split()[-1] for line in listed.stdout.splitlines()}
        version = int(fmi[0])
        tested = {loaded.function(row.strip()) for row, case in TABLE.items() if case.version in (0, version)}
        kinds = {s for s in symbols - tested if not s.startswith((f"fmi{version}Get", f"fmi{version}Set"))}
        assert kinds == {f"fmi{version}FreeInstance"} | {s for s in symbols if "Instantiate" in s}
        # The other types' accessors are one piece of code each with those above.
        types = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64", "Binary")
        rest = {s for s in symbols - tested - kinds if not s.endswith(types)}
        assert rest == {f"fmi{version}GetVersion"} | ({"fmi2GetTypesPlatform"} if version == 2 else set())


def test_version_2_works_without_callbacks(binary):
    loaded, boolean = binary(Ramps, "2.0"), c.c_int(0)
    functions = loaded.functions
    assert functions.fmi2Instantiate(b"block", 1, b"another", None, None, boolean, boolean) is None
    handle = functions.fmi2Instantiate(b"block", 1, loaded.token, None, None, boolean, boolean)
    assert functions.fmi2DoStep(c.c_void_p(handle), c.c_double(0.0), c.c_double(0.1), 1) == ERROR
    assert functions.fmi2EnterInitializationMode(c.c_void_p(handle)) == OK
    assert functions.fmi2ExitInitializationMode(c.c_void_p(handle)) == OK
    assert functions.fmi2DoStep(c.c_void_p(handle), c.c_double(0.0), c.c_double(0.1), 1) == OK
    functions.fmi2FreeInstance(c.c_void_p(handle))


@pytest.mark.parametrize(("fmi", "kind", "other"), [("2.0", "me", "cs"), ("3.0", "cs", "me")])
def test_a_kind_that_was_not_exported_gives_no_instance(fmi, kind, other, tmp_path):
    binary = Binary(export_fmu(Cascade(), tmp_path / "one.fmu", fmi=fmi, kinds=[kind]))
    component = Component(binary, kind)
    component.begin()
    component.free()
    component = Component(binary, other)
    assert component.handle is None
    assert len(component.errors) == 1
    assert "this FMU is not for" in component.errors[0]


@LABELS
def test_freeing_in_every_mode_and_freeing_nothing(label, in_mode):
    for mode in modes_of(SETTINGS[label]):
        component = in_mode(label, mode)
        component.forget(component.saved)
        component.free()
    binary = component.binary
    getattr(binary.functions, binary.function("FreeInstance"))(c.c_void_p(None))


@LABELS
def test_only_inputs_and_what_an_importer_integrates_are_set_while_running(label, in_mode):
    setting = SETTINGS[label]
    for mode in modes_of(setting):
        component = in_mode(label, mode)
        at_start = {"instantiated", "initialization"}
        for name, modes in (("limit_a", at_start), ("a", {*at_start, "continuous"}), ("count_a", at_start)):
            assert (mode, component.try_set(name, 1)) == (mode, OK if mode in modes else ERROR)
            if mode in ("event", "step", "continuous") and mode not in modes:
                assert f"'{name}' cannot be set" in component.errors[-1]
        for name in ("time", "der(a)"):
            assert component.try_set(name, 1.0) == ERROR
        assert all(component.binary.function("Set")[:7] in text for text in component.errors)
        component.forget(component.saved)
