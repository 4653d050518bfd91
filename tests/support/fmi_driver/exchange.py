"""An importer of FMUs for Model Exchange, as the standard asks for one: it integrates, and locates events itself."""

import ctypes as c
from typing import NamedTuple

import numpy as np

from fmi_driver.binary import OK

STEP = 2e-3
"""Classical Runge-Kutta steps: an error of about 1e-11 in a second for flows of frequency 7 and below."""


class Record(NamedTuple):
    """Samples (t, x), the times of entries into Event Mode with a jump, without one, and whether it was ended."""

    samples: list
    events: list
    idle: list
    ended: bool


class Exchange:
    """Integrates an instance for Model Exchange.

    Parameters
    ----------
    component : Component
        Made for Model Exchange.
    short : float
        Stops so much before each state event, as a part of the time of the run.
    watch : bool
        Look at the event indicators; otherwise only at what fmi*CompletedIntegratorStep says.
    by_name : bool
        Set states one by one by the functions for variables, not by fmi*SetContinuousStates.
    """

    def __init__(self, component, *, short=0.0, watch=True, by_name=False):
        self.component, self.short, self.watch, self.by_name = component, short, watch, by_name
        self.binary = component.binary
        self.n = self.binary.n_states
        self.n_indicators = len(component.binary.description.eventIndicators or ())
        if self.binary.version == 2:
            self.n_indicators = self.binary.description.numberOfEventIndicators
        self.t, self.update = 0.0, None

    def put(self, t, x):
        if not self.by_name:
            self.component.be_at(t, x)
            return
        self.component.do("SetTime", c.c_double(t))
        for name, value in zip(self.binary.state_elements, x, strict=True):
            self.component.set(name, value)

    def flow(self, t, x):
        self.put(t, x)
        status, rates = self.component.vector("GetContinuousStateDerivatives", self.n)
        assert status == OK, self.component.log[-3:]
        return np.array(rates)

    def states(self):
        status, x = self.component.vector("GetContinuousStates", self.n)
        assert status == OK
        return np.array(x)

    def indicators(self, t, x):
        self.put(t, x)
        status, z = self.component.vector("GetEventIndicators", self.n_indicators)
        assert status == OK, self.component.log[-3:]
        return np.array(z)

    def reach(self, x, k1, h):
        k2 = self.flow(self.t + h / 2, x + h / 2 * k1)
        k3 = self.flow(self.t + h / 2, x + h / 2 * k2)
        k4 = self.flow(self.t + h, x + h * k3)
        return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def crossing(self, x, k1, target, before):
        """The first time at which an indicator is in another domain, to the last bit, and the state there."""
        early, late = self.t, target
        while late - early > 2 * np.spacing(max(abs(early), abs(late))):
            middle = (early + late) / 2
            if ((self.indicators(middle, self.reach(x, k1, middle - self.t)) > 0) != before).any():
                late = middle
            else:
                early = middle
        late = max(late * (1 - self.short), self.t)
        return late, self.reach(x, k1, late - self.t)

    def run(self, points, update, changes=()):
        """Integrate through increasing points, from just after initialisation and its event iteration.

        `changes` are inputs to be set at points: (time, name, value).
        """
        component, samples, events, idle = self.component, [], [], []
        self.update = update
        self.t, x = points[0], self.states()
        samples.append((self.t, x))
        for point in points[1:]:
            while self.t < point:
                target = min(point, self.t + STEP)
                if self.update.next_time is not None:
                    target = min(target, self.update.next_time)
                k1 = self.flow(self.t, x)
                before = self.indicators(self.t, x) > 0
                new = self.reach(x, k1, target - self.t)
                found = self.watch and ((self.indicators(target, new) > 0) != before).any()
                if found:
                    target, new = self.crossing(x, k1, target, before)
                self.t, x = target, new
                self.put(self.t, x)
                status, event, terminate = component.completed()
                assert status == OK
                if terminate:
                    return Record(samples, events, idle, True)
                here = [change for change in changes if change[0] == self.t]
                if found or event or here or self.t == self.update.next_time:
                    component.do("EnterEventMode")
                    for _, name, value in here:
                        component.set(name, value)
                    n_jumps = len(component.jumps)
                    self.update = component.settle()
                    (events if len(component.jumps) > n_jumps else idle).append(self.t)
                    if self.update.terminate:
                        return Record(samples, events, idle, True)
                    new = self.states()
                    assert self.update.states_changed or (new == x).all()
                    x = new
            samples.append((self.t, x))
        return Record(samples, events, idle, False)
