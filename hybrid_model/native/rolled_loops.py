"""Straight-line C of a traced map, rolled into loops where it says the same again and again.

The hub of a star has the same few statements for each of its neighbours. Compilers take more than proportionally long
for thousands of such lines. Statements that are equal but for the places of what they read and write, and for
constants, become one loop over tables; their order stays, so that values are the same to the last bit.

The text is CasADi's: each statement computes an element of an argument, a constant, or an expression of values that
are there, or writes an element of a result.
"""

from __future__ import annotations

import enum
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from hybrid_model.native.repeated_runs import Run, repeated_runs

__all__ = ["REPEATS", "Rolled", "rolled"]

REPEATS = 48
"""Fewer repetitions stay straight lines."""

Numbers = npt.NDArray[np.int64]
_DECLARATION = re.compile(r"  casadi_real a\d+(?:, a\d+)*;")
_RESULT = re.compile(r"  if \(res\[(\d+)\]!=0\) res\[\1\]\[(\d+)\]=(a\d+);")
_ELEMENT = re.compile(r"arg\[(\d+)\]\? arg\[\1\]\[(\d+)\] : 0;")
_EXPRESSION = re.compile(r"[^;\[\]]+;")
_SLOT = re.compile(r"\b(a\d+)\b")
_VALUE, _CONSTANT, _PLACE, _ARGUMENTS = range(4)
"""Kinds of operands: values of statements, constants, places in a result, and, behind these, elements of arguments."""
_KINDS = 64
"""More than there are: an operand is its number times that, and its kind."""
_OPERANDS = 3
"""Of a statement, at most."""
_Form: TypeAlias = tuple[tuple[str, ...], tuple[int, ...]]
_NEVER = -1
"""In the place of a statement of a loop: what is carried does not change."""


class Rolled(NamedTuple):
    """The body of a function in C, and how many doubles of its work array `w` it needs."""

    text: str
    work: int


def rolled(body: str, repeats: int = REPEATS) -> Rolled | None:
    """Roll the statements of a function into loops.

    Parameters
    ----------
    body : str
        Declarations and statements as CasADi writes them, without the braces and the return.
    repeats : int
        So many repetitions, at least, make a loop.

    Returns
    -------
    Rolled or None
        None where nothing repeats often enough, or there is a statement of another form.
    """
    program = _read(body) if body.count("\n") > repeats else None
    if program is None:
        return None
    runs = repeated_runs(program.keys, repeats)
    return _Writer(program, runs).text() if runs else None


@dataclass(frozen=True)
class _Program:
    """Statements that compute or write.

    Attributes
    ----------
    keys : ndarray, shape (statements,)
        Equal where statements are, but for which values, elements and constants they are of.
    operands : ndarray, shape (statements, 3)
        Number of the statement whose value it is, of the constant, or of the element, as `forms` says.
    forms : list of tuple
        Of each key: the text around the operands, and their kinds.
    constants : list of str
        Their texts.
    """

    keys: Numbers
    operands: Numbers
    forms: list[_Form]
    constants: list[str]


def _read(body: str) -> _Program | None:
    """Return the statements of a body; None where one is of another form."""
    reader = _Reader()
    try:
        for line in body.splitlines():
            reader.take(line)
    except _AnotherFormError:
        return None
    return reader.program()


class _AnotherFormError(Exception):
    """A statement that is none of those in the head of this file."""


class _Reader:
    """Follows which value, constant or element is in which variable of the text, line by line."""

    def __init__(self) -> None:
        self._texts: dict[tuple[str, ...], int] = {}
        self._constants: dict[str, int] = {}
        self._slots: dict[str, int] = {}
        # What stands behind the equals sign comes again and again.
        self._known: dict[str, tuple[int, tuple[str, ...]]] = {}
        # Of each statement the number of its form, then its operands.
        self._rows: list[int] = []
        self._count = 0

    def take(self, line: str) -> None:
        """Take the next line."""
        name, equals, text = line.partition("=")
        if name not in self._slots or not equals:
            name = self._new(line, name)
            if not name:
                return
        known = self._known.get(text)
        if known is None:
            known = self._known[text] = self._looked_at(text)
        which, names = known
        if not names:
            self._slots[name] = which
            return
        slots = self._slots
        self._rows += (which, *[slots[one] for one in names], 0, 0)[: _OPERANDS + 1]
        slots[name] = self._count * _KINDS + _VALUE
        self._count += 1

    def program(self) -> _Program | None:
        """Return the statements; None if there are none."""
        if not self._count:
            return None
        rows = np.array(self._rows, dtype=np.int64).reshape(self._count, _OPERANDS + 1)
        which, operands = rows[:, 0], rows[:, 1:]
        kinds, keys = operands % _KINDS, which
        for column in kinds.T:
            keys = keys * _KINDS + column
        _, first, keys = np.unique(keys, return_index=True, return_inverse=True)
        texts = list(self._texts)
        forms = []
        for k in first.tolist():
            text = texts[which[k]]
            forms.append((text, tuple(kinds[k, : len(text) - 1].tolist())))
        return _Program(keys, operands // _KINDS, forms, list(self._constants))

    def _new(self, line: str, name: str) -> str:
        """Take a line that gives no value to a variable that is known; return the variable if it is a new one."""
        written = _RESULT.fullmatch(line)
        if written is not None:
            result, place, given = written.groups()
            texts = (f"if (res[{result}]!=0) res[{result}][", "]=", ";")
            slot = self._slots[f"  {given}"]
            form = self._texts.setdefault(texts, len(self._texts))
            self._rows += (form, int(place) * _KINDS + _PLACE, slot, 0)
            self._count += 1
            return ""
        if _DECLARATION.fullmatch(line):
            return ""
        if not _SLOT.fullmatch(name.strip()):
            raise _AnotherFormError
        return name

    def _looked_at(self, text: str) -> tuple[int, tuple[str, ...]]:
        """Return the number of a form and the variables that it reads; an element or a constant if there are none."""
        element = _ELEMENT.fullmatch(text)
        if element is not None and int(element[1]) < _KINDS - _ARGUMENTS:
            return int(element[2]) * _KINDS + _ARGUMENTS + int(element[1]), ()
        if not _EXPRESSION.fullmatch(text):
            raise _AnotherFormError
        parts = _SLOT.split(text[:-1])
        if len(parts) == 1:
            return self._constants.setdefault(parts[0], len(self._constants)) * _KINDS + _CONSTANT, ()
        if len(parts) > 2 * _OPERANDS + 1:
            raise _AnotherFormError
        texts = tuple(parts[::2])
        return self._texts.setdefault(texts, len(self._texts)), tuple(f"  {part}" for part in parts[1::2])


class _Writer:
    """Writes a program with its runs as loops.

    A value that is read in another repetition than its own, or behind its loop, goes through the work array, unless it
    is read in the next repetition alone.
    """

    def __init__(self, program: _Program, runs: list[Run]) -> None:
        self._program, self._runs = program, runs
        count = len(program.keys)
        self._run_of = np.full(count, -1)
        for number, run in enumerate(runs):
            self._run_of[run.start : run.stop] = number
        self._stored = np.full(count, -1)
        self._size = 0
        self._tables: list[str] = []
        self._known_tables: dict[str, str] = {}

    def text(self) -> Rolled:
        """Return the body."""
        self._store()
        lines, place = [], 0
        for run in self._runs:
            lines += [self._line(k) for k in range(place, run.start)]
            lines += self._loop(run)
            place = run.stop
        lines += [self._line(k) for k in range(place, len(self._program.keys))]
        return Rolled("".join(f"  {line}\n" for line in (*self._tables, *lines)), self._size)

    def _store(self) -> None:
        """Give a place in the work array to each value that has to go through it."""
        wanted = set[int]()
        for run in self._runs:
            for numbers in self._values_of(run):
                if _relation(numbers, run) is _Relation.ELSEWHERE:
                    wanted.update(numbers.tolist())
                elif _relation(numbers, run) in (_Relation.BEFORE, _Relation.CARRIED):
                    wanted.update(k for k in numbers[:1].tolist() if self._run_of[k] >= 0)
        outside = np.flatnonzero(self._run_of < 0)
        for k in outside.tolist():
            wanted.update(value for value in self._read(k) if self._run_of[value] >= 0)
        for k in sorted(wanted):
            if self._stored[k] < 0:
                run = self._runs[self._run_of[k]] if self._run_of[k] >= 0 else Run(k, 1, 1)
                places = np.arange(run.start + (k - run.start) % run.length, run.stop, run.length)
                self._stored[places] = self._size + np.arange(run.times)
                self._size += run.times

    def _values_of(self, run: Run) -> Iterator[Numbers]:
        """Yield the operands of a run that are values, those of all repetitions together."""
        for k in range(run.start, run.start + run.length):
            for operand, kind in enumerate(self._program.forms[self._program.keys[k]][1]):
                if kind == _VALUE:
                    yield self._program.operands[k : run.stop : run.length, operand]

    def _read(self, k: int) -> list[int]:
        """Return the values that a statement reads."""
        kinds = self._program.forms[self._program.keys[k]][1]
        return [int(n) for kind, n in zip(kinds, self._program.operands[k], strict=False) if kind == _VALUE]

    def _line(self, k: int) -> str:
        """Return a statement outside loops."""
        texts, kinds = self._program.forms[self._program.keys[k]]
        given = [self._single(kind, int(n)) for kind, n in zip(kinds, self._program.operands[k], strict=False)]
        return self._statement(texts, kinds, given, f"v{k}", self._stored[k], "")

    def _statement(
        self, texts: tuple[str, ...], kinds: tuple[int, ...], given: list[str], name: str, stored: int, step: str
    ) -> str:
        text = "".join(a + b for a, b in zip(texts, [*given, ""], strict=True))
        if kinds[0] == _PLACE:
            return text
        line = f"const casadi_real {name}={text};"
        return line if stored < 0 else f"{line} w[{stored}{step}]={name};"

    def _single(self, kind: int, number: int) -> str:
        """Return an operand that is the same whatever repetition is on."""
        if kind == _VALUE:
            return f"v{number}" if self._run_of[number] < 0 else f"w[{self._stored[number]}]"
        if kind == _CONSTANT:
            return f"({self._program.constants[number]})"
        return str(number) if kind == _PLACE else _element(kind, str(number))

    def _loop(self, run: Run) -> list[str]:
        program, lines = self._program, []
        carried: dict[tuple[int, int], str] = {}
        for place in range(run.length):
            k = run.start + place
            texts, kinds = program.forms[program.keys[k]]
            given = []
            for operand, kind in enumerate(kinds):
                numbers = program.operands[k : run.stop : run.length, operand]
                given.append(self._varying(kind, numbers, run, carried))
            step = "+i" if self._stored[k] >= 0 else ""
            lines.append("  " + self._statement(texts, kinds, given, f"x{place}", self._stored[k], step))
        before = [f"casadi_real {name}={self._single(_VALUE, first)};" for (_, first), name in carried.items()]
        after = [f"  {name}=x{place};" for (place, _), name in carried.items() if place != _NEVER]
        head = f"for (casadi_int i=0; i<{run.times}; ++i) {{"
        return ["{", *before, head, *lines, *after, "}", "}"]

    def _varying(self, kind: int, numbers: Numbers, run: Run, carried: dict[tuple[int, int], str]) -> str:
        """Return an operand of a statement in a loop."""
        if kind == _VALUE:
            relation = _relation(numbers, run)
            if relation is _Relation.SAME:
                return f"x{numbers[0] - run.start}"
            if relation is _Relation.CARRIED:
                key = (int(numbers[1]) - run.start, int(numbers[0]))
                return carried.setdefault(key, f"y{len(carried)}")
            if relation is _Relation.ELSEWHERE:
                return f"w[{self._index(self._stored[numbers])}]"
            if self._run_of[numbers[0]] >= 0:
                return carried.setdefault((_NEVER, int(numbers[0])), f"y{len(carried)}")
        if (numbers == numbers[0]).all():
            return self._single(kind, int(numbers[0]))
        if kind == _CONSTANT:
            return self._table("casadi_real", [self._program.constants[n] for n in numbers.tolist()])
        index = self._index(numbers)
        return index if kind == _PLACE else _element(kind, index)

    def _index(self, numbers: Numbers) -> str:
        """Return an index that takes these values one after the other."""
        steps = np.diff(numbers)
        if (steps == steps[0]).all():
            return f"{numbers[0]}" + (f"{steps[0]:+d}*i" if steps[0] else "")
        return self._table("unsigned", [f"{n}u" for n in numbers.tolist()])

    def _table(self, kind: str, entries: list[str]) -> str:
        text = ",".join(entries)
        if text not in self._known_tables:
            self._known_tables[text] = f"t{len(self._tables)}"
            self._tables.append(f"static const {kind} {self._known_tables[text]}[]={{{text}}};")
        return f"{self._known_tables[text]}[i]"


def _element(kind: int, index: str) -> str:
    argument = kind - _ARGUMENTS
    return f"(arg[{argument}]? arg[{argument}][{index}] : 0)"


class _Relation(enum.Enum):
    """Where the values of an operand in a loop come from."""

    BEFORE = enum.auto()
    SAME = enum.auto()
    CARRIED = enum.auto()
    ELSEWHERE = enum.auto()


def _relation(numbers: Numbers, run: Run) -> _Relation:
    """Return where the values come from, one for each repetition."""
    first, starts = int(numbers[0]), run.start + run.length * np.arange(run.times)
    if first < run.start and (numbers == first).all():
        return _Relation.BEFORE
    if (numbers - starts == first - run.start).all() and first >= run.start:
        return _Relation.SAME
    place = int(numbers[1]) - run.start
    if first < run.start and 0 <= place < run.length and (numbers[1:] - starts[:-1] == place).all():
        return _Relation.CARRIED
    return _Relation.ELSEWHERE
