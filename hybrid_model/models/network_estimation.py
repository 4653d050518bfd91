"""State estimation from measurements that a network brings now and then."""

import numpy as np

import hybrid_model as hm
from hybrid_model.declare.variables import Value

DYNAMICS = ((0.0, 1.0, 0.0, 0.0), (-1.0, 0.0, 0.0, 0.0), (-2.0, 1.0, -1.0, 0.0), (2.0, -2.0, 0.0, -2.0))
INPUT_COLUMN = (0.0, 0.0, 1.0, 0.0)
MEASUREMENT = (1.0, 0.0, 0.0, 0.0)
INJECTION = (1.0, -0.9433, -0.6773, 1.6274)
"""A, B, M and L of the example "estimation over a network" of the HyEQ Toolbox."""


class SineSource(hm.HybridAutomaton):
    """A sine: ``amplitude sin(rate t)``."""

    signal = hm.Output(description="the sine")
    amplitude = hm.Parameter(1.0, description="amplitude")
    rate = hm.Parameter(1.0, unit="rad/s", description="angular frequency")

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """Evaluate it."""
        return {"signal": s.amplitude * np.sin(s.rate * s.t)}


class LinearProcess(hm.HybridAutomaton):
    """A linear process, ``x' = A x + B u``, measured by ``y = M x``."""

    order = hm.Dimension("order of the process")
    x = hm.State(0.0, shape="order", output=True, description="state")
    u = hm.Input(0.0, description="known input")
    y = hm.Output(description="measurement")
    A = hm.Parameter(0.0, shape=("order", "order"), description="system matrix")
    B = hm.Parameter(0.0, shape="order", description="input column")
    M = hm.Parameter(0.0, shape="order", description="measurement row")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Linear dynamics."""
        return {"x": s.A @ s.x + s.B * s.u}

    def outputs(self, s: hm.Values) -> dict[str, Value]:
        """Measure."""
        return {"y": s.M @ s.x}


class SporadicNetwork(hm.HybridAutomaton):
    """Brings its input to the other end at given intervals, without delay: the intervals are repeated when used up."""

    count = hm.Dimension("number of intervals")
    y = hm.Input(0.0, description="signal to send")
    message = hm.DiscreteState(0.0, output=True, description="last value sent")
    sent = hm.DiscreteState(0, integer=True, output=True, description="number of transmissions")
    due = hm.DiscreteState(computed=True, unit="s", description="time of the next transmission")
    intervals = hm.Parameter(1.0, shape="count", unit="s", description="times between transmissions")
    transmission = hm.Clock("transmit", description="ticks with each transmission")

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """Wait for the first interval."""
        return {"due": s.t + s.intervals[0]}

    def next_time(self, s: hm.Values) -> Value:
        """Time of the next transmission."""
        return s.due

    def transmit(self, s: hm.Values) -> dict[str, Value]:
        """Send, and choose the next interval."""
        count = s.intervals.shape[0]
        k = s.sent + 1
        now = np.where(np.arange(count) == k - count * np.floor(k / count), 1.0, 0.0)
        return {"message": s.y, "sent": k, "due": s.due + now @ s.intervals}

    transitions = (hm.TimeEvent("transmit", next_time, transmit),)


class SporadicEstimator(hm.HybridAutomaton):
    """Copies the process and corrects itself by ``L (y - M x)`` at each message.

    It jumps when the count of messages differs from the count that it has seen, so a message acts at its own instant.
    """

    order = hm.Dimension("order of the process")
    x = hm.State(0.0, shape="order", output=True, description="estimate")
    seen = hm.DiscreteState(0, integer=True, description="number of messages used")
    u = hm.Input(0.0, description="known input")
    message = hm.Input(0.0, discrete=True, description="last message")
    sent = hm.Input(0.0, discrete=True, description="number of messages")
    A = hm.Parameter(0.0, shape=("order", "order"), description="system matrix")
    B = hm.Parameter(0.0, shape="order", description="input column")
    M = hm.Parameter(0.0, shape="order", description="measurement row")
    L = hm.Parameter(0.0, shape="order", description="injection gain")
    correction = hm.Clock("correct", description="ticks with each correction")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """Copy of the process."""
        return {"x": s.A @ s.x + s.B * s.u}

    def news(self, s: hm.Values) -> Value:
        """A message not used yet."""
        return s.sent - s.seen - 0.5

    def correct(self, s: hm.Values) -> dict[str, Value]:
        """Inject the measurement."""
        return {"x": s.x + s.L * (s.message - s.M @ s.x), "seen": s.sent}

    transitions = (hm.Jump("correct", news, correct),)


class NetworkEstimation(hm.Composition):
    """The example "estimation over a network" of the HyEQ Toolbox: process, network and estimator under one input.

    The error obeys ``e' = A e`` and ``e+ = (I - L M) e`` whatever the input: a product of matrix exponentials and
    jumps. A message makes its first element zero, and the second is multiplied by ``cos(T) + 0.9433 sin(T)`` from one
    message to the next, T the interval between them; the other two follow. So with a constant interval the error
    converges to zero if and only if T lies between ``2 arctan(0.9433)`` and pi (plus multiples of pi); with several,
    the product of the factors decides. The toolbox draws the intervals between 0.2 s and 3 s; here they are given.

    Parameters
    ----------
    name : str
        Name of the composition.
    intervals : sequence of float
        Times in s between transmissions; repeated when used up.
    start : sequence of float
        State of the process at the start, four numbers.
    amplitude : float
        Amplitude of the input ``amplitude sin(0.1 t)``.
    """

    def __init__(
        self,
        name: str = "NetworkEstimation",
        *,
        intervals: tuple[float, ...] = (0.7, 2.9, 0.2, 1.6, 2.3, 0.45, 3.0, 1.1),
        start: tuple[float, ...] = (1.0, 0.1, 1.0, 0.6),
        amplitude: float = 50.0,
    ) -> None:
        parts = {
            "drive": SineSource(amplitude=amplitude, rate=0.1),
            "process": LinearProcess(A=DYNAMICS, B=INPUT_COLUMN, M=MEASUREMENT, x=start),
            "network": SporadicNetwork(intervals=intervals),
            "estimator": SporadicEstimator(
                A=DYNAMICS, B=INPUT_COLUMN, M=MEASUREMENT, L=INJECTION, x=(0.0, 0.5, 0.0, 0.0)
            ),
        }
        wires = {
            "process.u": "drive.signal",
            "network.y": "process.y",
            "estimator.u": "drive.signal",
            "estimator.message": "network.message",
            "estimator.sent": "network.sent",
        }
        super().__init__(name, parts, wires)
