#!/usr/bin/env bash
# libRoadRunner's reset() brings back the time and the states that flow, and leaves what events have changed.
#
# A room with a heater: the temperature has a rate, and two events switch the heater off above 21 degrees and on below 19.
# A good engineer expects that reset() followed by simulate() repeats the first run. reset() takes back the temperature,
# for it has a rate rule, but not the heater, which only events set: the second run begins in the mode in which the first
# one ended. Here that is cold and off, where no event switches the heater on, since its condition holds from the start,
# and the room cools for ever. resetAll() takes both back. Who is hurt: everybody with modes, counters or latches who
# compares runs, sweeps or fits with reset() in between, as most examples have it.
#
# Needs python3 with venv. Ends with status 0 if libRoadRunner still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'libroadrunner==2.10.0' 'antimony==3.3.0'

"$work/env/bin/python" - <<'PYTHON'
import sys

import antimony
import roadrunner

MODEL = """
model room
  T = 18; heater = 1
  T' = 2 * heater - 1
  off: at (T > 21): heater = 0
  on: at (T < 19): heater = 1
end
"""
assert antimony.loadAntimonyString(MODEL) >= 0, antimony.getLastError()
model = roadrunner.RoadRunner(antimony.getSBMLString("room"))


def run():
    return [[round(float(number), 6) for number in row] for row in model.simulate(0, 4, 5, ["time", "T", "heater"])]


print(f"libRoadRunner {roadrunner.__version__}: time in s, temperature, heater")
first = run()
model.reset()
again = run()
model.resetAll()
after_all = run()
for name, rows in (("first run", first), ("after reset()", again), ("after resetAll()", after_all)):
    print(f"  {name}: {rows}")
sys.exit(not (after_all == first and again[0][1] == first[0][1] and again[0][2] != first[0][2] and again[-1][1] < 15))
PYTHON
