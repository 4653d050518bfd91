"""Good strangers are sound: the FMI Reference FMUs of a folder that the environment names; none is kept here."""

import os
from pathlib import Path

import pytest

from fmu.validate.check import check_fmu
from fmu.validate.findings import Severity

FOLDER = os.environ.get("HYBRID_FMU_REFERENCE_FMUS")
FILES = sorted(Path(FOLDER).rglob("*.fmu")) if FOLDER else []
TRUE = {"Stair": {"run.reset"}, "Roberts": {"run.instantiate", "run.dependency", "structure.dependency"}}
"""Errors that are true of an FMU."""

pytestmark = pytest.mark.skipif(not FILES, reason="HYBRID_FMU_REFERENCE_FMUS names no folder with FMUs")


@pytest.mark.parametrize("path", FILES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_reference_fmus_are_sound(path):
    report = check_fmu(path)
    if report.fmi_version is not None and report.fmi_version.startswith("1."):
        pytest.skip("FMI 1.0 is not supported")
    errors = {finding.rule for finding in report.findings if finding.severity is Severity.ERROR}
    assert errors <= TRUE.get(path.stem, set()), [finding.message for finding in report.findings]
    assert report.executed == report.kinds
