"""Parts between the analog and the digital side, and a loop made of them: converter, state machine, hold."""

from typing import Any

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value


class AnalogDigitalConverter(hm.HybridAutomaton):
    """Samples its input every `period` and tells in which of the intervals between `levels` it lies.

    Samples are due at ``first + k period``, computed from the index k. The code is the number of levels at or below
    the sample: 0 below all of them.
    """

    count = hm.Dimension("number of levels")
    analog = hm.Input(0.0, description="signal to sample")
    sample = hm.DiscreteState(0.0, output=True, description="last sample")
    code = hm.DiscreteState(0, integer=True, output=True, description="number of levels at or below the last sample")
    k = hm.DiscreteState(0, integer=True, output=True, description="number of samples taken")
    levels = hm.Parameter(0.0, shape="count", description="thresholds of the code, ascending")
    period = hm.Parameter(0.1, unit="s", description="time between samples")
    first = hm.Parameter(0.0, unit="s", description="time of the first sample")
    sampled = hm.Clock("sample", description="ticks with each sample")

    def next_time(self, s: hm.Values) -> Value:
        """Time of the next sample."""
        return s.first + s.k * s.period

    def take(self, s: hm.Values) -> dict[str, Value]:
        """Take a sample and code it."""
        return {"sample": s.analog, "code": np.sum(np.where(s.analog >= s.levels, 1, 0)), "k": s.k + 1}

    transitions = (hm.TimeEvent("sample", next_time, take),)


class FiniteStateMachine(hm.HybridAutomaton):
    """Jumps from state q to ``table[q, symbol]`` wherever that is another state, and rests where it is q itself.

    The finite state machine of the HyEQ Toolbox: flow set ``delta(q, u) = q``, jump set ``delta(q, u) != q``. A table
    that leads round in a circle under one symbol jumps for ever at one instant, and is stopped by rule 7.
    """

    states = hm.Dimension("number of states")
    symbols = hm.Dimension("number of input symbols")
    symbol = hm.Input(0.0, discrete=True, description="input symbol, counted from 0")
    q = hm.DiscreteState(0, integer=True, output=True, description="state, counted from 0")
    table = hm.Parameter(0, integer=True, shape=("states", "symbols"), description="next state, by state and by symbol")
    moved = hm.Clock("move", description="ticks with each change of state")

    def next_state(self, s: hm.Values) -> Value:
        """Look up the table."""
        row = np.where(np.arange(s.table.shape[0]) == s.q, 1, 0)
        column = np.where(np.arange(s.table.shape[1]) == s.symbol, 1, 0)
        return row @ s.table @ column

    def must_move(self, s: hm.Values) -> Value:
        """The table tells another state."""
        return abs(self.next_state(s) - s.q) - 0.5

    def move(self, s: hm.Values) -> dict[str, Value]:
        """Go there."""
        return {"q": self.next_state(s)}

    transitions = (hm.Jump("move", must_move, move),)


class ZeroOrderHold(hm.HybridAutomaton):
    """Takes over its input every `period` and holds it: ``held = gain digital + offset``.

    Updates are due at ``first + k period``, computed from the index k.
    """

    digital = hm.Input(0.0, discrete=True, description="signal to hold")
    held = hm.DiscreteState(0.0, output=True, description="signal held")
    k = hm.DiscreteState(0, integer=True, internal=True, description="number of updates")
    gain = hm.Parameter(1.0, description="output per unit of input")
    offset = hm.Parameter(0.0, description="output for an input of zero")
    period = hm.Parameter(0.1, unit="s", description="time between updates")
    first = hm.Parameter(0.0, unit="s", description="time of the first update")
    updated = hm.Clock("update", description="ticks with each update")

    def next_time(self, s: hm.Values) -> Value:
        """Time of the next update."""
        return s.first + s.k * s.period

    def update(self, s: hm.Values) -> dict[str, Value]:
        """Hold the present input."""
        return {"held": s.gain * s.digital + s.offset, "k": s.k + 1}

    transitions = (hm.TimeEvent("update", next_time, update),)


class FirstOrderPlant(hm.HybridAutomaton):
    """First-order lag, ``x' = (u - x)/time_constant``; under a constant u an exponential."""

    x = hm.State(0.0, output=True, description="output of the plant")
    u = hm.Input(0.0, description="input of the plant")
    time_constant = hm.Parameter(1.0, unit="s", description="time constant")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Relax towards the input."""
        return {"x": (s.u - s.x) / s.time_constant}


class AnalogDigitalLoop(hm.Composition):
    """A lag under digital on-off control: plant, converter, state machine and hold in a circle.

    The machine turns on where a sample is below `low` and off where one is at or above `high`. The parts stand in the
    order of the signal, so a sample, the machine's move and the hold's update at one instant are jumps j, j + 1, j + 2
    of that instant (rule 6), and the plant sees the answer to a sample at once. The answer in closed form:
    with ``a = exp(-period/time_constant)`` the samples obey ``x[k+1] = a x[k] + (1 - a) drive q[k]``.

    Parameters
    ----------
    name : str
        Name of the composition.
    low, high : float
        Thresholds of the samples.
    drive : float
        Output of the hold while the machine is on; 0 while it is off.
    period : float
        Time in s between samples, and between updates of the hold.
    latency : float
        Time in s by which updates come after samples.
    **plant : float
        Values of `FirstOrderPlant`: ``x``, ``time_constant``.
    """

    def __init__(
        self,
        name: str = "AnalogDigitalLoop",
        *,
        low: float = 0.4,
        high: float = 0.6,
        drive: float = 1.0,
        period: float = 0.1,
        latency: float = 0.0,
        **plant: Any,
    ) -> None:
        parts = {
            "plant": FirstOrderPlant(**plant),
            "converter": AnalogDigitalConverter(levels=[low, high], period=period),
            "machine": FiniteStateMachine(table=[[1, 0, 0], [1, 1, 0]]),
            "hold": ZeroOrderHold(gain=drive, period=period, first=latency),
        }
        wires = {
            "converter.analog": "plant.x",
            "machine.symbol": "converter.code",
            "hold.digital": "machine.q",
            "plant.u": "hold.held",
        }
        super().__init__(name, parts, wires)
