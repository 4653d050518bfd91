#!/usr/bin/env bash
# PythonFMU's FMU states hold the variables that are registered, and nothing else that the model remembers.
#
# A PI controller with its integral in a private attribute, as one writes it in Python, built with --handle-state: its
# description then says canGetAndSetFMUstate="true". A good engineer expects that fmi2SetFMUstate brings back what
# fmi2GetFMUstate took, and that a step repeated from there gives the same again: that is what the flag promises, and
# the help of the option says no more than that it sets the flag. The outputs do come back, the integral does not: each
# repetition of one step from one state gives another value, and all calls return fmi2OK. Who is hurt: masters that repeat
# steps, so those that iterate, reject steps or look for events. The authors know the limit, in a discussion of the
# change that brought states; the attribute has to be registered, or two methods with a leading underscore overridden.
#
# Needs python3 with venv. Ends with status 0 if PythonFMU still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'pythonfmu==0.7.0' 'fmpy==0.3.32'

cat > "$work/controller.py" <<'PYTHON'
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Controller(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.error = 0.0
        self.output = 0.0
        self._integral = 0.0
        self.register_variable(Real("error", causality=Fmi2Causality.input))
        self.register_variable(Real("output", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self._integral += self.error * step_size
        self.output = self.error + self._integral
        return True
PYTHON
"$work/env/bin/pythonfmu" build --handle-state -f "$work/controller.py" -d "$work"

"$work/env/bin/python" - "$work" <<'PYTHON'
import sys
from importlib.metadata import version
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

work = Path(sys.argv[1])
description = read_model_description(work / "Controller.fmu")
reference = {variable.name: variable.valueReference for variable in description.modelVariables}
fmu = FMU2Slave(
    guid=description.guid,
    unzipDirectory=extract(work / "Controller.fmu", work / "unzipped"),
    modelIdentifier=description.coSimulation.modelIdentifier,
    instanceName="controller",
)
fmu.instantiate()
fmu.setupExperiment(startTime=0.0)
fmu.enterInitializationMode()
fmu.setReal([reference["error"]], [1.0])
fmu.exitInitializationMode()


def output():
    return fmu.getReal([reference["output"]])[0]


# fmpy raises an error if a call returns anything but fmi2OK or fmi2Warning.
fmu.doStep(0.0, 1.0)
before = output()
state = fmu.getFMUState()
restored, repeated = [], []
for _ in range(3):
    fmu.doStep(1.0, 1.0)
    repeated.append(output())
    fmu.setFMUState(state)
    restored.append(output())

claim = description.coSimulation.canGetAndSetFMUstate
print(f"pythonfmu {version('pythonfmu')}, driven by fmpy {version('fmpy')}: canGetAndSetFMUstate is {claim}")
print(f"  output at 1 s: {before}; after each return to that state: {restored}")
print(f"  output at 2 s, the same step from the same state three times: {repeated}")
sys.exit(not (claim and restored == [before] * 3 and repeated == [3.0, 4.0, 5.0]))
PYTHON
