"""What a check of an FMU found."""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any


class Severity(enum.Enum):
    """How much a finding matters."""

    ERROR = "error"
    """A rule of the standard is broken, or importers are harmed: only errors decide the verdict."""
    WARNING = "warning"
    """Weak against misuse, an addition that is broken, or known to fail with some importer or machine."""
    NOTE = "note"
    """Good to know: what was left out, or what a machine needs."""


@dataclass(frozen=True)
class Finding:
    """One thing that was found.

    Attributes
    ----------
    severity : Severity
    rule : str
        Stable name of the rule, ``group.rule``; the group is what was looked at (archive, xml, schema, ...).
    message : str
        Names the thing, the value, the rule and the remedy.
    reference : str
        Where the rule comes from: section of the standard, or what else it rests on.
    """

    severity: Severity
    rule: str
    message: str
    reference: str = ""

    @property
    def group(self) -> str:
        """First part of the rule's name."""
        return self.rule.partition(".")[0]


def error(rule: str, message: str, reference: str = "") -> Finding:
    """Return a finding that makes the FMU fail."""
    return Finding(Severity.ERROR, rule, _printable(message), reference)


def warning(rule: str, message: str, reference: str = "") -> Finding:
    """Return a finding that a careful author looks at."""
    return Finding(Severity.WARNING, rule, _printable(message), reference)


def note(rule: str, message: str, reference: str = "") -> Finding:
    """Return a finding that only informs."""
    return Finding(Severity.NOTE, rule, _printable(message), reference)


def softened(finding: Finding) -> Finding:
    """Return an error as a warning; other findings as they are."""
    return replace(finding, severity=Severity.WARNING) if finding.severity is Severity.ERROR else finding


def _printable(text: str) -> str:
    # Names come from strangers: control characters would reach a terminal, lone surrogates no UTF-8 file.
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


def quoted(name: str, limit: int = 80) -> str:
    """Return a stranger's name in quotes, shortened."""
    return repr(name if len(name) <= limit else f"{name[:limit]}...")


LIMIT = 20
"""Findings of one rule that are kept; one more says how many there are."""


@dataclass
class Report:
    """All findings of one FMU.

    Attributes
    ----------
    path : str
        The file.
    fmi_version : str or None
        As the description says, if it could be read.
    kinds : tuple of str
        Interface types: ``"CoSimulation"``, ``"ModelExchange"``, ``"ScheduledExecution"``.
    executed : tuple of str
        Interface types of which the native code has been run.
    findings : list of Finding
    """

    path: str
    fmi_version: str | None = None
    kinds: tuple[str, ...] = ()
    executed: tuple[str, ...] = ()
    findings: list[Finding] = field(default_factory=list)

    def extend(self, findings: Iterable[Finding]) -> None:
        """Add findings, equal ones once; beyond `LIMIT` of one rule they are counted only."""
        for finding in findings:
            if finding in self.findings:
                continue
            same = sum(1 for known in self.findings if known.rule == finding.rule)
            if same < LIMIT:
                self.findings.append(finding)
            elif same == LIMIT:
                text = f"There are more findings of {finding.rule}: correct these first."
                self.findings.append(Finding(finding.severity, finding.rule, text))

    def count(self, severity: Severity) -> int:
        """Return the number of findings of a severity."""
        return sum(1 for finding in self.findings if finding.severity is severity)

    @property
    def ok(self) -> bool:
        """Whether there is no error."""
        return self.count(Severity.ERROR) == 0

    def as_dict(self) -> dict[str, Any]:
        """Return the report as JSON takes it."""
        return {
            "file": self.path,
            "ok": self.ok,
            "fmi_version": self.fmi_version,
            "kinds": list(self.kinds),
            "executed": list(self.executed),
            "errors": self.count(Severity.ERROR),
            "warnings": self.count(Severity.WARNING),
            "notes": self.count(Severity.NOTE),
            "findings": [
                {"severity": f.severity.value, "rule": f.rule, "message": f.message, "reference": f.reference}
                for f in self.findings
            ],
        }
