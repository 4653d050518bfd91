"""One line of a sound description changed: the binary contradicts it, and the run says so."""

import re
import zipfile

import pytest

from fmu.export import export_fmu
from fmu.validate.check import check_fmu
from fmu.validate.findings import Severity
from hybrid_model.models import BouncingBall


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    """The exported ball by version, with both interface types and with Co-Simulation alone."""
    folder, found = tmp_path_factory.mktemp("balls"), {}
    for major in (2, 3):
        found[major, "both"] = export_fmu(BouncingBall(), folder / f"{major}.fmu", fmi=f"{major}.0", stop_time=0.4)
        exchange = r"<ModelExchange(?s:.*?)(/>\s*<CoSimulation|</ModelExchange>\s*<CoSimulation)"
        found[major, "cs"] = mutant(found[major, "both"], folder / f"{major}cs.fmu", (exchange, "<CoSimulation"))
    return found


def mutant(path, target, *edits):
    """Write an FMU with edits (pattern, replacement) of its description, each of which must be made."""
    with zipfile.ZipFile(path) as archive, zipfile.ZipFile(target, "w") as copy:
        for member in archive.infolist():
            content = archive.read(member)
            if member.filename == "modelDescription.xml":
                text = content.decode()
                for pattern, replacement in edits:
                    text, count = re.subn(pattern, replacement, text)
                    assert count, pattern
                content = text.encode()
            copy.writestr(member, content)
    return target


def errors(report):
    return {finding.rule for finding in report.findings if finding.severity is Severity.ERROR}


EXCHANGED = {
    2: [('(name="der.h."(?s:.*?)derivative=")4', r"\g<1>5"), ('(name="der.v."(?s:.*?)derivative=")5', r"\g<1>4")],
    3: [('(name="der.h.".*derivative=")3', r"\g<1>4"), ('(name="der.v.".*derivative=")4', r"\g<1>3")],
}
DERIVATIVE = {2: 'index="6"', 3: '<ContinuousStateDerivative valueReference="5"'}
LEFT_OUT = {
    2: (rf'({DERIVATIVE[2]}) dependencies="5" dependenciesKind="constant"', r'\g<1> dependencies=""'),
    3: (rf'({DERIVATIVE[3]}) dependencies="4" dependenciesKind="constant"', r'\g<1> dependencies=""'),
}
INITIAL = {
    2: ('index="7" dependencies="2" dependenciesKind="constant"', 'index="7" dependencies=""'),
    3: ('valueReference="6" dependencies="1" dependenciesKind="constant"', 'valueReference="6" dependencies=""'),
}
NO_DIRECTIONAL = {
    2: ('providesDirectionalDerivative="true"', ""),
    3: ('provides(Directional|Adjoint)Derivatives="true"', ""),
}


@pytest.mark.parametrize("name", ["both", "cs"])
@pytest.mark.parametrize("major", [2, 3])
def test_derivatives_of_exchanged_states(major, name, balls, tmp_path):
    """By Model Exchange the states tell; by Co-Simulation alone, what grows by which derivative."""
    report = check_fmu(mutant(balls[major, name], tmp_path / "a.fmu", *EXCHANGED[major]))
    assert errors(report) == {"run.derivative_of"}
    found = [finding.message for finding in report.findings if finding.rule == "run.derivative_of"]
    assert all(
        "'der(h)' is the derivative of 'v'" in text or "'der(v)' is the derivative of 'h'" in text for text in found
    )
    static = [finding for finding in report.findings if finding.rule == "unit.derivative"]
    assert [finding.severity for finding in static] == [Severity.WARNING] * 2  # m/s is no rate of m/s, m/s2 none of m


@pytest.mark.parametrize("major", [2, 3])
def test_a_derivative_that_equals_a_state_depends_on_it(major, balls, tmp_path):
    """Also where the FMU has no directional derivatives of which to ask."""
    edits = (LEFT_OUT[major], NO_DIRECTIONAL[major])
    report = check_fmu(mutant(balls[major, "both"], tmp_path / "a.fmu", *edits))
    assert errors(report) == {"run.dependency"}
    texts = [f.message for f in report.findings if f.rule == "run.dependency"]
    assert any("moved states: The dependencies of 'der(h)' leave out 'v'" in text for text in texts)


@pytest.mark.parametrize("name", ["both", "cs"])
@pytest.mark.parametrize("major", [2, 3])
def test_initial_unknowns_depend_on_parameters(major, name, balls, tmp_path):
    """der(v) is -g from the start."""
    report = check_fmu(mutant(balls[major, name], tmp_path / "a.fmu", INITIAL[major]))
    assert errors(report) == {"run.dependency"}
    assert any("'der(v)' leave out 'g'" in finding.message for finding in report.findings)


@pytest.mark.parametrize("name", ["both", "cs"])
@pytest.mark.parametrize("major", [2, 3])
def test_the_unchanged_export_has_no_finding_that_counts(major, name, balls):
    report = check_fmu(balls[major, name])
    assert [finding for finding in report.findings if finding.severity is not Severity.NOTE] == []
