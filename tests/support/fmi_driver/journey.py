"""Going on with an instance of any version and kind, from wherever it is, to a later time."""

from fmi_driver.binary import DISCARD, OK
from fmi_driver.component import Component
from fmi_driver.exchange import Exchange

SETTINGS = {
    "2.0 CS": {"fmi": "2.0", "kind": "cs"},
    "2.0 ME": {"fmi": "2.0", "kind": "me"},
    "3.0 CS": {"fmi": "3.0", "kind": "cs", "events": True, "early": True},
    "3.0 CS, events inside": {"fmi": "3.0", "kind": "cs", "events": True},
    "3.0 CS without events": {"fmi": "3.0", "kind": "cs"},
    "3.0 ME": {"fmi": "3.0", "kind": "me"},
}


def instance(binary, label, **options):
    """An instance of a setting, which wants the binary of its version."""
    return Component(binary, **{name: value for name, value in (SETTINGS[label] | options).items() if name != "fmi"})


class Journey:
    """A component that has been initialised, on its way; for Model Exchange with an importer that integrates.

    With `obey` no step goes beyond the next event time that the FMU has announced.
    """

    def __init__(self, component, t_start=0.0, t_stop=None, *, obey=False, **start):
        self.component, self.obey = component, obey
        component.initialize(t_start, t_stop, **start)
        self.t, self.update, self.over = t_start, None, False
        if component.starts_in_event_mode:
            self.settle()
        self.exchange = Exchange(component) if component.kind == "me" else None

    def place(self):
        return self.t, self.update, self.over

    def go_to_place(self, place):
        self.t, self.update, self.over = place

    def settle(self):
        self.update = self.component.settle()
        self.over = self.update.terminate

    def set_inputs(self, **values):
        """At an event, where the instance knows of events."""
        mode = self.component.starts_in_event_mode
        if mode:
            self.component.do("EnterEventMode")
        for name, value in values.items():
            self.component.set(name, value)
        if mode:
            self.settle()

    def go_to(self, t):
        """On to a time, or to the end of the run; everything that can be seen then."""
        if self.over:
            return "over"
        if self.exchange is not None:
            self._integrate(t)
        while not self.over and self.t < t:
            self._step(t)
        return self.t, self.over, self.component.values()

    def _integrate(self, t):
        record = self.exchange.run([self.t, t], self.update)
        self.t, self.update, self.over = self.exchange.t, self.exchange.update, record.ended

    def _step(self, t):
        announced = self.update.next_time if self.obey else None
        end = t if announced is None else min(t, max(announced, self.t))
        target = self.t + (end - self.t)  # what the FMU can know of the target: differences of floats round
        found = self.component.step(self.t, end - self.t)
        assert found.status in (OK, DISCARD), self.component.log[-3:]
        assert self.t <= found.time <= target
        assert found.early or found.terminate or found.time == target
        # Only an event may stand at the very beginning of a step.
        assert found.time > self.t or found.event or found.terminate
        self.t, self.over = found.time if found.time < target else end, found.terminate
        if self.component.events and (found.event or self.t == announced):
            self.component.do("EnterEventMode")
            self.settle()
