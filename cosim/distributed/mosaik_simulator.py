"""A system as a simulator of mosaik: FMUs, systems in files, and the agents of scenarios as entities."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import mosaik_api_v3

from cosim.consensus import in_process_system
from cosim.distributed.stepwise import StepwiseRun
from cosim.errors import CosimError, MisfitError
from cosim.system import System
from cosim.systems.assembly import assemble, set_start
from cosim.systems.files import read_system
from hybrid_model.consensus.scenario.files import load_scenario

MODEL = "System"


class SystemSimulator(mosaik_api_v3.Simulator):  # type: ignore[misc]
    """What `hybrid-fmu cosim` takes, in a scenario of mosaik (API 3, hybrid simulators).

    ``world.start(..., source="Tank.fmu", step=0.1, stop_time=10.0)`` reads a system: an FMU, a folder, a system in a
    file, or a scenario, whose agents run in this process. ``System.create(1)`` makes it; its children are the slaves,
    one entity each, with their outputs, inputs and tunable parameters. ``start={"slave.variable": value}`` gives start
    values.

    At a step the system goes on to that time with the inputs that it has had, events between at their exact times, and
    takes the new ones there. It asks for the next step after `step` s, or when its next event is foreseen if that is
    before, rounded up to mosaik's whole steps.
    """

    def __init__(self) -> None:
        super().__init__({"api_version": "3.0", "type": "hybrid", "models": {}})
        self._runs: dict[str, tuple[StepwiseRun, System]] = {}
        self._entities: dict[str, tuple[str, str]] = {}

    def init(
        self,
        sid: str,
        time_resolution: float = 1.0,
        *,
        source: str,
        step: float | None = None,
        stop_time: float | None = None,
    ) -> Any:
        """Read the system.

        Parameters
        ----------
        sid : str
        time_resolution : float
            In s: what one of mosaik's steps is.
        source : str
        step : float, optional
            Between two steps, in s; default: one of mosaik's.
        stop_time : float, optional
            In s; default: what the system proposes.
        """
        self._resolution, self._source = time_resolution, source
        self._every = max(round((step or time_resolution) / time_resolution), 1)
        system, proposed = self._assembled()
        t_stop = proposed if stop_time is None else stop_time
        if t_stop is None:
            raise CosimError(f"{source} proposes no stop time: give stop_time.")
        self._t_stop = t_stop
        models = self.meta["models"]
        models[MODEL] = {"public": True, "params": ["start"], "attrs": []}
        for name, slave in system.slaves.items():
            inputs = [*slave.inputs, *slave.tunable]
            attributes = [*slave.outputs, *(own for own in inputs if own not in slave.outputs)]
            models[name] = {"public": False, "params": [], "attrs": attributes, "trigger": list(slave.inputs)}
        return self.meta

    def create(self, num: int, model: str, start: Mapping[str, Any] | None = None) -> Any:
        """Make systems; each is an entity with one child a slave."""
        made = []
        for _ in range(num):
            system, eid = self._assembled()[0], f"{MODEL.lower()}-{len(self._runs)}"
            for name, value in (start or {}).items():
                slave, variable = system.owner(name)
                set_start(slave, variable, value)
            self._runs[eid] = StepwiseRun(system, 0.0, self._t_stop), system
            children = []
            for name in system.slaves:
                child = name if len(self._runs) == 1 else f"{eid}/{name}"
                self._entities[child] = eid, name
                children.append({"eid": child, "type": name})
            made.append({"eid": eid, "type": MODEL, "children": children})
        return made

    def step(self, time: int, inputs: Mapping[str, Any], max_advance: int) -> int:
        """Go on to a time of mosaik, and take the inputs of then."""
        t = time * self._resolution
        for run, _ in self._runs.values():
            run.advance_to(min(t, self._t_stop))
        for entity, given in inputs.items():
            eid, slave = self._entities[entity]
            values = {name: self._one(f"{entity}.{name}", sources) for name, sources in given.items()}
            self._runs[eid][0].set(slave, values)
        due = min((run.next_event for run, _ in self._runs.values()), default=math.inf)
        event = math.ceil(due / self._resolution * (1.0 - 1e-12)) if math.isfinite(due) else time + self._every
        return min(time + self._every, max(event, time + 1))

    def get_data(self, outputs: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
        """Return outputs."""
        data: dict[str, dict[str, Any]] = {}
        for entity, names in outputs.items():
            eid, slave = self._entities[entity]
            data[entity] = {name: self._runs[eid][1].slaves[slave].get(name) for name in names}
        return data

    def finalize(self) -> None:
        """Free everything."""
        for _, system in self._runs.values():
            system.close()
        self._runs.clear()

    def _assembled(self) -> tuple[System, float | None]:
        definition = read_system(self._source)
        if definition is None:
            scenario = load_scenario(self._source)
            return in_process_system(scenario), scenario.stop_time
        system = assemble(definition)
        proposed = [slave.default_stop_time for slave in system.slaves.values() if slave.default_stop_time is not None]
        return system, definition.experiment.stop_time or max(proposed, default=None)

    @staticmethod
    def _one(name: str, sources: Mapping[str, Any]) -> Any:
        if len(sources) > 1:
            raise MisfitError(f"{' and '.join(sources)} drive one input, {name}: leave one of them out.")
        return next(iter(sources.values()))
