"""Models that the C harness is run with: together they use every part of the runtime."""

from c_runs import Witness
from parts_network import parts_network
from witnesses import Cascade, FlowFirst, Hill, Mix, Ramps, Swing, Timers

from hybrid_model.consensus.weights.gated_sine import GatedSineWeights
from hybrid_model.models import BouncingBall

WITNESSES = {
    # Impacts that draw nearer each other, a flow set.
    "ball": Witness(BouncingBall(), 2.3, 23),
    # Guards and timers at one time, in the order of the table.
    "ramps": Witness(
        Ramps(rate_a=1.0, rate_b=2.0, limit_a=0.3, limit_b=0.6, first=0.3, period=0.7, name="ramps"), 2.0, 16
    ),
    # Two crossings within a step.
    "hill": Witness(Hill(begin=0.7, end=0.7 + 1e-4), 2.0, 2),
    # Quadratures of two levels, across a breakpoint.
    "swing": Witness(Swing(), 2.3, 19),
    "cascade": Witness(Cascade(links=5.0), 2.5, 5),
    # No continuous state, a breakpoint at the time of a timer, a discrete input.
    "timers": Witness(Timers(), 2.1, 12, changes=((0.61, "command", 1.0), (1.33, "command", 0.2))),
    "flow_first": Witness(FlowFirst(rate=0.7), 5.0, 12),
    # Flows that have no closed form, a breakpoint, a tie of nothing.
    "mix": Witness(Mix(), 3.0, 31, changes=((0.77, "push", 0.2), (1.9, "push", -0.1))),
    # Parts that meet only at events, run part by part, inputs from outside.
    "network": Witness(parts_network(seed=11), 1.1, 7, changes=((0.31, "p1.push", 0.2), (0.62, "p4.push", -0.3))),
    # Breakpoints alone.
    "gated": Witness(GatedSineWeights(duty_percent=[20.0, 35.0]), 5.0, 37),
}
POLYNOMIAL = ("ball", "ramps", "cascade", "timers", "flow_first")
"""Those whose flows the importer for Model Exchange integrates exactly, and whose crossings it sees."""
