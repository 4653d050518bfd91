#!/usr/bin/env bash
# python-control's input_output_response steps over a pulse in its own table of inputs.
#
# The function takes the times and the values of the inputs. A good engineer expects that the response is computed at
# these times at least, so that no row of the table is lost. It hands all to solve_ivp, which is not told of the rows: its
# steps grow while nothing happens, and a late pulse is stepped over in silence, with any tolerance. With x' = u, a pulse
# of area 1 s at 50 s leaves x = 0 for ever; the exact answer is 1. solve_ivp_kwargs={"max_step": ...} cures it. Who is
# hurt: everybody who tests a controller with a disturbance that comes after a time at rest.
#
# Needs python3 with venv. Ends with status 0 if python-control still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'control==0.10.2' 'scipy==1.17.1' 'numpy==2.4.6'
cat > "$work/run.py" <<'P'
import sys

import control
import numpy as np

store = control.nlsys(lambda t, x, u, params: u, None, inputs=1, outputs=1, states=1)
times = np.arange(101.0)
pulse = np.where(times == 50.0, 1.0, 0.0)
ways = {
    "as it is": {},
    "rtol = 1e-10": {"rtol": 1e-10, "atol": 1e-12},
    "max_step = 1": {"max_step": 1.0, "rtol": 1e-10, "atol": 1e-12},
}
found = {
    way: float(control.input_output_response(store, times, pulse, 0.0, solve_ivp_kwargs=options).outputs[-1])
    for way, options in ways.items()
}
print(f"python-control {control.__version__}: x' = u, u = 1 in the row for 50 s of 100 s, straight lines between rows")
print("  x(100 s), exactly 1:")
for way, value in found.items():
    print(f"    {way}: {value:.9f}")
sys.exit(not (found["as it is"] == found["rtol = 1e-10"] == 0.0 and abs(found["max_step = 1"] - 1.0) < 1e-6))
P
"$work/env/bin/python" "$work/run.py"
