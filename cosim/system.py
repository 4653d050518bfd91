"""A system of slaves wired by name, checked before anything runs."""

from __future__ import annotations

import contextlib
import copy
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cosim.errors import MisfitError
from cosim.rounds import reading_round
from cosim.slave import Port, Slave
from cosim.sources import Linear, Source
from hybrid_model.declare.calls import explained
from hybrid_model.declare.real_numbers import told

SETTLED = 1e-14
"""Part of a signal by which it may change and still have settled in a loop that is iterated."""
_TYPES = {
    ("number", False): "numbers",
    ("number", True): "whole numbers",
    ("truth", False): "truth values",
    ("text", False): "text",
    ("bytes", False): "bytes",
}


@dataclass(frozen=True)
class Connection:
    """A scalar signal from an output to an input."""

    source: str
    output: str
    target: str
    input: str
    factor: float = 1.0
    offset: float = 0.0

    def carried(self, value: Any) -> Any:
        """Return what arrives: the value in the unit of the input."""
        if self.factor == 1.0 and self.offset == 0.0:
            return value
        return self.factor * value + self.offset

    @property
    def converts(self) -> bool:
        """Whether its ends have different units."""
        return self.factor != 1.0 or self.offset != 0.0

    def __str__(self) -> str:
        return f"{self.source}.{self.output} -> {self.target}.{self.input}"


class System:
    """Slaves and their connections.

    Parameters
    ----------
    slaves : sequence of Slave
        With distinct names; the order is the order in which simultaneous events are handled.
    connections : mapping, optional
        ``"slave.input"`` -> ``"slave.output"``; for vectors too, if both have the same elements, or to a sequence of
        names for the elements; or to `Linear`, for numbers. Inputs not named keep their start values.
    loop_iterations : int
        How often signals that depend on each other at once, in a loop, are carried round it until they settle, beyond
        what a chain of all slaves needs. That solves loops whose gain is below one in size; 0: loops are refused.

    Raises
    ------
    MisfitError
        For what are no slaves or connections, unknown names, two slaves of one name, units or elements that differ, a
        continuous signal on a discrete input, or text on an input for numbers.
    """

    @explained(MisfitError)
    def __init__(
        self, slaves: Sequence[Slave], connections: Mapping[str, Source] | None = None, *, loop_iterations: int = 0
    ) -> None:
        connections = {} if connections is None else connections
        if not (isinstance(slaves, Sequence) and all(isinstance(slave, Slave) for slave in slaves)):
            raise MisfitError(f"the slaves are {told(slaves)}: give a list of FmuSlave(name, path) and others.")
        if not isinstance(connections, Mapping):
            raise MisfitError(f'the connections are {told(connections)}: write {{"slave.input": "slave.output"}}.')
        self.loop_iterations = loop_iterations
        self.slaves = {slave.name: slave for slave in slaves}
        if len(self.slaves) < len(slaves):
            raise MisfitError(f"two slaves have one name among {[slave.name for slave in slaves]}: name them apart.")
        self._given = dict(connections)
        self._wire()
        for slave in slaves:
            slave.tell_of_sizes(weakref.WeakMethod(self._resized))

    def _wire(self) -> None:
        """Find the outputs, and take the connections apart to those of scalars."""
        self._wired = True
        self._all = {f"{slave.name}.{port}": (slave, port) for slave in self.slaves.values() for port in slave.outputs}
        self._wires = tuple(
            self._connection(target, source, given)
            for vector, given in self._given.items()
            for target, source in self._elements(vector, given.source if isinstance(given, Linear) else given)
        )
        self._refuse_doubles()
        self._from: dict[str, list[Connection]] = {name: [] for name in self.slaves}
        for connection in self._wires:
            self._from[connection.source].append(connection)

    def _resized(self) -> None:
        """Wire anew when that is asked for next: a structural parameter has changed the sizes of a slave's arrays."""
        self._wired = False

    @property
    def connections(self) -> tuple[Connection, ...]:
        """All connections, of scalars.

        Raises
        ------
        MisfitError
            If what is connected does not fit any more, for structural parameters have been set since.
        """
        if not self._wired:
            self._wire()
        return self._wires

    @property
    def _outputs(self) -> dict[str, tuple[Slave, str]]:
        if not self._wired:
            self._wire()
        return self._all

    def with_slaves(self, others: Mapping[str, Slave]) -> System:
        """Return the system with others in the place of slaves, by name, that have the same variables."""
        made = copy.copy(self)
        made.slaves = {name: others.get(name, slave) for name, slave in self.slaves.items()}
        made._all = {name: (made.slaves[slave.name], port) for name, (slave, port) in self._outputs.items()}
        return made

    @property
    def most_rounds(self) -> int:
        """How often signals are carried until they must have settled: a chain of n needs n, and one to see it."""
        return len(self.slaves) + 1 + self.loop_iterations

    def settled(self, value: Any, before: Any) -> bool:
        """Return whether a signal has come to rest; in loops that are iterated, to rounding."""
        if not self.loop_iterations or not isinstance(value, float) or not isinstance(before, float):
            return bool(value == before)
        return abs(value - before) <= SETTLED * max(abs(value), abs(before))

    def from_slave(self, name: str) -> list[Connection]:
        """Return the connections that start at a slave."""
        if not self._wired:
            self._wire()
        return self._from[name]

    def is_continuous(self, connection: Connection) -> bool:
        """Return whether a connection carries a number that changes along flows."""
        output = self.slaves[connection.source].outputs[connection.output]
        into = self.slaves[connection.target].inputs[connection.input]
        return not output.discrete and not into.discrete and into.kind == "number" and not into.whole

    @property
    def output_names(self) -> list[str]:
        """Names of all outputs, ``slave.output``."""
        return list(self._outputs)

    def get(self, name: str) -> Any:
        """Return the present value of the output ``slave.output``.

        Raises
        ------
        MisfitError
            If there is none of that name.
        """
        slave, port = self.output(name)
        return slave.get(port)

    def reader(self, names: Sequence[str]) -> Callable[[], list[Any]]:
        """Return what gives the present values of outputs, ``slave.output``, of a system that has been started.

        Raises
        ------
        MisfitError
            If there is none of a name.
        """
        outputs: dict[Slave, dict[int, str]] = {}
        for k, name in enumerate(names):
            slave, port = self.output(name)
            outputs.setdefault(slave, {})[k] = port
        readers = [slave.reader(list(ports.values())) for slave, ports in outputs.items()]
        places = [k for ports in outputs.values() for k in ports]
        order = sorted(range(len(places)), key=places.__getitem__)
        if len(readers) == 1:
            return readers[0]
        read_all = reading_round(readers) or (lambda: [value for read_slave in readers for value in read_slave()])
        if places == sorted(places):
            return read_all

        def read() -> list[Any]:
            values = read_all()
            return [values[k] for k in order]

        return read

    def settable(self, name: str) -> tuple[str, str]:
        """Return the slave and the variable that ``slave.variable`` names, if somebody outside may set it in a run.

        Raises
        ------
        MisfitError
            If it is neither an input without a connection nor a tunable parameter.
        """
        slave, variable = self.owner(name)
        driving = next((c for c in self.connections if (c.target, c.input) == (slave.name, variable)), None)
        if driving is not None:
            raise MisfitError(f"{name} cannot be given a value, for {driving} drives it: leave one of them out.")
        if variable not in slave.inputs and variable not in slave.tunable:
            known = ", ".join([*slave.inputs, *slave.tunable]) or "none"
            raise MisfitError(
                f"{name} is neither an input nor a tunable parameter, so it cannot be set in a run; those of "
                f"{slave.name} are {known}."
            )
        return slave.name, variable

    def full_name(self, name: str) -> str:
        """Return ``slave.variable`` for a name, which need not name the slave where there is one."""
        single = next(iter(self.slaves.values())) if len(self.slaves) == 1 else None
        if single is not None and (single.has(name) or not name.startswith(f"{single.name}.")):
            return f"{single.name}.{name}"
        return name

    def elements(self, name: str) -> list[str]:
        """Return the elements of the array ``slave.variable``, in order; none for a scalar."""
        slave, variable = self.owner(name)
        if variable in slave.variable_names:
            return []
        return [f"{slave.name}.{e}" for e in slave.variable_names if e.startswith(f"{variable}[")]

    @property
    def arrays(self) -> dict[str, str]:
        """Name of each output that is an element of an array -> the array's."""
        return {
            name: f"{slave.name}.{slave.outputs[port].array}"
            for name, (slave, port) in self._outputs.items()
            if slave.outputs[port].array
        }

    def close(self) -> None:
        """Free everything the slaves hold, of each whatever happens to the others."""
        with contextlib.ExitStack() as stack:
            for slave in self.slaves.values():
                stack.callback(slave.close)

    def output(self, name: str) -> tuple[Slave, str]:
        """Return the slave and its own name of the output ``slave.output``.

        Raises
        ------
        MisfitError
            If there is none of that name.
        """
        if name not in self._outputs:
            raise MisfitError(f"{name!r} is not an output; the outputs are {', '.join(self._outputs)}.")
        return self._outputs[name]

    def _connection(self, target: str, source: str, given: Source) -> Connection:
        into, input_port = self._find(target, "input")
        out_of, output_port = self._find(source, "output")
        as_it_is = isinstance(given, Linear) and not given.converted
        factor, offset = (1.0, 0.0) if as_it_is else _conversion(source, output_port, target, input_port)
        _require_type(source, output_port, target, input_port)
        if input_port.discrete and not output_port.discrete:
            raise MisfitError(
                f"{source} changes along flows, but {target} is a discrete input, which may change only at events: "
                "sample the signal first."
            )
        if isinstance(given, Linear) and (given.factor, given.offset) != (1.0, 0.0):
            if output_port.kind != "number" or input_port.whole:
                raise MisfitError(f"{source} -> {target} is scaled, and does not carry numbers with a fraction.")
            factor, offset = given.factor * factor, given.factor * offset + given.offset
        return Connection(out_of.name, output_port.name, into.name, input_port.name, factor, offset)

    def _refuse_doubles(self) -> None:
        driven: dict[tuple[str, str], Connection] = {}
        for connection in self._wires:
            first = driven.setdefault((connection.target, connection.input), connection)
            if first is not connection:
                raise MisfitError(f"{first} and {connection} drive one input: leave one of them out.")

    def _find(self, scoped: str, what: str) -> tuple[Slave, Port]:
        ports = self._ports(scoped, what)
        name = self.owner(scoped)[1]
        if name not in ports:
            owner = self.owner(scoped)[0].name
            raise MisfitError(f"{scoped} is not an {what}; the {what}s of {owner} are {', '.join(ports) or 'none'}.")
        return self.owner(scoped)[0], ports[name]

    def owner(self, scoped: str) -> tuple[Slave, str]:
        """Return the slave of ``slave.variable`` and the variable's own name.

        Raises
        ------
        MisfitError
            If it names no slave.
        """
        owner = next((n for n in sorted(self.slaves, key=len, reverse=True) if scoped.startswith(n + ".")), None)
        if owner is None:
            raise MisfitError(f"{scoped!r} names no slave; the slaves are {', '.join(self.slaves)}.")
        return self.slaves[owner], scoped[len(owner) + 1 :]

    def _ports(self, scoped: str, what: str) -> Mapping[str, Port]:
        slave = self.owner(scoped)[0]
        return slave.inputs if what == "input" else slave.outputs

    def _elements(self, target: str, sources: str | Sequence[str]) -> list[tuple[str, str]]:
        """Return the elements of an input with the outputs they are connected to."""
        places = self._places(target, "input")
        if not sources and not places and self.owner(target)[1] not in self._ports(target, "input"):
            return []  # an array without elements, such as the broadcasts that an agent without neighbours hears
        if not isinstance(sources, str):
            self._require_one_each(target, places, sources)
            return [(target + place, source) for place, source in zip(places, sources, strict=True)]
        given = self._places(sources, "output")
        if not places and not given:
            return [(target, sources)]
        if places != given:
            raise MisfitError(
                f"{target} has {_number(places)} and {sources} {_number(given)}: connect arrays of one shape, or name "
                "the output of each element in a list."
            )
        return [(target + place, sources + place) for place in places]

    def _require_one_each(self, target: str, places: Sequence[str], sources: Sequence[str]) -> None:
        """Refuse a list of outputs that is not one for each element: those left out would stand still unnoticed."""
        given = f"a list of {len(sources)} output{'s' * (len(sources) != 1)}"
        if not places:
            self._find(target, "input")
            raise MisfitError(f"{target} is no array, but is given {given}: name one output, not in a list.")
        if len(places) == len(sources):
            return
        raise MisfitError(
            f"{target} has {len(places)} elements, {places[0]} to {places[-1]}, but is given {given}: name one for "
            f'each element, or drive single ones, as "{target}{places[0]}".'
        )

    def _places(self, scoped: str, what: str) -> list[str]:
        """Return the places of an array's elements, ``[1]``, in order; none for a scalar."""
        _, name = self.owner(scoped)
        ports = self._ports(scoped, what)
        if name in ports:
            return []
        return [port[len(name) :] for port in ports if port.startswith(name + "[")]


def _conversion(source: str, output: Port, target: str, input_: Port) -> tuple[float, float]:
    """Return factor and offset from the unit of an output to that of an input.

    Raises
    ------
    MisfitError
        If both have units, and there is none.
    """
    if not output.unit or not input_.unit or output.unit == input_.unit:
        return 1.0, 0.0
    given, wanted = output.measure, input_.measure
    known = given is not None and wanted is not None
    found = given.converted_to(wanted) if given is not None and wanted is not None else None
    if found is None:
        why = "they measure differently" if known else "both are not declared in SI base units"
        raise MisfitError(
            f"{source} is in {output.unit!r}, but {target} is in {input_.unit!r}, and {why}: convert one."
        )
    return found


def _require_type(source: str, output: Port, target: str, input_: Port) -> None:
    carries, takes = _TYPES[output.kind, output.whole], _TYPES[input_.kind, input_.whole]
    alike = output.kind == input_.kind or {output.kind, input_.kind} == {"number", "truth"}
    # Whole numbers may be truth values, which each value shows; fractions are none of either.
    if not alike or (takes in ("whole numbers", "truth values") and carries == "numbers"):
        raise MisfitError(f"{source} carries {carries}, but {target} takes {takes}.")


def _number(places: Sequence[str]) -> str:
    return f"the elements {places[0]} to {places[-1]}" if places else "no elements"


def require_system(caller: str, given: object) -> None:
    """Refuse what is no system where a master wants one.

    Raises
    ------
    MisfitError
        With what to write.
    """
    if not isinstance(given, System):
        raise MisfitError(
            f"{caller} was given a {type(given).__name__}: write {caller}(System(slaves, connections), t_stop)."
        )
