#!/usr/bin/env bash
# scikit-sundae's solvers report the events of earlier runs as events of the present one.
#
# A CVODE or IDA object is made once, and solve() is called for each run: with other start values, or from an event on, as
# a loop over a system with jumps does. A good engineer expects the t_events of a result to be those of its run. The
# object's list of events is never emptied: a second run from the same start has its one event twice, and a run of 0.1 s
# without any has the events of all runs before, at times beyond its own end; its message is right. Who is hurt: everybody
# who takes result.t_events[0] and result.y_events[0] to go on from, for that is the first event of the first run for
# ever; who counts events; and who sweeps over start values with one solver.
#
# Needs python3 with venv. Ends with status 0 if scikit-sundae still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'scikit-sundae==1.2.0' 'numpy==2.4.6'

"$work/env/bin/python" - <<'PYTHON'
import sys

import numpy as np
import sksundae
from sksundae.cvode import CVODE
from sksundae.ida import IDA


def fall(t, y, rates):
    """Height and velocity of a ball."""
    rates[:] = y[1], -9.81


def residual(t, y, rates, rest):
    rest[:] = rates[0] - y[1], rates[1] + 9.81


def lands(t, y, margin):
    margin[0] = y[0]


def lands_of_ida(t, y, rates, margin):
    margin[0] = y[0]


for function in (lands, lands_of_ida):
    function.terminal, function.direction = [True], [-1]
options = {"num_events": 1, "rtol": 1e-10, "atol": 1e-12}
start, rates = np.array([1.0, 0.0]), np.array([0.0, -9.81])
landing = np.sqrt(2 / 9.81)
print(f"scikit-sundae {sksundae.__version__}; a ball from 1 m lands after {landing:.6f} s")
kept = True
for name, solver, more in (
    ("CVODE", CVODE(fall, eventsfn=lands, **options), ()),
    ("IDA", IDA(residual, eventsfn=lands_of_ida, **options), (rates,)),
):
    for end in (2.0, 2.0, 0.1):
        found = solver.solve(np.linspace(0.0, end, 11), start, *more)
        print(f"{name}, a run of {end} s: t_events {found.t_events}, ends at {found.t[-1]:.6f} s")
    # The run of 0.1 s ends long before the landing.
    kept = kept and found.t_events is not None and len(found.t_events) == 2 and min(found.t_events) > found.t[-1]
sys.exit(not kept)
PYTHON
