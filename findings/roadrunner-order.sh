#!/usr/bin/env bash
# libRoadRunner takes two events of one instant in an order that changes from run to run.
#
# At 1 s one event adds 1 to x and another makes it ten times as large. A good engineer expects one answer, whichever it
# is: the order of the file, as most solvers have it, or an error that asks for priorities. SBML leaves the order open
# where events have no priority, and libRoadRunner draws it anew in each run of an ordinary simulation: the same model from
# the same start ends with 2 or with 10, without a word. Who is hurt: everybody whose model has events that meet, a dose and
# a measurement at noon, two agents in step: a fit or a sweep sees noise that nobody put in, and a result that was checked
# once is another one the next time.
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
model meeting
  x = 1
  more: at (time >= 1): x = x + 1
  tenfold: at (time >= 1): x = x * 10
end
"""
assert antimony.loadAntimonyString(MODEL) >= 0, antimony.getLastError()
model = roadrunner.RoadRunner(antimony.getSBMLString("meeting"))
ends = []
for _ in range(40):
    model.resetAll()
    ends.append(float(model.simulate(0, 2, 3, ["time", "x"])[-1][1]))
print(f"libRoadRunner {roadrunner.__version__}: x at 2 s in 40 runs of one model from one start")
print(f"  {', '.join(f'{end:g}' for end in ends)}")
sys.exit(set(ends) != {2.0, 10.0})
PYTHON
