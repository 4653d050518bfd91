#!/usr/bin/env bash
# diffrax ends at the event that is first in the list, though another one came earlier in the same step.
#
# An Event of diffrax takes several conditions and a root finder; the solution ends at the event and says in event_mask
# which one it was. A good engineer expects the earliest. Where two conditions change their sign within one step of the
# solver, diffrax keeps the first of them in the list and drops the others, before the root finder looks for times. A
# ball falls from 1 m and passes 0.5 m on its way to the floor: asked for (floor, 0.5 m), the run ends on the floor, and
# the mask says that 0.5 m was not passed; the other way round it is right. A smaller tolerance does not help: the steps
# of an adaptive solver grow over both where the flow is smooth. Two events of one instant lose one of them, too. Who is
# hurt: everybody with two guards or limits: the run goes on through the earlier one, and the next mode is the wrong one.
#
# Needs python3 with venv. Ends with status 0 if diffrax still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
packages=('diffrax==0.7.2' 'jax==0.10.2' 'jaxlib==0.10.2' 'numpy==2.4.6')
"$work/env/bin/pip" install --quiet --disable-pip-version-check "${packages[@]}"

"$work/env/bin/python" - <<'PYTHON'
import sys

import jax

jax.config.update("jax_enable_x64", True)

import diffrax
import jax.numpy as jnp
import optimistix

G = 9.81


def falling(t, y, args):
    """Height and velocity."""
    return jnp.array([y[1], -G])


def passes(level):
    return lambda t, y, args, **kwargs: y[0] - level


def ends(levels, rtol):
    """Time and height of the end, the levels of the mask and the steps made."""
    event = diffrax.Event([passes(level) for level in levels], optimistix.Newton(1e-10, 1e-10))
    run = diffrax.diffeqsolve(
        diffrax.ODETerm(falling),
        diffrax.Tsit5(),
        t0=0.0,
        t1=2.0,
        dt0=None,
        y0=jnp.array([1.0, 0.0]),
        stepsize_controller=diffrax.PIDController(rtol=rtol, atol=rtol),
        event=event,
    )
    told = [level for level, is_it in zip(levels, run.event_mask, strict=True) if is_it]
    return float(run.ts[-1]), float(run.ys[-1, 0]), told, int(run.stats["num_steps"])


when = {level: (2 * (1.0 - level) / G) ** 0.5 for level in (0.5, 0.0)}
exactly = " and ".join(f"{level} m at {time:.6f} s" for level, time in when.items())
print(f"diffrax {diffrax.__version__}: a ball from 1 m passes {exactly}")
same = True
for levels, rtol, kept in (
    ([0.5, 0.0], 1e-6, 0.5),
    ([0.0, 0.5], 1e-6, 0.0),
    ([0.0, 0.5], 1e-12, 0.0),
    ([0.0, 0.0], 1e-6, 0.0),
):
    time, height, told, steps = ends(levels, rtol)
    print(f"  events at {levels} m, rtol {rtol:g}: ends at {time:.6f} s, {height:.6f} m; mask: {told}; {steps} steps")
    same &= told == [kept] and abs(time - when[kept]) < 1e-6
sys.exit(not same)
PYTHON
