#!/usr/bin/env bash
# bdsim leaves out the first tick of each clock, so that what is sampled begins one period late.
#
# A zero-order hold samples the time itself, so that it shows when its clock ticks; its value before the first sample is
# -1. The clock has a period of 1 s, once without and once with an offset of 0.25 s. The package says that the k-th tick
# comes at k times the period plus the offset. A good engineer expects samples at 0, 1, 2 s and at 0.25, 1.25, 2.25 s.
# bdsim counts from k = 1: it samples at 1, 2 s and at 1.25, 2.25 s, and in the first period shows the initial value of
# the hold, which is 0 by default. Who is hurt: sampled controllers, for the loop is open during the first period and
# each response begins with a step that the design does not have; those who give clocks offsets, which then come a
# period late; and everybody who compares with another simulator or with the difference equation of the loop.
#
# Needs python3 with venv. Ends with status 0 if bdsim still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'bdsim==1.4.0'

MPLBACKEND=agg "$work/env/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

import bdsim
import numpy

UNSAMPLED = -1.0
STOP = 2.6


def samples(offset):
    """What a hold shows during a run, in order: its initial value, then the times at which it sampled."""
    simulator = bdsim.BDSim(graphics=False, quiet=True, progress=False)
    diagram = simulator.blockdiagram()
    clock = diagram.clock(1, "s", offset=offset)
    time = diagram.TIME()
    hold = diagram.ZOH(clock, x0=UNSAMPLED)
    integral = diagram.INTEGRATOR(x0=0)
    sink = diagram.NULL()
    diagram.connect(time, hold)
    diagram.connect(hold, integral)
    diagram.connect(integral, sink)
    diagram.compile()
    shown = simulator.run(diagram, STOP, watch=[hold]).y[:, 0]
    return [round(float(value), 9) for value in numpy.unique(shown)]


print(f"bdsim {version('bdsim')}: what a hold of the time shows in {STOP} s, {UNSAMPLED} being its initial value")
found = {offset: samples(offset) for offset in (0.0, 0.25)}
for offset, values in found.items():
    print(f"  ticks at k * 1 s + {offset} s: {values}")
sys.exit(found != {0.0: [UNSAMPLED, 1.0, 2.0], 0.25: [UNSAMPLED, 1.25, 2.25]})
PYTHON
