"""What a verification finds, in sentences."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hybrid_model.record.samples import Samples


@dataclass(frozen=True)
class Violation:
    """One way in which samples are not a hybrid arc of the automaton.

    Attributes
    ----------
    t, j : float, int
        Hybrid time, t in s, of the first sample that shows it.
    sample : int
        Its number among the samples.
    rule : int
        Number of the rule in docs/semantics.md.
    message : str
        What is wrong, with names and numbers.
    count : int
        How often the same is wrong at this j.
    """

    t: float
    j: int
    sample: int
    rule: int
    message: str
    count: int = 1

    def __str__(self) -> str:
        more = f" (and {self.count - 1} times more at this j)" if self.count > 1 else ""
        return f"(t, j) = ({self.t:.9g} s, {self.j}), rule {self.rule}: {self.message}{more}"


@dataclass(frozen=True)
class Verification:
    """The result of `verify`.

    Attributes
    ----------
    automaton : str
        Name of the automaton.
    violations : tuple of Violation
        In the order of the samples.
    samples, flows, jumps : int
        How much was checked: samples, flows with a length, jumps.
    """

    automaton: str
    violations: tuple[Violation, ...]
    samples: int
    flows: int
    jumps: int

    @property
    def ok(self) -> bool:
        """Whether the samples are a hybrid arc of the automaton."""
        return not self.violations

    def __str__(self) -> str:
        checked = f"{self.samples} samples, {self.flows} flows and {self.jumps} jumps"
        if self.ok:
            return f"a hybrid arc of {self.automaton}: {checked} checked."
        lines = [f"not a hybrid arc of {self.automaton} ({checked} checked):", *map(str, self.violations)]
        return "\n".join(lines)


class Findings:
    """Collects violations; what is wrong in the same way again at the same j is counted.

    Parameters
    ----------
    samples : Samples
        What is verified.
    """

    def __init__(self, samples: Samples) -> None:
        self._samples = samples
        self._found: dict[tuple[int, str, int], Violation] = {}

    def add(self, k: int, rule: int, what: str, message: str) -> None:
        """Note a violation at sample `k`; `what` tells kinds of violation apart."""
        j = int(self._samples.j[k])
        key = (rule, what, j)
        if key in self._found:
            self._found[key] = replace(self._found[key], count=self._found[key].count + 1)
        else:
            self._found[key] = Violation(float(self._samples.t[k]), j, k, rule, message)

    def violations(self) -> tuple[Violation, ...]:
        """Return what was found, in the order of the samples."""
        return tuple(sorted(self._found.values(), key=lambda violation: (violation.sample, violation.rule)))
