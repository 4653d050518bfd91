"""FMUs from anywhere: `HYBRID_FMU_STRANGERS=FOLDER pytest tests/cosimulation/test_folder_of_strangers.py`.

Each Co-Simulation FMU below the folder that fmpy runs is run by the fixed-step master too, to the same values at the
end: both make the same calls. Those with event mode come to an end under the event-exact master.
"""

import os
from pathlib import Path

import fmpy
import numpy as np
import pytest

from cosim.errors import CosimError
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.system import System

FOLDER = os.environ.get("HYBRID_FMU_STRANGERS")
FMUS = sorted(path for path in Path(FOLDER).rglob("*") if path.suffix.lower() == ".fmu") if FOLDER else []
STEPS = 50


def described(path):
    try:
        description = fmpy.read_model_description(str(path))
    except Exception as error:  # noqa: BLE001 - whatever fmpy raises, the FMU is not for this test
        pytest.skip(f"fmpy cannot read it: {error}")
    if description.fmiVersion == "1.0" or description.coSimulation is None:
        pytest.skip("no Co-Simulation of FMI 2.0 or 3.0")
    return description


def span(slave):
    start = slave.default_start_time or 0.0
    return start, (slave.default_step or 0.01)


@pytest.mark.skipif(not FOLDER, reason="HYBRID_FMU_STRANGERS names no folder")
@pytest.mark.parametrize("path", FMUS, ids=lambda path: path.stem)
def test_an_fmu_from_anywhere_gives_what_it_gives_in_fmpy(path):
    description = described(path)
    slave = FmuSlave("it", path)
    start, step = span(slave)
    stop = start + STEPS * step
    arguments = {"start_time": start, "stop_time": stop, "output_interval": step, "fmi_type": "CoSimulation"}
    try:
        expected = fmpy.simulate_fmu(str(path), step_size=step, **arguments)
    except Exception as error:  # noqa: BLE001 - whatever fmpy raises, there is nothing to compare
        pytest.skip(f"fmpy cannot run it: {error}")
    found = run_fixed_step(System([slave], {}), stop, step, t_start=start)
    for variable in description.modelVariables:
        name = variable.name
        if name in (expected.dtype.names or ()) and f"it.{name}" in found.final:
            np.testing.assert_allclose(found.final[f"it.{name}"], expected[name][-1], rtol=1e-9, err_msg=name)


@pytest.mark.skipif(not FOLDER, reason="HYBRID_FMU_STRANGERS names no folder")
@pytest.mark.parametrize("path", FMUS, ids=lambda path: path.stem)
def test_an_fmu_with_event_mode_comes_to_an_end_under_the_event_exact_master(path):
    described(path)
    slave = FmuSlave("it", path)
    if not (slave.has_event_mode and slave.variable_step):
        pytest.skip("no event mode, or steps of one length")
    start, step = span(slave)
    stop = slave.default_stop_time or start + STEPS * step
    try:
        result = run_event_exact(System([slave], {}), stop, t_start=start, output_interval=(stop - start) / STEPS)
    except CosimError as error:
        if "refuses to be instantiated" in str(error):
            pytest.skip(str(error))
        raise
    assert result.t == stop or result.message
