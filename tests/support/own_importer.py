"""An importer of our own: it integrates the FMU of Model Exchange itself, and steps that of Co-Simulation of FMI 2.0.

Nothing of the exporter's numerics is used: steps and dense output are SciPy's DOP853, events are located by bisection
on the event indicators. Which jump is taken when is read from the FMU's log, category logEvents.
"""

import ctypes
import itertools
import math
import re
import shutil
from dataclasses import dataclass, field

import fmpy
import numpy as np
from fmi_driver.binary import elements
from fmpy.fmi2 import FMU2Model, FMU2Slave, addLoggerProxy, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Model
from scipy.integrate import DOP853

JUMP = re.compile(r"'(.*)' jumps at t = (\S+)\.")
# Points within a step of the solver at which the indicators are read: two crossings between two points go unseen.
POINTS_PER_STEP = 24
# The integrator's tolerances: two digits below what states and times are compared with.
RTOL, ATOL = 1e-12, 1e-13


@dataclass
class Run:
    """Jumps (time, name) as they were taken, and the values of all variables at the sample times."""

    jumps: list = field(default_factory=list)
    times: list = field(default_factory=list)
    values: dict = field(default_factory=dict)
    n_steps: int = 0


class Importer:
    """An instance of an FMU over fmpy's low-level classes, in either version; use it in a `with` statement."""

    def __init__(self, path, kind):
        self.description = fmpy.read_model_description(str(path))
        self.fmi2 = self.description.fmiVersion == "2.0"
        self.folder = fmpy.extract(str(path))
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self.elements = {name: place for v in self.variables.values() for name, place in elements(v)}
        self.run = Run()
        self.messages = []
        known = {(True, "me"): FMU2Model, (False, "me"): FMU3Model, (True, "cs"): FMU2Slave}
        interface = self.description.modelExchange if kind == "me" else self.description.coSimulation
        self.fmu = known[self.fmi2, kind](
            guid=self.description.guid if self.fmi2 else self.description.instantiationToken,
            unzipDirectory=self.folder,
            modelIdentifier=interface.modelIdentifier,
            instanceName="block",
        )
        if self.fmi2:
            self.callbacks = fmi2CallbackFunctions()
            self.callbacks.logger = fmi2CallbackLoggerTYPE(lambda e, name, status, category, text: self.log(text))
            addLoggerProxy(ctypes.byref(self.callbacks))
            self.fmu.instantiate(callbacks=self.callbacks, loggingOn=True)
        else:
            self.fmu.instantiate(loggingOn=True, logMessage=lambda e, status, category, text: self.log(text))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)

    def log(self, text):
        text = text.decode()
        self.messages.append(text)
        found = JUMP.search(text)
        if found:
            self.run.jumps.append((float(found[2]), found[1]))

    def initialize(self, t_stop, **start):
        for name, value in start.items():
            self.set(name, value)
        if self.fmi2:
            self.fmu.setupExperiment(startTime=0.0, stopTime=t_stop)
            self.fmu.enterInitializationMode()
        else:
            self.fmu.enterInitializationMode(startTime=0.0, stopTime=t_stop)
        self.fmu.exitInitializationMode()

    def get(self, name):
        whole, index = self.elements[name]
        variable = self.variables[whole]
        size = () if self.fmi2 else (math.prod(variable.shape or ()),)
        return getattr(self.fmu, f"get{variable.type}")([variable.valueReference], *size)[index]

    def set(self, name, value):
        variable = self.variables[name]
        whole = variable.type in ("Int32", "Integer")
        getattr(self.fmu, f"set{variable.type}")([variable.valueReference], [round(value) if whole else value])

    def sample(self, t, names):
        self.run.times.append(t)
        for name in names:
            self.run.values.setdefault(name, []).append(float(self.get(name)))


def changes_by_time(steps):
    """Inputs as steps, name -> ((t, value), ...), as t -> {name: value}."""
    found = {}
    for name, rows in steps.items():
        for t, value in rows:
            found.setdefault(t, {})[name] = value
    return found


def step_through(path, t_stop, points, *, steps=None, names=(), start=None):
    """Run an FMU of Co-Simulation for FMI 2.0 through communication points; inputs change at some of them."""
    changes = changes_by_time(steps or {})
    every = sorted({0.0, t_stop, *points, *(t for t in changes if t < t_stop)})
    with Importer(path, "cs") as importer:
        importer.initialize(t_stop, **(start or {}))
        if 0.0 in points:
            importer.sample(0.0, names)
        for t, t_next in itertools.pairwise(every):
            for name, value in changes.get(t, {}).items():
                importer.set(name, value)
            importer.fmu.doStep(t, t_next - t)
            importer.run.n_steps += 1
            if t_next in points:
                importer.sample(t_next, names)
        importer.fmu.terminate()
        return importer.run


def exchange(path, t_stop, points, *, steps=None, names=(), start=None):
    """Run an FMU of Model Exchange: integrate, watch the indicators, obey the time events, handle the events."""
    with Importer(path, "me") as importer:
        importer.initialize(t_stop, **(start or {}))
        return Exchange(importer, t_stop, points, changes_by_time(steps or {}), names).go()


class Exchange:
    """The integrator's part of Model Exchange, from the end of Initialization Mode on."""

    def __init__(self, importer, t_stop, points, changes, names):
        self.importer, self.fmu = importer, importer.fmu
        self.t_stop, self.names = t_stop, names
        self.points = sorted(points)
        self.changes = sorted(changes.items())
        description = importer.description
        if importer.fmi2:
            self.n = sum(v.derivative is not None for v in description.modelVariables)
            self.n_indicators = description.numberOfEventIndicators or 0
            self.get_rates = self.fmu.getDerivatives
        else:
            self.n = self.fmu.getNumberOfContinuousStates()
            self.n_indicators = self.fmu.getNumberOfEventIndicators()
            self.get_rates = self.fmu.getContinuousStateDerivatives
        self.update = self.fmu.newDiscreteStates if importer.fmi2 else self.fmu.updateDiscreteStates
        self.buffers = [(ctypes.c_double * max(n, 1))() for n in (self.n, self.n, self.n_indicators)]
        self.t, self.x, self.next_event = 0.0, None, math.inf

    def go(self):
        self.iterate()
        while True:
            self.fmu.enterContinuousTimeMode()
            self.x = self.states()
            # Sampled after the events of an instant, as the reference is.
            while self.points and self.points[0] == self.t:
                self.importer.sample(self.points.pop(0), self.names)
            if self.t >= self.t_stop:
                return self.importer.run
            self.flow()
            self.fmu.enterEventMode()
            if self.changes and self.changes[0][0] == self.t:
                for name, value in self.changes.pop(0)[1].items():
                    self.importer.set(name, value)
            self.iterate()

    def iterate(self):
        """Event iteration, until the FMU needs no more."""
        for _ in range(1000):
            again, terminate, _, _, defined, time = self.update()
            assert not terminate, self.importer.messages
            if not again:
                self.next_event = time if defined else math.inf
                return
        raise AssertionError("1000 event iterations")

    def states(self):
        self.fmu.getContinuousStates(self.buffers[0], self.n)
        return np.array(self.buffers[0][: self.n])

    def go_to(self, t, x):
        self.fmu.setTime(t)
        self.buffers[0][: self.n] = list(x)
        self.fmu.setContinuousStates(self.buffers[0], self.n)

    def rates(self, t, x):
        self.go_to(t, x)
        self.get_rates(self.buffers[1], self.n)
        return np.array(self.buffers[1][: self.n])

    def domain(self, t, x):
        """On which side of zero each indicator is: jump sets contain their boundary."""
        self.go_to(t, x)
        self.fmu.getEventIndicators(self.buffers[2], self.n_indicators)
        return [value >= 0.0 for value in self.buffers[2][: self.n_indicators]]

    def flow(self):
        """Integrate to the next event, or to the end; `t` and `x` are those of the arrival."""
        limit = min(self.t_stop, self.next_event, self.changes[0][0] if self.changes else math.inf)
        before = self.domain(self.t, self.x)
        for t, at in self.solver_steps(limit):
            self.importer.run.n_steps += 1
            for left, right in itertools.pairwise(np.linspace(self.t, t, POINTS_PER_STEP + 1)):
                if self.domain(right, at(right)) != before:
                    arrival = self.locate(at, left, right, before)
                    self.arrive(arrival, at)
                    return
            self.arrive(t, at)
            event, terminate = self.fmu.completedIntegratorStep()
            assert not terminate
            if event:
                return

    def solver_steps(self, limit):
        """Yield the end of each step of the solver up to `limit`, and the states within it."""
        if self.n == 0:
            yield limit, lambda t: np.empty(0)
            return
        with np.errstate(over="ignore"):
            solver = DOP853(self.rates, self.t, self.x, limit, rtol=RTOL, atol=ATOL)
            while solver.status == "running":
                failure = solver.step()
                assert solver.status != "failed", failure
                yield solver.t, solver.dense_output()

    def locate(self, at, left, right, before):
        """Bisect to the first point at which an indicator has changed its side."""
        while right - left > 4.0 * np.spacing(right):
            middle = 0.5 * (left + right)
            if self.domain(middle, at(middle)) == before:
                left = middle
            else:
                right = middle
        return right

    def arrive(self, t, at):
        """Sample on the way, and be at `t`."""
        while self.points and self.points[0] < t:
            point = self.points.pop(0)
            self.go_to(point, at(point))
            self.importer.sample(point, self.names)
        self.t, self.x = float(t), at(t)
        self.go_to(self.t, self.x)
