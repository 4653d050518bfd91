"""A network of two kinds of parts that meet only at events, with inputs from outside, for tests of exported ones."""

import numpy as np

import hybrid_model as hm


class Node(hm.HybridAutomaton):
    """Drifts to what it hears, at a rate that is on and off, and sends its state when that has moved enough."""

    gain = hm.Parameter(1.0)
    threshold = hm.Parameter(0.05, tunable=True)
    heard = hm.Input(0.0, shape=2, discrete=True)
    push = hm.Input(0.0, discrete=True)
    x = hm.State(0.0, output=True)
    sent = hm.DiscreteState(0.0, output=True, computed=True)
    phase = hm.DiscreteState(0, integer=True)
    count = hm.DiscreteState(0, integer=True, output=True)
    echo = hm.Output(discrete=True)
    level = hm.Output()

    def start_map(self, s):
        return {"sent": s.x}

    def flow_map(self, s):
        on = (0.5 + 0.5 * np.cos(np.pi * s.phase)) * (1.0 + 0.4 * np.sin(5.0 * s.t))
        return {"x": on * s.gain * np.sum(s.heard - s.sent) + s.push}

    def outputs(self, s):
        return {"echo": 0.5 * s.heard[0] + 0.25 * s.push, "level": s.x - s.sent}

    def send_map(self, s):
        return {"sent": s.x, "count": s.count + 1}

    send = hm.Jump("send", lambda self, s: abs(s.x - s.sent) - s.threshold, send_map)
    transitions = (
        hm.TimeEvent(
            "turn", lambda self, s: 0.25 * (s.phase + 1.0), lambda self, s: {"phase": s.phase + 1}, internal=True
        ),
        send,
    )


class Damped(Node):
    """Decays towards what it hears, and halves its state now and then."""

    def flow_map(self, s):
        return {"x": s.gain * np.sum(s.heard) - 2.0 * s.x + s.push}

    transitions = (
        hm.TimeEvent(
            "tick", lambda self, s: 0.37 * (s.phase + 1.0), lambda self, s: {"phase": s.phase + 1, "x": 0.5 * s.x}
        ),
        Node.send,
    )


def parts_network(parts=16, seed=3):
    """Random wires: some parts hear themselves, some what earlier ones compute from what they hear."""
    rng = np.random.default_rng(seed)
    members, wires = {}, {}
    for k in range(parts):
        kind = Damped if k % 4 == 3 else Node
        x, gain = float(rng.uniform(-1, 1)), float(rng.uniform(0.5, 1.5))
        members[f"p{k}"] = kind(f"p{k}", x=x, gain=gain)
        one, other = rng.integers(0, parts, 2)
        echo = k % 5 == 0 and k > 0
        wires[f"p{k}.heard"] = [f"p{one}.sent", f"p{other % k}.echo" if echo else f"p{other}.sent"]
    return hm.Composition("parts_network", members, wires)
