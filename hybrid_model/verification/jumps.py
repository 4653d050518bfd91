"""Check the jumps of samples: that one of the automaton's jumps was due, and that it leads to the next sample."""

from __future__ import annotations

import numpy as np

from hybrid_model.declare.transitions import Priority, Trigger
from hybrid_model.declare.variables import FloatArray
from hybrid_model.verification.flows import nearby
from hybrid_model.verification.report import Findings
from hybrid_model.verification.slack import Slack
from hybrid_model.verification.subject import Subject


class JumpCheck:
    """Checks one jump after the other.

    Parameters
    ----------
    subject : Subject
        Automaton and samples.
    slack : Slack
        How far samples may be from an exact run.
    findings : Findings
        Where violations go.
    """

    def __init__(self, subject: Subject, slack: Slack, findings: Findings) -> None:
        self._subject = subject
        self._slack, self._findings = slack, findings

    def check(self, k: int) -> None:
        """Check the jump from sample `k` to the next."""
        infos = self._subject.automaton.jumps
        lateness = self._lateness(k)
        enabled = [i for i in range(len(infos)) if lateness[i][1]]
        landing = [i for i in range(len(infos)) if self._lands(i, k)]
        taken = [i for i in landing if i in enabled]
        if not taken:
            self._report(k, enabled, landing, lateness)
            return
        first = next((i for i in enabled if lateness[i][2]), len(infos))
        if first < taken[0]:
            self._findings.add(
                k,
                6,
                "order",
                f"jump {infos[taken[0]].name!r} was taken although {infos[first].name!r}, which comes before it, was "
                "due.",
            )
        if all(infos[i].trigger is Trigger.STATE for i in taken):
            self._flow_priority(k, infos[taken[0]].name)

    def _lateness(self, k: int) -> list[tuple[float, bool, bool]]:
        """Return for each jump its margin (for time events the time in s since it was due), and whether it was due
        within the tolerances, and beyond doubt.
        """
        subject, slack = self._subject, self._slack
        rows = np.array([subject.jump_margins(*point, k) for point in nearby(subject, k, slack.time)])
        t = float(subject.samples.t[k])
        allowed = slack.of_margins(lambda x: subject.jump_margins(t, x, k), subject.x[k])
        found: list[tuple[float, bool, bool]] = [(0.0, False, False)] * len(subject.automaton.jumps)
        for index, column, within in zip(subject.guards, rows.T, allowed, strict=True):
            due = bool(np.max(column) >= -within)
            found[index] = float(column[0]), due, bool(np.min(column) > within)
        for index, time in zip(subject.timed, subject.event_times(k), strict=True):
            since = float(subject.samples.t[k] - time)
            found[index] = since, since >= -slack.time, since >= 0.0
        return found

    def _difference(self, index: int, k: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return where a jump leads, where the samples go, and how much these may differ."""
        subject = self._subject
        expected = subject.reset(index, k)
        found = np.concatenate([subject.x[k + 1], subject.z[k + 1]])
        return expected, found, self._slack.between(found, expected)

    def _lands(self, index: int, k: int) -> bool:
        expected, found, allowed = self._difference(index, k)
        return bool(np.all(np.abs(found - expected) <= allowed))

    def _report(self, k: int, enabled: list[int], landing: list[int], lateness: list[tuple[float, bool, bool]]) -> None:
        infos = self._subject.automaton.jumps
        if enabled:
            names = self._subject.names
            expected, found, allowed = self._difference(enabled[0], k)
            i = int(np.argmax(np.nan_to_num(np.abs(found - expected) / allowed, nan=np.inf)))
            self._findings.add(
                k,
                2,
                "jump map",
                f"jump {infos[enabled[0]].name!r} was due and leads to {names[i]} = {expected[i]:.12g}, but the "
                f"samples go to {found[i]:.12g}.",
            )
            return
        culprits = landing or range(len(infos))
        why = ", ".join(
            f"{infos[i].name!r} has margin {lateness[i][0]:.3g}"
            if infos[i].trigger is Trigger.STATE
            else f"{infos[i].name!r} is due {-lateness[i][0]:.3g} s later"
            for i in culprits
        )
        rule = 5 if landing and infos[landing[0]].trigger is Trigger.TIME else 3
        self._findings.add(k, rule, "jump set", f"a jump was taken while none was due: {why or 'there are no jumps'}.")

    def _flow_priority(self, k: int, name: str) -> None:
        """Under flow priority a jump on state happens only where no flow is possible."""
        subject = self._subject
        if subject.automaton.priority is not Priority.FLOW:
            return
        margins = [subject.flow_margin(*point, k) for point in nearby(subject, k, self._slack.time)]
        t = float(subject.samples.t[k])
        allowed = self._slack.of_margins(lambda x: np.array([subject.flow_margin(t, x, k)]), subject.x[k])
        if min(margins) > allowed[0]:
            self._findings.add(
                k,
                2,
                "priority",
                f"jump {name!r} was taken with margin {margins[0]:.3g} of the flow set left: flow has priority.",
            )
