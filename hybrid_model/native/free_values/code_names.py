"""What compiled code names: the globals that it looks up, and every word that could be the name of an attribute.

What code can reach from outside its arguments it must name somewhere, unless it computes names. Constant texts that are
names count too: ``getattr(self, "gain")`` and ``"{0.gain}".format(self)`` read attributes without an instruction of
their own.
"""

from __future__ import annotations

import dis
import re
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import blake2b
from types import CodeType
from weakref import WeakKeyDictionary

_NAMES = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*")
_FIELD = re.compile(r"\{([^{}]*)\}")
_WORD = re.compile(r"[^\W\d]\w*")
_FIELDS = (
    "co_name",
    "co_argcount",
    "co_posonlyargcount",
    "co_kwonlyargcount",
    "co_flags",
    "co_code",
    "co_names",
    "co_varnames",
    "co_cellvars",
    "co_freevars",
    "co_exceptiontable",
)
"""All that decides what compiled code does, besides its constants."""
_FOLLOWED = ("LOAD_ATTR", "LOAD_METHOD")
_LOOKUPS = ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS")
_SILENT = ("PUSH_NULL", "CACHE", "EXTENDED_ARG")


@dataclass(frozen=True, eq=False)
class CodeNames:
    """What a code object names, code of nested functions included.

    Attributes
    ----------
    token : bytes
        A digest of what the code does: equal for code that is compiled again from equal lines, wherever they stand.
    lookups : mapping
        Name of a global -> names of the attributes that are taken from it at once; None if it is also used otherwise.
    words : tuple of str
        All that could be the name of an attribute, each once.
    imports : tuple of str
        Modules that the code itself imports; with leading dots where the import is relative.
    """

    token: bytes
    lookups: dict[str, frozenset[str] | None]
    words: tuple[str, ...]
    imports: tuple[str, ...]


_known: WeakKeyDictionary[CodeType, CodeNames] = WeakKeyDictionary()


def code_names(code: CodeType) -> CodeNames:
    """Return what a code object names; it is looked at once."""
    found = _known.get(code)
    if found is None:
        found = _known[code] = _looked_at(code)
    return found


def _looked_at(code: CodeType) -> CodeNames:
    lookups: dict[str, frozenset[str] | None] = {}
    words: dict[str, None] = {}
    imports: dict[str, None] = {}
    for one in _with_nested(code):
        words |= dict.fromkeys(one.co_names)
        instructions = [item for item in dis.get_instructions(one) if item.opname not in _SILENT]
        for before, item, after in zip([None, *instructions], instructions, [*instructions[1:], None], strict=False):
            if item.opname in _LOOKUPS:
                taken = after.argval if after is not None and after.opname in _FOLLOWED else None
                known = lookups.get(item.argval, frozenset())
                lookups[item.argval] = None if known is None or taken is None else known | {taken}
            elif item.opname == "IMPORT_NAME":
                # The level of the import lies below the list of names on the stack.
                index = instructions.index(item)
                level = instructions[index - 2].argval if before is not None and index > 1 else 0
                imports["." * (level if isinstance(level, int) else 1) + item.argval] = None
            elif item.opname == "MATCH_CLASS":
                words["isinstance"] = None
            elif item.opcode in dis.hasconst:
                words |= dict.fromkeys(_words(item.argval))
    token = blake2b(repr(_meaning(code)).encode("utf-8", "surrogatepass"), digest_size=20).digest()
    return CodeNames(token, lookups, tuple(words), tuple(imports))


def _with_nested(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _with_nested(constant)


def _meaning(constant: object) -> object:
    """Return texts and numbers that say what a constant of compiled code is."""
    if isinstance(constant, CodeType):
        fields = (getattr(constant, name) for name in _FIELDS)
        return ("code", *fields, *map(_meaning, constant.co_consts))
    if isinstance(constant, tuple):
        return ("tuple", *map(_meaning, constant))
    if isinstance(constant, frozenset):
        return ("frozenset", *sorted(repr(_meaning(item)) for item in constant))
    # The digits of a number are limited.
    return ("number", hex(constant)) if type(constant) is int else (type(constant).__name__, constant)


def _words(constant: object) -> Iterator[str]:
    if isinstance(constant, str):
        for text in [constant] if _NAMES.fullmatch(constant) else _FIELD.findall(constant):
            yield from _WORD.findall(text)
    elif isinstance(constant, tuple | frozenset):
        for item in constant:
            yield from _words(item)
