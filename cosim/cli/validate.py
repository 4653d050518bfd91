"""`hybrid-fmu validate`: check anybody's FMU."""

from __future__ import annotations

import argparse
import json
import textwrap

from cosim.cli.exits import Exit
from cosim.cli.progress import Work
from fmu.validate.check import check_fmu
from fmu.validate.findings import Report, Severity
from fmu.validate.smoke.child_process import RunLimits


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    limits = RunLimits(seconds=options.timeout, memory=options.memory << 20)
    with Work() as work:
        work.begin(f"checking {options.fmu}")
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
