"""Check an FMU of anybody's: first what can be read, then, if wanted, what it does when it runs."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from lxml import etree

from fmu.archives.checks import DESCRIPTION, LIMITS, ArchiveLimits
from fmu.archives.reading import Archive, ArchiveError
from fmu.importer.unpacking import unpack
from fmu.validate.findings import Finding, Report, error, note, quoted, warning
from fmu.validate.reading.description import Description
from fmu.validate.reading.read_description import read_description
from fmu.validate.reading.xml_file import XmlError, as_utf8, parse, require_size, schema_findings
from fmu.validate.rules.binaries import binary_findings
from fmu.validate.rules.files import file_findings
from fmu.validate.rules.fmpy_validation import fmpy_findings
from fmu.validate.rules.interfaces import interface_findings
from fmu.validate.rules.structure import structure_findings
from fmu.validate.rules.units import unit_findings
from fmu.validate.rules.variables import variable_findings
from fmu.validate.smoke.child_process import RunLimits
from fmu.validate.smoke.smoke_run import run_fmu

SAFETY = "FMI 3.0.2 section 2.5: ZIP with store or deflate, no encryption, '/' between folders"
_REMARKS = {"backslash": error, "duplicate": warning}
_SCHEMAS = {2: "fmi2/fmi2ModelDescription.xsd", 3: "fmi3/fmi3ModelDescription.xsd"}


def check_fmu(
    path: str | Path, *, run: bool = True, archive_limits: ArchiveLimits = LIMITS, run_limits: RunLimits | None = None
) -> Report:
    """Check an FMU of FMI 2.0 or 3.0: archive, schemas, semantic rules, symbols and a run.

    The archive is refused before anything is written; its XML is parsed without entities and network; binaries are
    read, not loaded.  Only the run executes the FMU's native code, in a child process with limits: those hold off
    crashes, hangs and floods, not an attacker.

    Parameters
    ----------
    path : str or Path
        The FMU.
    run : bool
        Whether to execute the FMU's native code.
    archive_limits : ArchiveLimits
    run_limits : RunLimits, optional

    Returns
    -------
    Report
        Without an error in it if the FMU is sound.

    Raises
    ------
    OSError
        If the file cannot be read, or there is no room to extract it.
    """
    report = Report(str(path))
    if Path(path).suffix.lower() != ".fmu":
        report.extend([error("archive.suffix", f"The file {quoted(Path(path).name)} must end in .fmu.", SAFETY)])
    try:
        with Archive(path, archive_limits) as archive:
            report.extend(_REMARKS[rule](f"archive.{rule}", sentence, SAFETY) for rule, sentence in archive.remarks)
            _check(archive, report, run_limits or RunLimits() if run else None)
    except ArchiveError as refused:
        report.extend(error(f"archive.{rule}", sentence, SAFETY) for rule, sentence in refused.problems)
    return report


def _check(archive: Archive, report: Report, run_limits: RunLimits | None) -> None:
    try:
        require_size(archive.size(DESCRIPTION), DESCRIPTION)
        content, coding = as_utf8(archive.read(DESCRIPTION), DESCRIPTION)
        report.extend(coding)
        root = parse(content, DESCRIPTION)
    except XmlError as refused:
        report.extend([refused.finding])
        return
    major = _major(root, report)
    if major is None:
        return
    unfit = schema_findings(root, DESCRIPTION, _SCHEMAS[major])
    report.extend(unfit)
    if unfit:
        text = "Semantic rules, binaries and run were left out: they need a description that fits the schema."
        report.extend([note("schema.rest", text)])
        return
    description = read_description(root)
    report.kinds = tuple(description.interfaces)
    report.extend(_static(archive, content, description))
    if run_limits is None:
        report.extend([note("run.off", "The FMU's native code was not run, as asked for.")])
        return
    with tempfile.TemporaryDirectory(prefix="hybrid-fmu-", ignore_cleanup_errors=True) as folder:
        unpacked = Path(folder) / "fmu"
        unpacked.mkdir()
        unpack(archive, unpacked)
        executed, findings = run_fmu(unpacked, description, run_limits)
    report.executed = executed
    report.extend(findings)


def _major(root: etree._Element, report: Report) -> int | None:
    version = root.get("fmiVersion")
    report.fmi_version = version
    if root.tag != "fmiModelDescription" or version is None:
        report.extend(
            [error("xml.root", f"{DESCRIPTION} is no model description: its root is {quoted(str(root.tag))}.")]
        )
        return None
    for major in _SCHEMAS:
        if version.startswith(f"{major}."):
            return major
    text = (
        "of FMI 1.0, which is not supported"
        if version.startswith("1.")
        else f"of FMI {quoted(version)}, not known here"
    )
    report.extend([error("xml.version", f"The FMU is {text}: FMUs of FMI 2.0 and 3.0 are checked.")])
    return None


def _static(archive: Archive, content: bytes, description: Description) -> Iterator[Finding]:
    yield from fmpy_findings(content, description)
    yield from unit_findings(description)
    yield from variable_findings(description)
    yield from structure_findings(description)
    yield from interface_findings(description)
    yield from file_findings(archive, description)
    yield from binary_findings(archive, description)
