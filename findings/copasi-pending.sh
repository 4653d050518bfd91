#!/usr/bin/env bash
# COPASI forgets the events that wait for their delay when a run is continued from the state it has left in the model.
#
# A vessel fills at 1 l/h. When it holds 4 l a valve is told to open, and it opens 3 h later: an event with a delay. With
# update_model=True (Update Model in the program) a run makes its last state the initial state of the model, so that the
# next one goes on from there. A good engineer expects two runs of 5 h to give what one of 10 h gives. The volume goes
# on, but the valve never opens: the event that was under way is dropped without a word, and its condition, true from the
# start of the second run, does not rise again. A model that is taken forward in steps shorter than its delays has no
# delayed events at all. Continued with use_initial_values=False the event is kept. Who is hurt: loops that couple COPASI
# with another simulator step by step, and protocols in which something is changed between two runs.
#
# Needs python3 with venv. Ends with status 0 if COPASI still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'copasi-basico==0.92' 'python-copasi==4.48.311'

"$work/env/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

import basico

HOURS = 10


def ends_with(parts, update_model):
    """Volume and valve after 10 h, in equal parts that go on from the new initial state or from the current one."""
    basico.new_model(name="vessel")
    basico.add_parameter("volume", type="ode", initial_value=0, expression="1")
    basico.add_parameter("valve", type="fixed", initial_value=0)
    basico.add_event("open", "Values[volume] > 4", [("Values[valve]", "1")], delay="3")
    for part in range(parts):
        last = basico.run_time_course(
            duration=HOURS / parts,
            intervals=1,
            update_model=update_model,
            use_initial_values=update_model or part == 0,
        ).iloc[-1]
    basico.remove_datamodel(basico.get_current_model())
    return round(float(last["Values[volume]"]), 6), float(last["Values[valve]"])


print(f"COPASI {version('python-copasi')} with basico {version('copasi-basico')}: volume in l, valve open, after {HOURS} h")
whole = ends_with(1, update_model=False)
halves = ends_with(2, update_model=True)
steps = ends_with(10, update_model=True)
continued = ends_with(10, update_model=False)
print(f"  in one run: {whole}")
print(f"  in 2 runs, update_model: {halves}; in 10 runs, update_model: {steps}")
print(f"  in 10 runs, use_initial_values=False from the second: {continued}")
sys.exit(not (whole == continued == (10.0, 1.0) and halves == steps == (10.0, 0.0)))
PYTHON
