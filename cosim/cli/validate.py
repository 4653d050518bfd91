"""`hybrid-fmu validate`: check anybody's FMU."""

from __future__ import annotations

import argparse
import json
import textwrap
from pathlib import Path

from cosim.cli.exits import Exit, progress
from cosim.errors import UsageError
from fmu.validate.check import check_fmu
from fmu.validate.findings import Report, Severity
from fmu.validate.smoke.child_process import RunLimits

_DESCRIPTION = """\
Check an FMU of FMI 2.0 or 3.0: safety of the archive, schemas, fmpy's checks, semantic rules, exported symbols, and a
short run of each interface type. The run executes the FMU's native code, in a child process with limits of time, memory
and file size; these hold off crashes and hangs, not an attacker: give --no-run for an FMU that you do not trust.
Errors are what the standard forbids or importers suffer from; warnings are weakness against misuse (steps that are not
a number, a wrong token), broken additions (sources, manifests of layered standards) and what fails on some machines;
notes are good to know. Exit status: 0 no error, 1 at least one error (with --strict: or warning), 2 wrong usage."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.description = _DESCRIPTION
    parser.add_argument("fmu", metavar="FILE.fmu", type=Path)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--no-run", action="store_true", help="do not execute the FMU's native code")
    parser.add_argument("--strict", action="store_true", help="warnings count as errors")
    parser.add_argument(
        "--timeout", type=float, default=RunLimits.seconds, metavar="S", help="limit of each run in seconds"
    )
    parser.add_argument(
        "--memory", type=int, default=RunLimits.memory >> 20, metavar="MIB", help="limit of memory in MiB"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    if not options.fmu.is_file():
        raise UsageError(f"{options.fmu} is not a file: give the path of an FMU.")
    if not 0.0 < options.timeout < 1e6 or not 64 <= options.memory < 1 << 30:
        raise UsageError("--timeout must be a positive number of seconds and --memory at least 64 MiB.")
    progress(f"checking {options.fmu}")
    limits = RunLimits(seconds=options.timeout, memory=options.memory << 20)
    report = check_fmu(options.fmu, run=not options.no_run, run_limits=limits)
    print(json.dumps(report.as_dict(), indent=2) if options.json else as_text(report, strict=options.strict))
    wrong = not report.ok or (options.strict and report.count(Severity.WARNING) > 0)
    return Exit.FAILED if wrong else Exit.DONE


def as_text(report: Report, *, strict: bool = False) -> str:
    """Return a report for people: findings by what was looked at, the worst first; where strict, warnings count."""
    title = f"{report.path}: FMI {report.fmi_version or 'unknown'}"
    lines = [", ".join([title, *report.kinds])]
    order = list(Severity)
    for group in dict.fromkeys(finding.group for finding in report.findings):
        lines.append(f"\n{group}")
        found = [finding for finding in report.findings if finding.group == group]
        for finding in sorted(found, key=lambda finding: order.index(finding.severity)):
            head = f"  {finding.severity.value:<8}"
            reference = f" ({finding.reference})" if finding.reference else ""
            text = f"{finding.message} [{finding.rule}]{reference}"
            lines += textwrap.wrap(text, 116, initial_indent=head, subsequent_indent=" " * len(head))
    counts = ", ".join(f"{report.count(severity)} {severity.value}s" for severity in Severity)
    ran = f"; run: {', '.join(report.executed)}" if report.executed else "; not run"
    verdict = "sound" if report.ok else "NOT SOUND"
    if strict and report.ok and report.count(Severity.WARNING):
        verdict = "NOT SOUND by --strict"
    lines.append(f"\n{verdict}: {counts}{ran}")
    return "\n".join(lines)
