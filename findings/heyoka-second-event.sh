#!/usr/bin/env bash
# heyoka drops one of two terminal events of one instant, and integrates on as if it had not happened.
#
# A terminal event of heyoka may change the state in its callback and let the integration go on, so a hybrid system can
# be written with one event for each jump. The manual says that the first event of a step is taken and that those after
# it are discarded; they come again in the next step. A good engineer expects that of two with the same time too, or
# that both callbacks are called. The second one lies at the very start of the next step and is not found there. Two
# balls are dropped together: one bounces, the other falls through the floor. One ball has an event that counts its
# landings and one that bounces: with the counter first in the list it never bounces. Who is hurt: everybody with
# symmetric starts, shared clocks or two reactions to one condition; a difference of 1e-9 m in height hides it.
#
# Needs python3 with venv. Ends with status 0 if heyoka still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'heyoka==7.13.2' 'numpy==2.4.6'

"$work/env/bin/python" - <<'PYTHON'
import sys

import heyoka as hy

G, KEPT, END = 9.81, 0.8, 1.0
FALLING = hy.event_direction.negative


def run(heights, kinds):
    """Heights at the end and the calls of callbacks; kinds: what each event does, and to which ball."""
    balls = range(len(heights))
    names = hy.make_vars(*(f"{letter}{k}" for letter in "hv" for k in balls))
    h, v = names[: len(heights)], names[len(heights) :]
    calls = []

    def event(kind, k):
        def callback(integrator, sign):
            calls.append(f"{kind} {k} at {integrator.time:.6f} s")
            if kind == "bounce":
                integrator.state[len(heights) + k] *= -KEPT
            return True

        return hy.t_event(h[k], callback=callback, direction=FALLING)

    system = [(h[k], v[k]) for k in balls] + [(v[k], hy.expression(-G)) for k in balls]
    start = [*heights, *(0.0 for k in balls)]
    integrator = hy.taylor_adaptive(system, start, t_events=[event(*kind) for kind in kinds])
    integrator.propagate_until(END)
    return [float(height) for height in integrator.state[: len(heights)]], calls


landing = (2 / G) ** 0.5
rest = END - landing
exact, fallen = KEPT * G * landing * rest - G * rest**2 / 2, 1.0 - G * END**2 / 2
print(f"heyoka {hy.__version__}: balls from 1 m land at {landing:.6f} s; heights at 1 s, exactly {exact:.6f} m each")
found = {}
for name, heights, kinds in (
    ("two balls from one height", [1.0, 1.0], [("bounce", 0), ("bounce", 1)]),
    ("the second one 1e-9 m higher", [1.0, 1.0 + 1e-9], [("bounce", 0), ("bounce", 1)]),
    ("one ball, bounce before count", [1.0], [("bounce", 0), ("count", 0)]),
    ("one ball, count before bounce", [1.0], [("count", 0), ("bounce", 0)]),
):
    found[name], calls = run(heights, kinds)
    print(f"  {name}: {', '.join(f'{height:.6f}' for height in found[name])}; callbacks: {', '.join(calls)}")
expected = ([exact, fallen], [exact, exact], [exact], [fallen])
same = all(
    abs(height - value) < 1e-6
    for heights, values in zip(found.values(), expected, strict=True)
    for height, value in zip(heights, values, strict=True)
)
sys.exit(not same)
PYTHON
