"""Small automata whose runs end, or whose maps are not finite everywhere, for the tests of exported FMUs."""

import numpy as np

import hybrid_model as hm


class Stuck(hm.HybridAutomaton):
    """Runs against a wall where nothing is enabled."""

    x = hm.State(0.0, output=True)
    wall = hm.Parameter(0.4)

    def flow_map(self, s):
        return {"x": 1.0}

    def flow_set(self, s):
        return s.wall - s.x

    def jump_set(self, s):
        return s.x - 10.0

    def jump_map(self, s):
        return {"x": 0.0}


class Agreed(hm.HybridAutomaton):
    """A static trigger whose agreement is broken and restored at `begin`: both sides of its inequality are zero."""

    x = hm.State(0.0, output=True)
    held = hm.DiscreteState(0.0)
    begin = hm.Parameter(0.5)

    def flow_map(self, s):
        return {"x": s.held - s.x}

    def jump_set(self, s):
        return hm.least((s.held - s.x) ** 2 - 0.25 * s.x**2, s.t - s.begin)

    def jump_map(self, s):
        return {"held": s.x}


class Pole(hm.HybridAutomaton):
    """A flow that is infinite at x = 1, and an output that is there as well."""

    x = hm.State(0.0, output=True)
    y = hm.Output()

    def flow_map(self, s):
        return {"x": 1.0 / (1.0 - s.x)}

    def outputs(self, s):
        return {"y": np.sqrt(1.0 - s.x)}

    def jump_set(self, s):
        return s.x - 2.0

    def jump_map(self, s):
        return {"x": 0.0}
