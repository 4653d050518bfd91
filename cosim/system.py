"""A system of slaves wired by name, checked before anything runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cosim.errors import MisfitError
from cosim.slave import Port, Slave


@dataclass(frozen=True)
class Connection:
    """A scalar signal from an output to an input."""

    source: str
    output: str
    target: str
    input: str

    def __str__(self) -> str:
        return f"{self.source}.{self.output} -> {self.target}.{self.input}"


class System:
    """Slaves and their connections.

    Parameters
    ----------
    slaves : sequence of Slave
        With distinct names; the order is the order in which simultaneous events are handled.
    connections : mapping
        ``"slave.input"`` -> ``"slave.output"``, or a sequence of such names for the elements of a vector input; inputs
        not named keep their start values.

    Raises
    ------
    MisfitError
        For unknown names, two slaves of one name, units that differ, or a continuous signal on a discrete input.
    """

    def __init__(self, slaves: Sequence[Slave], connections: Mapping[str, str | Sequence[str]]) -> None:
        self.slaves = {slave.name: slave for slave in slaves}
        if len(self.slaves) < len(slaves):
            raise MisfitError(f"two slaves have one name among {[slave.name for slave in slaves]}: name them apart.")
        self._outputs = {f"{slave.name}.{port}": (slave, port) for slave in slaves for port in slave.outputs}
        self.connections = tuple(
            self._connection(target, source)
            for vector, sources in connections.items()
            for target, source in _elements(vector, sources)
        )
        self._refuse_doubles()
        self._from: dict[str, list[Connection]] = {name: [] for name in self.slaves}
        for connection in self.connections:
            self._from[connection.source].append(connection)

    def from_slave(self, name: str) -> list[Connection]:
        """Return the connections that start at a slave."""
        return self._from[name]

    @property
    def output_names(self) -> list[str]:
        """Names of all outputs, ``slave.output``."""
        return list(self._outputs)

    def get(self, name: str) -> float:
        """Return the present value of the output ``slave.output``.

        Raises
        ------
        MisfitError
            If there is none of that name.
        """
        if name not in self._outputs:
            raise MisfitError(f"{name!r} is not an output; the outputs are {', '.join(self._outputs)}.")
        slave, port = self._outputs[name]
        return slave.get(port)

    def close(self) -> None:
        """Free everything the slaves hold."""
        for slave in self.slaves.values():
            slave.close()

    def _connection(self, target: str, source: str) -> Connection:
        into, input_port = self._find(target, "input")
        out_of, output_port = self._find(source, "output")
        if input_port.unit and output_port.unit and input_port.unit != output_port.unit:
            raise MisfitError(
                f"{source} is in {output_port.unit!r}, but {target} is in {input_port.unit!r}: convert one."
            )
        if input_port.discrete and not output_port.discrete:
            raise MisfitError(
                f"{source} changes along flows, but {target} is a discrete input, which may change only at events: "
                "sample the signal first."
            )
        return Connection(out_of.name, output_port.name, into.name, input_port.name)

    def _refuse_doubles(self) -> None:
        driven: dict[tuple[str, str], Connection] = {}
        for connection in self.connections:
            first = driven.setdefault((connection.target, connection.input), connection)
            if first is not connection:
                raise MisfitError(f"{first} and {connection} drive one input: leave one of them out.")

    def _find(self, scoped: str, what: str) -> tuple[Slave, Port]:
        owner = next((n for n in sorted(self.slaves, key=len, reverse=True) if scoped.startswith(n + ".")), None)
        if owner is None:
            raise MisfitError(f"{scoped!r} names no slave; the slaves are {', '.join(self.slaves)}.")
        slave = self.slaves[owner]
        ports = slave.inputs if what == "input" else slave.outputs
        name = scoped[len(owner) + 1 :]
        if name not in ports:
            raise MisfitError(f"{scoped} is not an {what}; the {what}s of {owner} are {', '.join(ports) or 'none'}.")
        return slave, ports[name]


def _elements(target: str, sources: str | Sequence[str]) -> list[tuple[str, str]]:
    if isinstance(sources, str):
        return [(target, sources)]
    return [(f"{target}[{k}]", source) for k, source in enumerate(sources, start=1)]
