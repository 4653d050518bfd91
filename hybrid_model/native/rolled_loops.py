"""Straight-line C of a traced map, rolled into loops where it says the same again and again.

The hub of a star has the same few statements for each of its neighbours. Compilers take more than proportionally long
for thousands of such lines. Statements that are equal but for the places of what they read and write, and for
constants, become one loop over tables; their order stays, so that values are the same to the last bit.

The text is CasADi's: each statement computes an element of an argument, a constant, or an expression of values that
are there, or writes an element of a result.
"""

from __future__ import annotations

import enum
import functools
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
_STATEMENT = re.compile(
    r"  (?:(?P<slot>a\d+)=(?:arg\[(?P<argument>\d+)\]\? arg\[\d+\]\[(?P<element>\d+)\] : 0|"
    r"(?P<expression>[^;\[]*));|if \(res\[(?P<result>\d+)\]!=0\) res\[\d+\]\[(?P<place>\d+)\]=(?P<given>a\d+);)\n"
)
_DECLARATION = re.compile(r"  casadi_real a\d+(?:, a\d+)*;\n")
_SLOT = re.compile(r"\b(a\d+)\b")
_VALUE, _CONSTANT, _PLACE = -1, -2, -3
"""Kinds of operands; from 0 on, elements of that argument."""
_Form: TypeAlias = tuple[tuple[str, ...], tuple[int, ...]]
_OPERANDS = 3
"""Of a statement, at most."""
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
    begin = 0
    while declared := _DECLARATION.match(body, begin):
        begin = declared.end()
    forms: dict[_Form, int] = {}
    constants: dict[str, int] = {}
    slots: dict[str, tuple[int, int]] = {}
    keys: list[int] = []
    operands: list[tuple[int, ...]] = []
    for found in _STATEMENT.finditer(body, begin):
        if found.start() != begin:
            return None
        begin = found.end()
        slot, argument, element, expression, result, place, given = found.groups()
        if argument is not None:
            slots[slot] = (int(argument), int(element))
            continue
        if result is not None:
            texts: tuple[str, ...] = (f"if (res[{result}]!=0) res[{result}][", "]=", ";")
            read = [(_PLACE, int(place)), slots[given]]
        else:
            texts, names = _around_slots(expression)
            if not names:
                slots[slot] = (_CONSTANT, constants.setdefault(expression, len(constants)))
                continue
            read = [slots[name] for name in names]
            slots[slot] = (_VALUE, len(keys))
        kinds, numbers = zip(*read, strict=True)
        keys.append(forms.setdefault((texts, kinds), len(forms)))
        operands.append((*numbers, 0, 0)[:_OPERANDS])
    if begin != len(body) or not keys or max(len(kinds) for _, kinds in forms) > _OPERANDS:
        return None
    return _Program(np.array(keys), np.array(operands), list(forms), list(constants))


@functools.lru_cache(maxsize=10_000)
def _around_slots(expression: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what stands around the names of values in an expression, and these names."""
    parts = _SLOT.split(expression)
    return tuple(parts[::2]), tuple(parts[1::2])


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
        return str(number) if kind == _PLACE else f"(arg[{kind}]? arg[{kind}][{number}] : 0)"

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
        return index if kind == _PLACE else f"(arg[{kind}]? arg[{kind}][{index}] : 0)"

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
