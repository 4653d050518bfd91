"""An FMU of Co-Simulation stepped through communication points, or by random calls."""

import random
from typing import NamedTuple

from fmi_driver.binary import OK


class Record(NamedTuple):
    """A run: outputs at the communication points, (time, clocks) of each event iteration, and how it ended."""

    samples: list
    ticks: list
    terminated: bool
    n_steps: int


def advance(instance, points, *, obey=False, changes=()):
    """Run an instance that has been initialised through increasing communication points.

    Parameters
    ----------
    instance : Component
        In Event Mode, or in Step Mode if it has no events: just initialised.
    points : sequence of float
        The first is the present time.
    obey : bool
        Make no step beyond the next event time that the FMU has announced.
    changes : sequence of (float, str, float)
        Inputs to be set at points.
    """
    t, ticks, samples, n_steps, update = points[0], [], [], 0, None
    if instance.events:
        found, update = instance.iterate()
        ticks += [(t, clocks) for clocks in found]
        if update.terminate:
            return Record(samples, ticks, True, n_steps)
        samples.append((t, tuple(map(instance.get, instance.binary.outputs))))
        instance.do("EnterStepMode")
    else:
        samples.append((t, tuple(map(instance.get, instance.binary.outputs))))
    for point in points[1:]:
        while t < point:
            announced = update.next_time if obey and update is not None else None
            target = point if announced is None else min(point, max(announced, t))
            result = instance.step(t, target - t)
            n_steps += 1
            assert result.status == OK, (t, target, instance.log[-3:])
            arrival = t + (target - t)  # what the FMU can know of the target: differences of floats round
            assert result.time <= arrival if result.early or result.terminate else result.time == arrival
            assert result.time >= t
            t = result.time if result.early or result.terminate else target
            if result.terminate:
                return Record(samples, ticks, True, n_steps)
            assert instance.events or not result.event
            here = [(name, value) for at, name, value in changes if at == t]
            if result.event or (instance.events and (here or t == announced)):
                instance.do("EnterEventMode")
                for name, value in here:
                    instance.set(name, value)
                found, update = instance.iterate()
                ticks += [(t, clocks) for clocks in found]
                if update.terminate:
                    return Record(samples, ticks, True, n_steps)
                instance.do("EnterStepMode")
            elif not instance.events:
                for name, value in here:
                    instance.set(name, value)
        samples.append((t, tuple(map(instance.get, instance.binary.outputs))))
    return Record(samples, ticks, False, n_steps)


class Walk:
    """An importer that can stop between any two calls: it goes on from where the instance is.

    What it does next is decided by what the instance is in, by `rng`, and by nothing else.
    """

    def __init__(self, instance, *, inputs=()):
        self.instance = instance
        self.inputs = inputs
        self.mode, self.t, self.over = "event" if instance.events else "step", instance.get("time"), False

    def copy_place(self):
        return self.mode, self.t, self.over

    def return_to(self, place):
        self.mode, self.t, self.over = place

    def call(self, rng):
        """One call; everything that can be seen after it, as exact numbers."""
        instance = self.instance
        if self.over:
            return ("over", instance.step(self.t, 0.1) if self.mode == "step" else None)
        if self.mode == "event":
            if self.inputs and rng.random() < 0.3:
                instance.set(rng.choice(self.inputs), rng.uniform(-0.1, 0.3))
            ticks = instance.ticks()
            seen = instance.update()
            self.over = seen.terminate
            if not seen.again and not seen.terminate:
                instance.do("EnterStepMode")
                self.mode = "step"
            return ticks, seen, instance.values()
        seen = instance.step(self.t, rng.choice([1e-3, 0.02, 0.11, 0.4]))
        assert seen.status == OK, instance.log[-3:]
        self.t, self.over = seen.time, seen.terminate
        if seen.event and instance.events:
            before = instance.values()
            instance.do("EnterEventMode")
            self.mode = "event"
            return seen, before, instance.values()
        return seen, instance.values()

    def run(self, seed, n):
        rng = random.Random(seed)
        return [self.call(rng) for _ in range(n)]
