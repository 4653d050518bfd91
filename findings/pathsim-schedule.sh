#!/usr/bin/env bash
# PathSim tells a scheduled event its own time, and shows it the states of a later one.
#
# A Schedule acts every 0.1 s, as a sampled controller or a logger does; its times are known before the run. A good
# engineer expects that a step ends there, or at least that time and states belong together. With the solver that PathSim
# takes if none is named, steps keep their length: the event comes at the first step that ends after it, is told the time
# that it was planned for, and reads and sets the states of the end of that step. On a ramp x = t with steps of 0.03 s the
# sample of 0.1 s is 0.12. With an adaptive solver the samples are exact. Who is hurt: everybody who samples with a period
# that is no multiple of the step, for the numbers look right and the delay depends on the sample; a controller that uses
# the time it was told is wrong by up to a step.
#
# Needs python3 with venv. Ends with status 0 if PathSim still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'pathsim==0.27.1'

MPLBACKEND=agg MPLCONFIGDIR="$work" "$work/env/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

from pathsim import Connection, Simulation
from pathsim.blocks import Constant, Integrator
from pathsim.events import Schedule
from pathsim.solvers import RKCK54


def samples(**solver):
    """Times and states that a sampler of a ramp is told."""
    slope, ramp, told = Constant(1.0), Integrator(0.0), []
    sampler = Schedule(t_start=0.0, t_period=0.1, func_act=lambda t: told.append((t, float(ramp.outputs[0]))))
    run = Simulation([slope, ramp], [Connection(slope, ramp)], [sampler], dt=0.03, log=False, **solver)
    run.run(0.5)
    return told


print(f"PathSim {version('pathsim')}: a ramp x = t, sampled every 0.1 s, steps of 0.03 s")
late, exact = samples(), samples(Solver=RKCK54)
for name, told in (("no solver named", late), ("RKCK54", exact)):
    print(f"  {name}: {', '.join(f'x({t:.3g}) = {x:.4g}' for t, x in told)}")
sys.exit(not (max(x - t for t, x in late) > 0.015 and max(abs(x - t) for t, x in exact) < 1e-9))
PYTHON
