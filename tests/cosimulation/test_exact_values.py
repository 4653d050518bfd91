"""What variables of FMUs hold is exact by type; what they cannot hold is refused by name."""

import csv
import math
import zipfile

import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.cli.main import main
from cosim.errors import CosimError, MisfitError
from cosim.flow_functions import FlowError, FlowFunctions
from cosim.fmu_slave import FmuSlave
from cosim.isolation.isolated_slave import IsolatedSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.system import System
from cosim.systems.assembly import assemble
from cosim.systems.files import read_system


def echoed(path, kind, text):
    """Give a text for an input and return what the FMU has of it."""
    slave = FmuSlave("stranger", path)
    slave.set(f"{kind}_in", slave.parse(f"{kind}_in", text))
    result = run_fixed_step(System([slave], {}), 0.1, 0.1)
    return result.final[f"stranger.{kind}_out"]


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("float64", "0.1", 0.1),
        ("float64", "-0.1", -0.1),
        ("float32", "0.5", 0.5),
        ("int8", "-128", -128),
        ("uint8", "255", 255),
        ("int16", "-32768", -32768),
        ("uint16", "65535", 65535),
        ("int32", "3e6", 3000000),
        ("uint32", "4294967295", 4294967295),
        ("int64", "1152921504606846979", 1152921504606846979),
        ("int64", "-9223372036854775808", -9223372036854775808),
        ("uint64", "18446744073709551615", 18446744073709551615),
        ("boolean", "true", True),
        ("boolean", "0", False),
        ("enumeration", "high", 7),
        ("enumeration", "1", 1),
        ("string", "abc = 7.6", "abc = 7.6"),
        ("string", "", ""),
        ("binary", "00ff10", b"\x00\xff\x10"),
    ],
)
def test_values_reach_the_fmu_as_they_are_written(kind, text, value, stranger):
    found = echoed(stranger(), kind, text)
    assert found == value
    assert type(found) is type(value)


def test_values_read_together_are_those_read_one_by_one(stranger):
    slave = FmuSlave("stranger", stranger())
    slave.start(0.0, 1.0, events=False)
    names = list(slave.outputs)[::-1] + list(slave.outputs)
    together, apart = slave.reader(names), [slave.get(name) for name in names]
    assert len({type(value) for value in apart}) > 3
    assert (together(), [*map(type, together())]) == (apart, [*map(type, apart)])
    slave.close()


@pytest.mark.parametrize(
    ("kind", "text", "sentence"),
    [
        ("int32", "7.6", r"int32_in is set to 7\.6, but it is an Int32: give a whole number from -2147483648 to"),
        ("int32", "3e9", "set to 3000000000, but it is an Int32"),
        ("int32", "nan", "set to nan, but it is an Int32"),
        ("int32", "1e999999999", "but it is an Int32"),
        ("int32", "3000001", r"set to 3000001, above its maximum 3000000: give a value in its range"),
        ("int32", "-6", "set to -6, below its minimum -5"),
        ("int8", "300", "but it is an Int8: give a whole number from -128 to 127"),
        ("uint8", "-1", "but it is a UInt8: give a whole number from 0 to 255"),
        ("uint64", "18446744073709551616", "but it is a UInt64"),
        ("int64", "9223372036854775808", "but it is an Int64"),
        ("int16", "abc", "set to 'abc', but it is an Int16: give a number"),
        ("float32", "1e300", r"but it is a Float32: give a number of at most 3\.4028235e\+38 in size"),
        ("float64", "1e400", "set to inf: set a finite number"),
        ("float64", "2e6", "above its maximum 1e6"),
        ("float64", "abc", "but it is a Float64: give a number"),
        ("boolean", "2", "set to 2, but it is a Boolean: give true or false"),
        ("boolean", "yes", "but it is a Boolean: give true or false"),
        ("enumeration", "middle", r"but it is an Enumeration: give one of low \(1\), high \(7\)"),
        ("enumeration", "2", "but it is an Enumeration: give one of"),
        ("binary", "0x", "but it is a Binary: give its bytes"),
    ],
)
def test_values_that_a_type_cannot_hold_are_refused(kind, text, sentence, stranger, capsys):
    assert main(["cosim", str(stranger()), "--start-value", f"{kind}_in={text}"]) == 2
    assert main(["cosim", str(stranger()), "--start-value", f"stranger.{kind}_in={text}"]) == 2
    error = capsys.readouterr().err
    with pytest.raises(MisfitError, match=sentence):
        echoed(stranger(), kind, text)
    assert f"--start-value: stranger.{kind}_in is set to" in error


def test_values_given_in_python_are_held_to_the_same_rules(stranger):
    slave = FmuSlave("stranger", stranger())
    for name, value in (
        ("int32_in", 1.5),
        ("boolean_in", 2),
        ("string_in", 1.0),
        ("binary_in", "00"),
        ("uint8_in", "1"),
    ):
        with pytest.raises(MisfitError, match=f"stranger.{name} is set to {value!r}"):
            slave.set(name, value)
    slave.set("int32_in", 2.0)
    slave.set("float64_in", 7)


def test_values_that_cannot_be_held_are_refused_in_a_run_too(stranger):
    """Signals are not rounded on their way: half a step of an output does not fit into a whole number."""
    slaves = [FmuSlave("a", stranger(events=False)), FmuSlave("b", stranger(events=False))]
    slaves[0].set("int16_in", 200)
    with pytest.raises(MisfitError, match=r"b\.int8_in is set to 200, but it is an Int8"):
        run_fixed_step(System(slaves, {"b.int8_in": "a.int16_out"}), 1.0, 0.1)
    with pytest.raises(MisfitError, match=r"a\.float64_out carries numbers, but b\.int8_in takes whole numbers"):
        System(slaves, {"b.int8_in": "a.float64_out"})


def test_texts_and_bytes_travel_along_connections(stranger):
    slaves = [FmuSlave("a", stranger()), FmuSlave("b", stranger())]
    slaves[0].set("string_in", "hello")
    slaves[0].set("binary_in", b"\x01\x02")
    wires = {"b.string_in": "a.string_out", "b.binary_in": "a.binary_out", "b.uint64_in": "a.uint64_out"}
    final = run_event_exact(System(slaves, wires), 1.0).final
    assert (final["b.string_out"], final["b.binary_out"]) == ("hello", b"\x01\x02")
    with pytest.raises(MisfitError, match=r"a\.string_out carries text, but b\.int8_in takes whole numbers"):
        System(slaves, {"b.int8_in": "a.string_out"})


def test_whole_numbers_are_shown_and_written_with_all_their_digits(stranger, tmp_path, capsys):
    table = tmp_path / "run.csv"
    starts = {"int64_in": "9007199254740993", "string_in": "hello", "binary_in": "00ff", "boolean_in": "true"}
    command = ["cosim", str(stranger()), "--output-file", str(table)]
    assert (
        main([*command, *(word for name, text in starts.items() for word in ("--start-value", f"{name}={text}"))]) == 0
    )
    out = capsys.readouterr().out
    for line in ("int64_out = 9007199254740993", "string_out = hello", "binary_out = 00ff", "boolean_out = true"):
        assert f"  stranger.{line}\n" in f"{out}\n"
    names, *rows = (line.split(",") for line in table.read_text().splitlines())
    last = dict(zip(names, rows[-1], strict=True))
    assert last["int64_out"] == "9007199254740993"
    assert (last["string_out"], last["binary_out"], last["boolean_out"]) == (
        "hello",
        "00ff",
        "1",
    )


@pytest.fixture
def weights_out(stranger):
    """Make the weights of the stranger outputs."""
    path = stranger()
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    weights = b'name="weights" valueReference="8" causality='
    text = members["modelDescription.xml"]
    changed = text.replace(
        weights + b'"parameter" variability="fixed" start="1 1"', weights + b'"output" variability="discrete"'
    )
    assert changed != text
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in (members | {"modelDescription.xml": changed}).items():
            archive.writestr(name, content)
    return path


@pytest.mark.parametrize("size", [1, 4])
def test_outputs_have_the_sizes_that_the_command_gives_them(size, weights_out, tmp_path):
    out = tmp_path / "out.csv"
    assert main(["cosim", str(weights_out), "--start-value", f"size={size}", "--output-file", str(out)]) == 0
    with out.open(newline="") as file:
        assert {row["weights"] for row in csv.DictReader(file)} == {" ".join(["1.0"] * size)}


def test_structural_parameters_are_set_in_configuration_mode(stranger, capsys):
    """The array gets its new size, and weights of 1; the second of them is then set."""
    starts = ["--start-value", "size=4", "--start-value", "weights[4]=2.5"]
    for given in (starts, starts[2:] + starts[:2]):
        assert main(["cosim", str(stranger()), *given]) == 0
        assert "stranger.total = 5.5" in capsys.readouterr().out
    assert main(["cosim", str(stranger()), "--start-value", "weights[4]=2.5"]) == 2
    assert "stranger has no variable 'weights[4]'" in capsys.readouterr().err


def test_sizes_come_before_arrays_whatever_their_order_in_a_file(stranger, tmp_path):
    (tmp_path / "system.toml").write_text(
        f'[components.a]\nfmu = "{stranger()}"\nstart = {{ weights = [1.0, 2.0, 3.0], size = 3 }}\n'
    )
    assert run_fixed_step(assemble(read_system(tmp_path / "system.toml")), 0.1, 0.1).final["a.total"] == 6.0


@pytest.mark.parametrize("size", [1, 4])
def test_a_system_follows_the_sizes_that_its_slaves_are_given_later(size, weights_out):
    slave = FmuSlave("a", weights_out)
    system = System([slave], {"a.float64_in": "a.weights[1]"})
    slave.set("size", size)
    names = [f"a.weights[{k + 1}]" for k in range(size)]
    assert [name for name in system.output_names if name.startswith("a.weights")] == names
    result = run_fixed_step(system, 0.2, 0.1, record=system.output_names)
    assert [result.final[name] for name in (*names, "a.float64_out")] == [1.0] * (size + 1)


def test_what_is_connected_to_elements_that_are_gone_is_refused_by_name(weights_out):
    slave = IsolatedSlave("a", weights_out)
    system = System([slave], {"a.float64_in": "a.weights[2]"})
    slave.set("size", 1)
    with pytest.raises(MisfitError, match=r"a\.weights\[2\] is not an output"):
        run_fixed_step(system, 0.1, 0.1)
    slave.set("size", 2)
    assert run_fixed_step(system, 0.2, 0.1).final["a.float64_out"] == 1.0


def test_structural_parameters_are_not_for_a_run(stranger):
    slave = FmuSlave("stranger", stranger())
    slave.start(0.0, 1.0, events=False)
    slave.begin()
    with pytest.raises(MisfitError, match=r"stranger\.size is a structural parameter: set it before the run"):
        slave.set("size", 3)
    slave.close()


def test_elements_of_arrays_are_set_one_by_one(stranger):
    slave = FmuSlave("stranger", stranger())
    slave.set("weights[1]", 3.0)
    slave.set("weights[2]", 4.0)
    assert run_fixed_step(System([slave], {}), 0.1, 0.1).final["stranger.total"] == 7.0


def test_what_the_fmu_refuses_is_named(stranger):
    slave = FmuSlave("stranger", stranger())
    slave.set("size", 101)
    with pytest.raises(CosimError, match=r"fmi3SetUInt64 failed: .*at most 100.* It was to set 'size' to 101"):
        run_fixed_step(System([slave], {}), 0.1, 0.1)


class Counted(hm.HybridAutomaton):
    """Whole numbers, of our own."""

    n = hm.DiscreteState(0, integer=True, output=True)
    most = hm.Parameter(3.0)


@pytest.mark.parametrize("kind", ["automaton", "2.0", "3.0"])
def test_our_own_integers_take_whole_numbers(kind, exported):
    slave = (
        AutomatonSlave("a", Counted()) if kind == "automaton" else FmuSlave("a", exported(Counted(), "counted", kind))
    )
    with pytest.raises(MisfitError, match=r"a\.n is set to 1\.5, but it is an "):
        slave.set("n", 1.5)
    with pytest.raises(MisfitError, match=r"a\.most is set to nan"):
        slave.set("most", math.nan)
    slave.set("n", 2)
    assert run_fixed_step(System([slave], {}), 0.1, 0.1).final["a.n"] == 2


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_flow_functions_take_values_by_the_same_rules(fmi, exported):
    path = exported(Counted(), "counted", fmi)
    with pytest.raises(FlowError, match=r"n is set to 1\.5, but it is an Int"):
        FlowFunctions(path, {"n": 1.5})
    FlowFunctions(path, {"n": 2}).close()
