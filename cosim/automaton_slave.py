"""An automaton in this process behind the slave interface."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.errors import CosimError, MisfitError
from cosim.measure import Measure
from cosim.slave import Port, Slave
from fmu.importer.values import Value
from fmu.standard.units import base_unit
from hybrid_model import Automaton, Execution, Solver, ZenoGuard
from hybrid_model.declare.arguments import require_automaton, require_choice
from hybrid_model.declare.calls import explained
from hybrid_model.declare.layout import Layout, layout_of
from hybrid_model.declare.signals import Inputs
from hybrid_model.declare.variables import Kind, element_names
from hybrid_model.errors import BuildError, SchedulingError, TraceError
from hybrid_model.reference.first_look import checked
from hybrid_model.schedule.automaton_block import AutomatonBlock
from hybrid_model.schedule.blocks import Step, Update
from hybrid_model.simulate import ENGINES

if TYPE_CHECKING:
    from hybrid_model.schedule.joined_blocks import JoinedBlocks
    from hybrid_model.schedule.native_block import NativeBlock


class AutomatonSlave(Slave):
    """An automaton that a master steps, with the same outside as its FMU.

    Parameters
    ----------
    name : str
        Name in the system.
    automaton : Automaton
        What runs.
    solver : Solver, optional
        Accuracy.
    engine : {"auto", "native", "python"}
        As in `hybrid_model.simulate`.

    Attributes
    ----------
    automaton : Automaton
    starts : dict
        What was set before the start, by scalar.
    """

    has_event_mode = True
    can_restore = True
    tells_jumps = True

    @explained(CosimError)
    def __init__(self, name: str, automaton: Automaton, solver: Solver | None = None, *, engine: str = "auto") -> None:
        require_choice("engine", engine, ENGINES)
        require_automaton("AutomatonSlave", automaton)
        layout = layout_of(automaton)
        ports: dict[Kind, list[Port]] = {kind: [] for kind in Kind}
        for variable in automaton.variables:
            discrete = variable.discrete or variable.kind is Kind.DISCRETE
            elements = element_names(variable)
            array = "" if elements == [variable.name] else variable.name
            ports[variable.kind] += [
                Port(
                    name,
                    variable.unit,
                    discrete,
                    whole=variable.integer,
                    array=array,
                    measure=_measure(variable.unit),
                    nominal=variable.nominal or 0.0,
                )
                for name in elements
            ]
        outputs = [
            port
            for kind in (Kind.OUTPUT, Kind.STATE, Kind.DISCRETE)
            for port in ports[kind]
            if kind is Kind.OUTPUT or _is_output(automaton, port.name)
        ]
        tunable = [e for v in automaton.of_kind(Kind.PARAMETER) if v.tunable for e in element_names(v)]
        super().__init__(name, ports[Kind.INPUT], outputs, [clock.name for clock in automaton.clocks], tunable)
        self.automaton = automaton
        self._solver, self._engine = solver or Solver(), engine
        self._whole = {e for v in automaton.variables if v.integer for e in element_names(v)}
        self._ranges = {e: (v.minimum, v.maximum) for v in automaton.variables for e in element_names(v)}
        self._computed = set(layout.names(Kind.OUTPUT))
        self._names = [element for kind in Kind for element in layout.names(kind)]
        self._predictable = all(port.discrete for port in ports[Kind.INPUT])
        self.starts: dict[str, float] = {}
        self._block: AutomatonBlock | NativeBlock | None = None
        self._joined: JoinedBlocks | None = None
        self._begun = False
        self.why_python = 'it was asked for (engine="python")'
        """Why it runs in Python, if it does."""

    @property
    def variable_names(self) -> list[str]:
        """See `Slave.variable_names`."""
        return self._names

    def set(self, name: str, value: Value) -> None:
        """See `Slave.set`."""
        if name not in self._names:
            raise self.unknown(name)
        if name in self._computed:
            raise MisfitError(
                f"{self.name}.{name} is an output that the automaton computes: set what it is computed from, its "
                "parameters, inputs and states."
            )
        if isinstance(value, (str, bytes)):
            raise MisfitError(f"{self.name}.{name} is set to {value!r}: set a number.")
        if not np.isfinite(value):
            raise MisfitError(f"{self.name}.{name} is set to {value}: set a finite number.")
        if name in self._whole and value != round(value):
            raise MisfitError(f"{self.name}.{name} is set to {value}, but it is an integer: set a whole number.")
        if self._block is None or name in self.tunable:
            self._require_within(name, value)
        if self._begun and name not in self.inputs and name not in self.tunable:
            raise MisfitError(
                f"{self.name}.{name} is fixed once the run has begun: set it before, or declare a parameter with "
                "tunable=True."
            )
        if self._block is None:
            self.starts[name] = value
        elif self._joined is not None:
            self._joined.set(self.name, name, value)
        else:
            self._block.set(name, value)

    def get(self, name: str) -> float:
        """See `Slave.get`."""
        if name not in self._names:
            raise self.unknown(name)
        return self._running.get(name) if self._joined is None else self._joined.get(self.name, name)

    def start(self, t_start: float, t_stop: float, *, events: bool, early: bool = False) -> None:
        """See `Slave.start`."""
        self._block = self._block_of((t_start, t_stop), events=events)
        for name, value in self.starts.items():
            self._block.set(name, value)
        if isinstance(self._block, AutomatonBlock):
            self._block.run.compute_start()

    def _block_of(self, span: tuple[float, float], *, events: bool) -> AutomatonBlock | NativeBlock:
        # Nothing is recorded, so nothing grows with the number of jumps (rule 7).
        zeno = ZenoGuard(max_jumps=sys.maxsize)

        def run() -> Execution:
            inputs = Inputs(Layout(self.automaton))
            return Execution(
                self.automaton, t_start=span[0], t_stop=span[1], inputs=inputs, solver=self._solver, zeno=zeno
            )

        if self._engine != "python":
            # CasADi is imported by whoever runs something.
            from hybrid_model.schedule.native_block import NativeBlock

            try:
                return NativeBlock(
                    self.name,
                    self.automaton,
                    span,
                    Inputs(Layout(self.automaton)),
                    self._solver,
                    zeno,
                    predictable=self._predictable,
                    events=events,
                    check=lambda: checked(run()),
                )
            except (TraceError, BuildError) as error:
                self.why_python = str(error)
                if self._engine == "native":
                    raise CosimError(f"{self.name} cannot run on the native engine: {error}") from error
        return AutomatonBlock(self.name, run(), span[1], predictable=self._predictable, events=events, keep=False)

    def begin(self) -> None:
        """See `Slave.begin`."""
        if isinstance(self._block, AutomatonBlock):
            self._block.run.compute_start()
        self._running.begin()
        self._begun = True

    @property
    def native_block(self) -> NativeBlock | None:
        """What runs on the engine in C, if it does and has begun."""
        block = self._block
        return None if block is None or isinstance(block, AutomatonBlock) or not self._begun else block

    def join(self, joined: JoinedBlocks) -> None:
        """From now on the slave is one of those blocks: they are stepped together, and it is read and set."""
        self._joined = joined

    def enter_event_mode(self) -> None:
        """See `Slave.enter_event_mode`."""

    def enter_step_mode(self) -> None:
        """See `Slave.enter_step_mode`."""

    def update(self) -> Update:
        """See `Slave.update`."""
        return self._running.update()

    def step(self, t: float, t_next: float) -> Step:
        """See `Block.step`; CosimError if a part gets no further."""
        try:
            return self._running.step(t, t_next)
        except SchedulingError as error:
            raise CosimError(str(error)) from error

    def save(self) -> Any:
        """See `Block.save`."""
        return self._running.save()

    def restore(self, state: Any) -> None:
        """See `Block.restore`."""
        self._running.restore(state)

    def release(self, state: Any) -> None:
        """See `Block.release`."""

    def close(self) -> None:
        """See `Slave.close`."""
        self._block, self._joined, self._begun = None, None, False

    def _require_within(self, name: str, value: float) -> None:
        low, high = self._ranges[name]
        if (low is not None and value < low) or (high is not None and value > high):
            bound = f"below its minimum {low:g}" if low is not None and value < low else f"above its maximum {high:g}"
            raise MisfitError(f"{self.name}.{name} is set to {value}, {bound}: give a value in its range.")

    @property
    def _running(self) -> AutomatonBlock | NativeBlock:
        if self._block is None:
            raise CosimError(f"{self.name} has not been started: call start first.")
        return self._block


def _measure(unit: str) -> Measure | None:
    known = base_unit(unit) if unit else None
    return None if known is None else Measure(known.exponents, known.factor, known.offset)


def _is_output(automaton: Automaton, element: str) -> bool:
    return any(element in element_names(variable) and variable.output for variable in automaton.variables)
