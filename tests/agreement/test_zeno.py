"""A Zeno model in an FMU ends as a clean refusal at the accumulation time, never as a hang or below the floor.

Each run is a child process under a time limit: if the guard failed, the test would too, and not the whole suite.
"""

import numpy as np
import pytest
from catalogue import cases
from child_python import run_child

from hybrid_model.models import BouncingBall

ACCUMULATION = np.sqrt(2 / 9.81) * 1.7 / 0.3

SIMULATE = """
import sys, fmpy
messages = []
log = lambda environment, status, category, message: messages.append(message.decode())
try:
    result = fmpy.simulate_fmu(sys.argv[1], stop_time=5.0, output_interval=0.01, logger=log,
                               use_event_mode=sys.argv[2] == "1", early_return_allowed=sys.argv[3] == "1")
    print(result["time"][-1], min(result["h"]))
except Exception as error:
    print("refused", error)
print(messages[-1] if messages else "silent")
"""


@pytest.mark.parametrize(("events", "early"), [("0", "0"), ("1", "0"), ("1", "1")])
def test_fmpy_run_beyond_the_accumulation_ends(events, early, exported):
    end, message = run_child(SIMULATE, exported(BouncingBall(), "ball"), events, early).splitlines()[-2:]
    assert "accumulate at t = 2.5586" in message
    if not end.startswith("refused"):
        time, lowest = map(float, end.split())
        assert time <= ACCUMULATION + 0.01
        assert lowest >= -1e-9


LOW_LEVEL = """
import sys, fmpy
from fmpy.fmi3 import FMU3Slave
description = fmpy.read_model_description(sys.argv[1])
messages = []
log = lambda environment, status, category, message: messages.append(message.decode())
fmu = FMU3Slave(guid=description.instantiationToken, unzipDirectory=fmpy.extract(sys.argv[1]),
                modelIdentifier=description.coSimulation.modelIdentifier, instanceName="ball")
fmu.instantiate(logMessage=log)
fmu.enterInitializationMode(startTime=0.0)
fmu.exitInitializationMode()
event, terminate, early, reached = fmu.doStep(0.0, 5.0)
print(terminate, reached)
print(fmu.getFloat64([v.valueReference for v in description.modelVariables if v.name == "h"])[0])
print(messages[-1])
try:
    fmu.doStep(reached, 1.0)
    print("went on")
except Exception as error:
    print("refused")
"""


def test_one_long_step_ends_at_the_accumulation_and_further_steps_are_refused(exported):
    first, height, message, last = run_child(LOW_LEVEL, exported(BouncingBall(), "ball")).splitlines()[-4:]
    terminate, reached = first.split()
    assert terminate == "True"
    assert float(reached) == pytest.approx(ACCUMULATION, abs=1e-3)
    assert float(height) >= -1e-9
    assert "accumulate at t = 2.5586" in message
    assert last == "refused"


INTEGRATED = """
import sys, fmpy
try:
    result = fmpy.simulate_fmu(sys.argv[1], stop_time=5.0, output_interval=0.01, fmi_type=sys.argv[2])
    print(result["time"][-1], min(result["h"]))
except Exception as error:
    print("refused", error)
"""


@pytest.mark.parametrize(("fmi", "kind"), [("2.0", "CoSimulation"), ("2.0", "ModelExchange"), ("3.0", "ModelExchange")])
def test_other_versions_and_kinds_in_fmpy_end_as_well(fmi, kind, exported):
    """FMI 2.0 by fmi2Discard with Terminated; Model Exchange by terminateSimulation, under the importer's CVode."""
    told = run_child(INTEGRATED, exported(BouncingBall(), "ball", fmi), kind)
    assert "Zeno: " in told
    end = told.splitlines()[-1]
    if not end.startswith("refused"):
        time, lowest = map(float, end.split())
        # CVode's own relative tolerance is 1e-5 there.
        assert time == pytest.approx(ACCUMULATION, abs=1e-3)
        assert lowest >= -1e-9


LATE = """
import sys, fmpy
try:
    fmpy.simulate_fmu(sys.argv[1], start_time=1e6, stop_time=1e6 + 1)
except Exception as error:
    print("refused")
"""


def test_a_run_that_starts_later_than_its_clock_names_the_remedy(exported):
    """Samples are due at 0, 0.13, ... s, which is millions of them at 1e6 s."""
    told = run_child(LATE, exported(cases()["analog_digital_loop"].automaton, "analog_digital_loop"))
    assert "declare the clock's state with computed=True and let start_map give the next time to come." in told
    assert told.endswith("refused")
