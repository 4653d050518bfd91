"""Wiring is checked before anything runs, and refused with both names."""

import re
import zipfile
from dataclasses import replace

import numpy as np
import pytest

import hybrid_model as hm
from cosim.automaton_slave import AutomatonSlave
from cosim.errors import MisfitError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.measure import Measure
from cosim.system import System
from fmu.export import export_fmu
from hybrid_model.models import BouncingBall


class Sender(hm.HybridAutomaton):
    position = hm.State(0.0, unit="m", output=True)
    hidden = hm.State(0.0)
    sent = hm.DiscreteState(0.0, unit="m", output=True)
    pair = hm.DiscreteState([1.0, 2.0], output=True)
    three = hm.DiscreteState([1.0, 2.0, 3.0], output=True)

    def flow_map(self, s):
        return {"position": 1.0, "hidden": 0.0}


class Receiver(hm.HybridAutomaton):
    received = hm.Input(0.0, unit="m", discrete=True)
    felt = hm.Input(0.0)
    seconds = hm.Input(0.0, unit="s")
    gain = hm.Input(0.0)
    gain2 = hm.Input(0.0)
    many = hm.Input([0.0, 0.0], discrete=True)
    table = hm.Input([[0.0, 0.0]], discrete=True)


class Receives(hm.HybridAutomaton):
    u = hm.Input(0.0, discrete=True)
    y = hm.Output()

    def outputs(self, s):
        return {"y": s.u}


def wire(connections):
    return System([AutomatonSlave("sender", Sender()), AutomatonSlave("receiver", Receiver())], connections)


def test_signals_that_fit_are_connected():
    system = wire({"receiver.received": "sender.sent", "receiver.felt": "sender.position"})
    assert [str(connection) for connection in system.connections] == [
        "sender.sent -> receiver.received",
        "sender.position -> receiver.felt",
    ]


@pytest.mark.parametrize(
    ("target", "source", "sentence"),
    [
        ("receiver.received", "sender.position", "may change only at events"),
        ("receiver.seconds", "sender.position", "is in 'm', but receiver.seconds is in 's'"),
        ("receiver.gian", "sender.position", "not an input; the inputs of receiver are received, felt"),
        ("receiver.felt", "sender.hidden", "not an output; the outputs of sender are position, sent"),
        ("nobody.felt", "sender.position", "names no slave; the slaves are sender, receiver"),
        ("sender.position", "sender.sent", "not an input"),
    ],
)
def test_signals_that_do_not_fit_are_refused(target, source, sentence):
    with pytest.raises(MisfitError, match=sentence):
        wire({target: source})


def test_an_input_driven_twice_is_refused():
    with pytest.raises(MisfitError, match=r"sender.sent -> receiver.many\[1\] and sender.sent -> receiver.many\[1\]"):
        wire({"receiver.many": ["sender.sent", "sender.sent"], "receiver.many[1]": "sender.sent"})


def test_vectors_of_one_shape_are_connected_by_their_names():
    system = wire({"receiver.many": "sender.pair"})
    assert [str(connection) for connection in system.connections] == [
        "sender.pair[1] -> receiver.many[1]",
        "sender.pair[2] -> receiver.many[2]",
    ]


@pytest.mark.parametrize(
    ("target", "source", "sentence"),
    [
        ("receiver.many", "sender.three", r"the elements \[1\] to \[2\] and sender.three the elements \[1\] to \[3\]"),
        (
            "receiver.table",
            "sender.pair",
            r"the elements \[1,1\] to \[1,2\] and sender.pair the elements \[1\] to \[2\]",
        ),
        ("receiver.many", "sender.sent", "sender.sent no elements: connect arrays of one shape, or name the output of"),
        ("receiver.felt", "sender.pair", "receiver.felt has no elements"),
        (
            "receiver.many",
            ["sender.sent"],
            r"receiver.many has 2 elements, \[1\] to \[2\], but is given a list of 1 output:",
        ),
        (
            "receiver.many",
            ["sender.sent"] * 3,
            "receiver.many has 2 elements, .* a list of 3 outputs: name one for each",
        ),
        (
            "receiver.many",
            [],
            r'a list of 0 outputs: name one for each element, or drive single ones, as "receiver.many\[1\]"',
        ),
        (
            "receiver.felt",
            ["sender.sent"],
            "receiver.felt is no array, but is given a list of 1 output: name one output",
        ),
        ("receiver.felt", [], "receiver.felt is no array, but is given a list of 0 outputs"),
        ("receiver.nothing", ["sender.sent"], "receiver.nothing is not an input"),
    ],
)
def test_vectors_of_other_shapes_are_refused(target, source, sentence):
    with pytest.raises(MisfitError, match=sentence):
        wire({target: source})


def test_a_list_drives_the_elements_of_a_table_row_by_row():
    system = wire({"receiver.table": ["sender.sent", "sender.pair[2]"]})
    assert [str(connection) for connection in system.connections] == [
        "sender.sent -> receiver.table[1,1]",
        "sender.pair[2] -> receiver.table[1,2]",
    ]


def test_names_that_begin_alike_are_told_apart():
    system = wire({"receiver.gain2": "sender.position"})
    assert system.connections[0].input == "gain2"


def test_two_slaves_of_one_name_are_refused():
    with pytest.raises(MisfitError, match="two slaves have one name"):
        System([AutomatonSlave("a", Sender()), AutomatonSlave("a", Receiver())], {})


def test_event_exact_master_refuses_a_signal_that_changes_along_flows():
    with pytest.raises(
        MisfitError, match=r"sender.position -> receiver.felt carries a signal that changes along flows"
    ):
        run_event_exact(wire({"receiver.felt": "sender.position"}), 1.0)


def measured(slave, unit, measure):
    """Give all ports of a slave a unit, as an FMU may declare it."""
    slave.outputs = {name: replace(port, unit=unit, measure=measure) for name, port in slave.outputs.items()}
    slave.inputs = {name: replace(port, unit=unit, measure=measure) for name, port in slave.inputs.items()}
    return slave


CELSIUS, KELVIN = Measure((0, 0, 0, 0, 1, 0, 0, 0), 1.0, 273.15), Measure((0, 0, 0, 0, 1, 0, 0, 0))
FAHRENHEIT = Measure((0, 0, 0, 0, 1, 0, 0, 0), 5.0 / 9.0, 273.15 - 32.0 * 5.0 / 9.0)
METRE = Measure((0, 1, 0, 0, 0, 0, 0, 0))


@pytest.mark.parametrize("master", [run_event_exact, lambda system, t: run_fixed_step(system, t, 0.5)])
@pytest.mark.parametrize(
    ("from_", "into", "arrives"), [(CELSIUS, KELVIN, 374.15), (KELVIN, CELSIUS, -172.15), (CELSIUS, FAHRENHEIT, 213.8)]
)
def test_units_that_both_sides_declare_are_converted(from_, into, arrives, master):
    """101 degrees of each kind; the number changes at the start and in a step alike."""
    sender = measured(AutomatonSlave("sender", Sender(sent=101.0)), "from", from_)
    receiver = measured(AutomatonSlave("receiver", Receives()), "into", into)
    result = master(System([sender, receiver], {"receiver.u": "sender.sent"}), 1.0)
    assert result.final["receiver.y"] == pytest.approx(arrives, rel=1e-14)


def test_units_that_measure_differently_are_refused():
    slaves = [measured(AutomatonSlave("sender", Sender()), "degC", CELSIUS)]
    slaves.append(measured(AutomatonSlave("receiver", Receives()), "m", METRE))
    with pytest.raises(MisfitError, match=r"is in 'degC', but receiver\.u is in 'm', and they measure differently"):
        System(slaves, {"receiver.u": "sender.sent"})
    measured(slaves[1], "K", None)
    with pytest.raises(MisfitError, match="both are not declared in SI base units"):
        System(slaves, {"receiver.u": "sender.sent"})


class Hears(Receives):
    u = hm.Input(0.0, unit="km", discrete=True)


class Warm(Receives):
    u = hm.Input(0.0, unit="degC", discrete=True)


def test_automata_measure_as_their_fmus_do(tmp_path):
    sender = AutomatonSlave("sender", Sender(sent=101.0))
    result = run_event_exact(System([sender, AutomatonSlave("receiver", Hears())], {"receiver.u": "sender.sent"}), 1.0)
    assert result.final["receiver.y"] == 0.101
    with pytest.raises(MisfitError, match=r"is in 'm', but receiver\.u is in 'degC', and they measure differently"):
        System([sender, AutomatonSlave("receiver", Warm())], {"receiver.u": "sender.sent"})
    fmu = FmuSlave("receiver", export_fmu(Warm(), tmp_path / "warm.fmu", kinds=("cs",)))
    assert fmu.inputs["u"].measure == AutomatonSlave("receiver", Warm()).inputs["u"].measure == CELSIUS


@pytest.mark.parametrize(("fmi", "variable"), [("3.0", "<Float64"), ("2.0", "<Real")])
def test_differences_are_converted_without_the_offset_of_their_unit(fmi, variable, tmp_path):
    path = export_fmu(Warm(), tmp_path / "warm.fmu", kinds=("cs",), fmi=fmi)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    text = members["modelDescription.xml"].decode()
    changed = re.sub(rf'({variable}[^<>]*) unit="degC"', r'\1 unit="degC" relativeQuantity="true"', text)
    assert changed != text
    members["modelDescription.xml"] = changed.encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    assert FmuSlave("warm", path).inputs["u"].measure == KELVIN


def test_measures_of_fmus_are_those_that_they_declare(tmp_path):
    path = export_fmu(BouncingBall(), tmp_path / "ball.fmu", kinds=("cs",))
    ports = FmuSlave("ball", path).outputs
    assert ports["h"].measure == METRE
    assert ports["v"].measure == Measure((0, 1, -1, 0, 0, 0, 0, 0))


class Ears(hm.HybridAutomaton):
    degree = hm.Dimension()
    heard = hm.Input(0.0, shape="degree", discrete=True)
    level = hm.Output()

    def outputs(self, s):
        return {"level": np.sum(s.heard)}


@pytest.mark.parametrize("kind", ["automaton", "fmu"])
def test_an_array_without_elements_is_driven_by_nobody(kind, exported):
    """As the broadcasts that an agent without neighbours hears; of an FMU the description leaves the array out."""
    deaf = Ears(heard=[])
    slave = AutomatonSlave("deaf", deaf) if kind == "automaton" else FmuSlave("deaf", exported(deaf, "deaf"))
    assert System([slave], {"deaf.heard": []}).connections == ()
    with pytest.raises(MisfitError, match=r"heard has 2 elements, \[1\] to \[2\], but is given a list of 0 outputs"):
        System([AutomatonSlave("two", Ears(heard=[0.0, 0.0]))], {"two.heard": []})
