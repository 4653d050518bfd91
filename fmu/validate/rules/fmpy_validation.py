"""What fmpy's own validation says of a description."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

from fmpy import read_model_description
from fmpy.model_description import ValidationError

from fmu.validate.findings import Finding, error, note
from fmu.validate.reading.description import Description

_MANY = 5
_INITIAL = re.compile(r".*InitialUnknowns does not contain.*Expected \{(.*)\} but was \{(.*)\}\.", re.DOTALL)


def fmpy_findings(content: bytes, description: Description) -> list[Finding]:
    """Return fmpy's findings.

    fmpy gets the description alone, which has been parsed safely and fits the schema, never the archive.  Its rule for
    names is left out, for it takes a general parser to each name; `fmu.validate.rules.variables` has the same rule.

    Parameters
    ----------
    content : bytes
        modelDescription.xml.
    description : Description
        The same, as read.

    Returns
    -------
    list of Finding
    """
    with tempfile.TemporaryDirectory(prefix="hybrid-fmu-") as folder:
        (Path(folder) / "modelDescription.xml").write_bytes(content)
        try:
            read_model_description(folder, validate=True, validate_variable_names=False, validate_model_structure=True)
        except ValidationError as problems:
            return [_finding(str(problem), description) for problem in problems.problems]
        except Exception as problem:  # noqa: BLE001 - fmpy raises whatever its reading of strange descriptions meets
            return [
                error(
                    "fmpy.unreadable", f"fmpy cannot read the description: {type(problem).__name__}: {problem}.", "fmpy"
                )
            ]
    return []


def _finding(problem: str, description: Description) -> Finding:
    match = _INITIAL.fullmatch(problem)
    if match is not None:
        expected, actual = (set(filter(None, group.split(", "))) for group in (match[1].strip(), match[2].strip()))
        clocks = {variable.name for variable in description.variables if variable.type == "Clock"}
        clocked = {variable.name for variable in description.variables if variable.clocks}
        if expected != actual and expected - actual <= clocks and actual - expected <= clocked:
            return note(
                "fmpy.clocks",
                f"fmpy asks for the clocks {_some(sorted(expected - actual))} among the "
                "InitialUnknowns; "
                "the standard does not: clocks have no initial value.",
                "FMI 3.0.2 section 2.4.8, InitialUnknown",
            )
    return error("fmpy.validation", problem, "fmpy.validation")


def _some(names: list[str]) -> str:
    """Return names joined by commas, the first few of many."""
    shown = ", ".join(names[:_MANY]) or "(none)"
    return shown + (f" and {len(names) - _MANY} more" if len(names) > _MANY else "")
