"""The C functions of an FMU, called one by one with a record of where the process is."""

from __future__ import annotations

import ctypes as c
import json
import mmap
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from fmu.standard.functions import spelled

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")
PLACE_BYTES = 512
EXTERNAL = "FMI 2.0.4 section 2.3; FMI 3.0.2 section 2.5.1: external libraries"


class Stopped(Exception):
    """The experiment cannot go on."""


class Refused(Stopped):
    """A call was refused that an FMU may refuse: the experiment finds nothing."""


class Variable(NamedTuple):
    """A variable as the plan has it."""

    name: str
    reference: int
    type: str
    size: int
    causality: str
    start: list[str] | None
    readable: bool


class Update(NamedTuple):
    """What the update of discrete states says."""

    again: bool
    terminate: bool
    next_time: float | None


class Step(NamedTuple):
    """What a step says; `status` is OK, WARNING or DISCARD."""

    status: int
    event: bool
    terminate: bool
    early: bool
    time: float


class Recorder:
    """Where the process is, and what was found; both in files, which outlive a crash."""

    def __init__(self, place: str, findings: str) -> None:
        with Path(place).open("r+b") as file:
            self._place = mmap.mmap(file.fileno(), PLACE_BYTES)
        self._findings = Path(findings).open("a", encoding="utf-8", buffering=1)  # noqa: SIM115 - for life

    def at(self, text: str) -> None:
        """Note what is about to be called."""
        self._place[:] = text.encode("utf-8", "replace")[: PLACE_BYTES - 1].ljust(PLACE_BYTES, b"\0")

    def find(self, severity: str, rule: str, message: str, reference: str | None = None) -> None:
        """Write a finding; without a reference it rests on the life cycle of the standard."""
        line = {"severity": severity, "rule": rule, "message": message, "reference": reference}
        self._findings.write(json.dumps(line) + "\n")

    def stop(self, rule: str, message: str, reference: str | None = None) -> Stopped:
        """Write an error after which the experiment ends; raise what is returned."""
        self.find("error", rule, message, reference)
        return Stopped()

    def done(self) -> None:
        """Note that the experiment has come to its end."""
        self._findings.write('{"done": true}\n')


class Library:
    """A loaded binary and one instance of its FMU; functions go by their names of FMI 3.0.

    Where it is `lenient`, a refused call ends the experiment without a finding.
    """

    major: int

    def __init__(self, plan: dict[str, Any], recorder: Recorder) -> None:
        self.plan, self.recorder = plan, recorder
        self.messages: list[str] = []
        self.variables = [Variable(*entry) for entry in plan["variables"]]
        self.handle: c.c_void_p | None = None
        self.lenient = False
        recorder.at("loading the binary")
        try:
            self.library = c.CDLL(plan["binary"])
        except OSError as error:
            raise self._unloaded(str(error)) from error

    def _unloaded(self, problem: str) -> Stopped:
        library = problem.partition(":")[0]
        if "cannot open shared object file" in problem and library != self.plan["binary"]:
            text = f"This machine lacks the library {library}, which the binary needs: it was not run."
            self.recorder.find("warning", "run.library", text, EXTERNAL)
            return Stopped()
        return self.recorder.stop("run.load", f"The binary cannot be loaded: {problem}.", EXTERNAL)

    def spelled(self, name: str) -> str:
        """Return the whole name of a function of FMI 3.0 in this version of the standard."""
        return spelled(self.major, name)

    def function(self, name: str) -> Callable[..., Any]:
        """Look up a function."""
        try:
            found: Callable[..., Any] = getattr(self.library, self.spelled(name))
        except AttributeError as error:
            raise self.recorder.stop("run.load", f"{self.spelled(name)} is missing in the binary.") from error
        return found

    def call(self, name: str, *arguments: Any, shown: str = "") -> int:
        """Call a function of the instance and return its status."""
        self.recorder.at(f"{self.spelled(name)}({shown})")
        return int(self.function(name)(self.handle, *arguments))

    def do(self, name: str, *arguments: Any, shown: str = "", may_discard: bool = False) -> None:
        """Call a function that must succeed here, or at least be able to: it may have no answer at this point."""
        status = self.call(name, *arguments, shown=shown)
        if status not in (OK, WARNING) and self.lenient:
            raise Refused
        if status == DISCARD and may_discard:
            text = f"{self.spelled(name)} discards: the rest of this experiment is left out ({self.said()})."
            self.recorder.find("note", "run.discard", text)
            raise Refused
        self.require(name, status, shown)

    def require(self, name: str, status: int, shown: str = "") -> None:
        """Stop the experiment if a call was refused."""
        if status not in (OK, WARNING):
            raise self.recorder.stop(
                "run.refused",
                f"{self.spelled(name)}({shown}) returns {self.status(status)} in a legal call: {self.said()}.",
            )

    def said(self) -> str:
        """Return the last message of the FMU."""
        return self.messages[-1][:300] if self.messages else "it logged no message"

    @staticmethod
    def status(number: int) -> str:
        """Return the name of a status."""
        return STATUS[number] if 0 <= number < len(STATUS) else f"the unknown status {number}"

    def logged(self, message: bytes | None) -> None:
        """Keep a message of the FMU, a bounded number of them."""
        del self.messages[:-50]
        self.messages.append((message or b"").decode("utf-8", "replace"))
