#!/usr/bin/env bash
# PythonFMU3 does not pass on that an FMU needs another iteration at an event.
#
# Three relays in a row, each of which falls one iteration after the one before it. The FMU for Model Exchange says so
# as the package offers it: update_discrete_states returns a Fmi3UpdateDiscreteStatesResult with
# discreteStateNeedsUpdate true until the last relay has fallen. A good engineer expects fmi3UpdateDiscreteStates to
# report that need, so that importers call it until it is over. They are told at the first call that nothing more is to
# be done: the compiled part looks for another spelling, discreteStatesNeedUpdate, and says nothing if there is no such
# field. Importers go on with the first relay fallen and the others not; the other relays fall at later events, one at
# each. The flag for new nominal values is lost in the same way, while that for new states arrives. Who is hurt: models
# with chains of events, whose modes are then wrong between two events, with all calls returning fmi3OK.
#
# Needs python3 with venv. Ends with status 0 if PythonFMU3 still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'pythonfmu3==0.3.4' 'fmpy==0.3.32'

cat > "$work/relays.py" <<'PYTHON'
from pythonfmu3 import Float64, Fmi3Causality, Fmi3Initial, Fmi3SlaveBase, Fmi3Variability, Int32, ModelExchange
from pythonfmu3.modelexchange import Fmi3UpdateDiscreteStatesResult

RELAYS = 3


class Relays(Fmi3SlaveBase, ModelExchange):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time = 0.0
        self.fallen = 0
        self.charge = 1.0
        self.current = -1.0
        exact, continuous, discrete = Fmi3Initial.exact, Fmi3Variability.continuous, Fmi3Variability.discrete
        local, output, independent = Fmi3Causality.local, Fmi3Causality.output, Fmi3Causality.independent
        for variable in (
            Float64("time", causality=independent, variability=continuous),
            Float64("charge", causality=output, variability=continuous, initial=exact, start=1.0),
            Float64("current", causality=local, variability=continuous, derivative=1),
            Int32("fallen", causality=output, variability=discrete, initial=exact, start=0),
        ):
            self.register_variable(variable)

    def get_continuous_state_derivatives(self):
        return [self.current]

    def update_discrete_states(self):
        fell = self.fallen < RELAYS
        if fell:
            self.fallen += 1
            self.charge *= 1e-3
        return Fmi3UpdateDiscreteStatesResult(
            discreteStateNeedsUpdate=self.fallen < RELAYS,
            nominalsOfContinuousStatesChanged=fell,
            valuesOfContinuousStatesChanged=fell,
        )

    def get_nominals_of_continuous_states(self, size):
        return [self.charge]
PYTHON
"$work/env/bin/pythonfmu3" build -f "$work/relays.py" -d "$work"

"$work/env/bin/python" - "$work" <<'PYTHON'
import sys
from importlib.metadata import version
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Model

work = Path(sys.argv[1])
sys.path.insert(0, str(work))
from relays import RELAYS, Relays  # noqa: E402

description = read_model_description(work / "Relays.fmu")
reference = {variable.name: variable.valueReference for variable in description.modelVariables}
fmu = FMU3Model(
    guid=description.guid,
    unzipDirectory=extract(work / "Relays.fmu", work / "unzipped"),
    modelIdentifier=description.modelExchange.modelIdentifier,
    instanceName="relays",
)
fmu.instantiate()
fmu.enterInitializationMode()
fmu.exitInitializationMode()

model = Relays(instance_name="in Python")
in_python, in_the_fmu = [], []
for _ in range(RELAYS):
    answer = model.update_discrete_states()
    flags = (
        answer.discreteStateNeedsUpdate,
        answer.nominalsOfContinuousStatesChanged,
        answer.valuesOfContinuousStatesChanged,
    )
    in_python.append((*flags, model.fallen))
    needs_update, _, nominals_changed, states_changed, *_ = fmu.updateDiscreteStates()
    fallen = fmu.getInt32([reference["fallen"]])[0]
    in_the_fmu.append((bool(needs_update), bool(nominals_changed), bool(states_changed), fallen))

print(f"pythonfmu3 {version('pythonfmu3')}, driven by fmpy {version('fmpy')}")
print("needs another update, new nominal values, new states, relays fallen after each call")
print(f"  by the class itself: {in_python}")
print(f"  by the FMU:          {in_the_fmu}")
told = [(relay < RELAYS, True, True, relay) for relay in (1, 2, 3)]
passed_on = [(False, False, True, relay) for relay in (1, 2, 3)]
sys.exit(not (in_python == told and in_the_fmu == passed_on))
PYTHON
