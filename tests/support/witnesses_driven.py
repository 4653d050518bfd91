"""A small automaton that is driven from outside, for the tests of exported FMUs."""

import hybrid_model as hm


class Tank(hm.HybridAutomaton):
    """A tank that an inflow fills and that is emptied when it is full; its drain makes steps of a solver short."""

    level = hm.State(0.0, output=True)
    fast = hm.State(1.0)
    inflow = hm.Input(0.5)
    drain = hm.Parameter(0.1)
    full = hm.Parameter(1.0)
    valve = hm.Input(0.0, discrete=True)
    emptied = hm.DiscreteState(0, integer=True, output=True)
    rate = hm.Output()
    empties = hm.Clock("jump")

    def flow_map(self, s):
        # `fast` keeps steps short: it decays and is driven, and nothing depends on it.
        return {"level": s.inflow - s.drain * s.level, "fast": 40.0 * (s.level - s.fast)}

    def outputs(self, s):
        return {"rate": s.inflow - s.drain * s.level + 0.0 * s.valve}

    def jump_set(self, s):
        return s.level - s.full

    def jump_map(self, s):
        return {"level": 0.0, "emptied": s.emptied + 1}
