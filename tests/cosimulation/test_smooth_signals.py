"""Slopes of outputs, and inputs that go along straight lines, of FMUs that offer them: fewer steps to the same end."""

import zipfile

import fmpy
import numpy as np
import pytest

from cosim.fmu_slave import FmuSlave
from cosim.isolation.isolated_slave import IsolatedSlave
from cosim.masters import run_error_controlled
from cosim.system import System

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="smooth" guid="smooth">
  <CoSimulation modelIdentifier="smooth2" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"
    {offers}/>
  <ModelVariables>
    <ScalarVariable name="x" valueReference="0" causality="output" initial="exact"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="u" valueReference="1" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="gain" valueReference="2" causality="parameter" variability="fixed">
      <Real start="1"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="1" {depends}/></Outputs></ModelStructure>
</fmiModelDescription>
"""
SLOPES, LINES = 'maxOutputDerivativeOrder="1"', 'canInterpolateInputs="true"'
STOP = 3.0


@pytest.fixture
def smooth(foreign_binary, tmp_path):
    def write(*offers, depends='dependencies=""'):
        path = tmp_path / f"smooth{len(list(tmp_path.iterdir()))}.fmu"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", DESCRIPTION.format(offers=" ".join(offers), depends=depends))
            archive.write(foreign_binary("smooth2.c"), f"binaries/{fmpy.platform}/smooth2.so")
        return path

    return write


def oscillator(path, tolerance, kind=FmuSlave):
    """x' = y and y' = -x from 1 and 0: x = cos t. Returns the steps and the error at the end."""
    slaves = [kind("x", path), kind("y", path)]
    slaves[0].set("x", 1.0)
    slaves[1].set("gain", -1.0)
    result = run_error_controlled(System(slaves, {"x.u": "y.x", "y.u": "x.x"}), STOP, tolerance=tolerance)
    return result.steps, abs(result.final["x.x"] - np.cos(STOP))


def test_what_is_offered_saves_steps_and_is_more_accurate(smooth):
    """Straight lines are of third order where slopes make the extrapolation so; what stands still is of second."""
    tolerance = 1e-8
    plain, _ = oscillator(smooth(), tolerance)
    found = {offers: oscillator(smooth(*offers), tolerance) for offers in ((SLOPES,), (LINES,), (SLOPES, LINES))}
    # Of constant inputs it is the standing still that makes the error, and not what is expected of them.
    assert found[(SLOPES,)][0] <= 1.05 * plain
    assert found[(LINES,)][0] < 0.6 * plain
    assert found[SLOPES, LINES][0] < 0.25 * plain
    for steps, error in found.values():
        assert error < tolerance * steps / 4.0  # two slaves, each with half steps
    both = smooth(SLOPES, LINES)
    assert oscillator(both, 1e-5, IsolatedSlave) == oscillator(both, 1e-5)


@pytest.mark.parametrize("depends", ["", 'dependencies="2"'])
def test_slopes_of_what_depends_on_inputs_at_once_are_not_asked_for(depends, smooth):
    """They are for inputs that stand still, as far as the FMU knows; nothing said is all inputs (FMI 2.0.4, 2.2.8)."""
    slave = FmuSlave("x", smooth(SLOPES, LINES, depends=depends))
    assert (slave.sloped, slave.interpolating) == ([], ["u"])
    slave = FmuSlave("x", smooth(SLOPES))
    assert (slave.sloped, slave.interpolating) == (["x"], ())
