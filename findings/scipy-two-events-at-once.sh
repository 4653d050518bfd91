#!/usr/bin/env bash
# SciPy's solve_ivp reports one of two terminal events that happen at the same instant.
#
# Two balls are dropped from the same height; the run is to stop when one of them lands. A good engineer expects that
# both events have the time of the landing in t_events. solve_ivp cuts its list at the first terminal event in the order
# of the roots, so that the other one is left out in silence, though its function is zero there; which one it is depends
# on the order in which the events are given. Who is hurt: everybody who writes a loop over solve_ivp for a system with
# jumps, two wheels on one kerb or two agents in step: one reset is lost, and the other ball starts the next run on the
# surface, where its crossing is not seen again.
#
# Needs python3 with venv. Ends with status 0 if SciPy still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'scipy==1.17.1' 'numpy==2.4.6'
cat > "$work/run.py" <<'P'
import sys

import numpy as np
import scipy
from scipy.integrate import solve_ivp


def fall(t, x):
    """Heights and velocities of two balls."""
    return [x[2], x[3], -9.81, -9.81]


def lands(k):
    def height(t, x):
        return x[k]

    height.terminal = True
    height.direction = -1
    return height


def run(balls, start):
    found = solve_ivp(fall, [0.0, 2.0], start, events=[lands(k) for k in balls], rtol=1e-10, atol=1e-12)
    return found, [times.tolist() for times in found.t_events]


start = [1.0, 1.0, 0.0, 0.0]
found, times = run((0, 1), start)
print(f"SciPy {scipy.__version__}: two balls fall from 1 m, both land after {np.sqrt(2 / 9.81):.6f} s")
print(f"  heights at the end: {found.y[:2, -1]}")
print(f"  times of the two events: {times}")
# What a loop over solve_ivp does next: the ball whose event was reported bounces, the other one is believed in the air.
after = found.y[:, -1].copy()
for k, told in enumerate(times):
    if told:
        after[2 + k] *= -0.7
again, later = run((0, 1), after)
print(f"  the run that goes on from there, with the bounce of the ball that was reported: heights {again.y[:2, -1]}")
one_is_lost = sorted(map(len, times)) == [0, 1]
sys.exit(not (one_is_lost and min(again.y[:2, -1]) < -0.1))
P
"$work/env/bin/python" "$work/run.py"
