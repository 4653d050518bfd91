"""What has been read so far: numbers for objects, records of what they hold, and the words that code names.

The description of an automaton is a list of records in an order that follows from what is met alone. So two automata
have equal descriptions only if what their maps can read is equal and hangs together in the same way. An attribute of an
object, a class or a module counts as read if its name stands anywhere in the code that can run; until some code names
it, it waits.
"""

from __future__ import annotations

import importlib.util
import sys
from abc import ABCMeta, get_cache_token
from collections import deque
from collections.abc import Iterable, Mapping
from types import CodeType, ModuleType
from typing import Any, cast

from hybrid_model.native.free_values import known
from hybrid_model.native.free_values.code_names import code_names
from hybrid_model.native.free_values.watch import MISSING, Watch

MOST = 5_000
"""Functions that are followed; maps that can reach more use a library that is not known here."""
_LEAVES = frozenset((type(None), bool, int, float, complex, str, bytes, type(Ellipsis), type(NotImplemented), range))
"""Types whose values say all about themselves."""
_VALUES_READ = ("variables", "of_kind", "__dict__")
"""Words by which a map gets at start values, which are data otherwise."""
_TAKING_NAMES = ("__dict__", "__getattribute__", "attrgetter", "methodcaller")
"""Words by which code gets at attributes that it does not name."""
_UNTOLD = ("__globals__", "__builtins__", "__subclasses__", "__annotations__", "__doc__", "get_type_hints")
"""Words by which code gets at what is not looked at."""
_ASKING = ("isinstance", "issubclass")
_ITS_CLASS = "__class__"
_HIDDEN = frozenset(
    {"__module__", "__doc__", "__dict__", "__weakref__", "__slots__", "__annotations__", "__qualname__", "_abc_impl"}
    | {"__orig_bases__", "__parameters__", "__abstractmethods__", "__dataclass_fields__", "__dataclass_params__"}
    | {"__firstlineno__", "__static_attributes__", "__annotate__", "__annotate_func__", "__annotations_cache__"}
    | {"__classdictcell__", "__replace__"}
)
"""What Python keeps in a class for itself: read only where code names it."""
_LARGE = 1 << 63


class UntoldError(Exception):
    """A map reads something whose state cannot be compared; the message is the end of a sentence."""


class Reading:
    """What the maps of an automaton have been found to read.

    Attributes
    ----------
    records : list
        The description so far: numbers, texts and tuples of them.
    watch : Watch
        What it was made of.
    open : deque
        Objects that have a number and are still to be described.
    start_values : bool
        Whether maps get at start values by the declarations.
    """

    def __init__(self) -> None:
        self.records: list[object] = []
        self.watch = Watch()
        self.open: deque[object] = deque()
        self.start_values = False
        self._followed = 0
        self._numbers: dict[int, int] = {}
        self._held: list[object] = []
        self._words: set[str] = set(known.framework_words())
        self._own_words: set[str] = set()
        self._every_word = self._bare_arrays = self._abstract = False
        self._waiting: dict[str, list[tuple[int, object]]] = {}
        self._modules: list[ModuleType] = []
        self._resolved: set[tuple[int, str]] = set()
        self._orders: list[tuple[int, list[str]]] = []
        self._making: dict[int, list[tuple[int, str, object]]] = {}
        self._made: set[int] = set()

    # Values in records.

    def record(self, number: int, *tokens: object) -> None:
        """Add to the description of the object with a number."""
        self.records.append((number, *tokens))

    def token(self, value: object) -> object:
        """Return what stands for a value in a record."""
        kind = type(value)
        if kind in _LEAVES:
            # The digits of a number are limited.
            return hex(value).encode() if isinstance(value, int) and abs(value) > _LARGE else value
        if kind is tuple and isinstance(value, tuple):
            return ("tuple", *map(self.token, value))
        if issubclass(kind, type):
            self._make(cast(type, value))
        return self.reference(value)

    def tokens(self, values: Iterable[object]) -> list[object]:
        """Return what stands for several values."""
        return list(map(self.token, values))

    def reference(self, value: object) -> tuple[int]:
        """Return the number of an object, in a tuple, and remember to describe it."""
        number = self._numbers.get(id(value))
        if number is None:
            number = self._numbers[id(value)] = len(self._numbers)
            self._held.append(value)
            self.open.append(value)
        return (number,)

    def number(self, value: object) -> int:
        """Return the number of an object that has one."""
        return self._numbers[id(value)]

    # Attributes and words.

    def attribute(self, owner: int, name: str, value: object, *, read: bool = False) -> None:
        """Note an attribute; it is described when it is read, or as soon as some code names it."""
        if name in self._words or ((read or self._every_word) and name not in _HIDDEN):
            self.records.append((owner, name, self.token(value)))
        else:
            self._waiting.setdefault(name, []).append((owner, value))

    def attributes(self, owner: int, values: Mapping[str, object], *, read: bool = False) -> None:
        """Note the attributes of an object, whose order only code that lists them sees."""
        names = list(values)
        self._orders.append((owner, names))
        for name in sorted(names):
            self.attribute(owner, name, values[name], read=read)

    def making(self, owner: int, cls: type, items: list[tuple[str, object]]) -> None:
        """Note attributes of a class that are read only where code has the class itself, as when it makes instances."""
        waiting = [(owner, name, value) for name, value in items]
        self._making[id(cls)] = waiting
        if id(cls) in self._made or _ITS_CLASS in self._own_words:
            self._read_making(id(cls))

    def word(self, word: str) -> None:
        """Some code names a word."""
        if word in self._own_words:
            return
        self._own_words.add(word)
        if word in _UNTOLD:
            raise UntoldError(f"a map reads {word}")
        if word in _VALUES_READ:
            self.start_values = True
        if word in _TAKING_NAMES:
            self.every_word()
        if word == _ITS_CLASS:
            for cls in list(self._making):
                self._read_making(cls)
        if word not in self._words:
            self._words.add(word)
            for owner, value in self._waiting.pop(word, ()):
                self.records.append((owner, word, self.token(value)))
            for module in self._modules:
                self._attribute_of_module(module, word)

    def every_word(self) -> None:
        """Some code computes names: every attribute may be meant."""
        if self._every_word:
            return
        self._every_word = self.start_values = True
        self.word(_ITS_CLASS)
        self._refuse_modules()
        waiting, self._waiting = self._waiting, {}
        for name, items in waiting.items():
            if name in _HIDDEN:
                self._waiting[name] = items
                continue
            for owner, value in items:
                self.records.append((owner, name, self.token(value)))

    def known_code(self, value: object) -> None:
        """Note what a function or class that is not looked at may read."""
        if known.reads_start_values(value):
            self.start_values = True
        if known.takes_apart(value):
            self.every_word()
            self.word("__dataclass_fields__")

    def _make(self, cls: type) -> None:
        self._abstract = self._abstract or isinstance(cls, ABCMeta)
        for base in cls.__mro__:
            if id(base) not in self._made:
                self._made.add(id(base))
                self._read_making(id(base))

    def _read_making(self, cls: int) -> None:
        for owner, name, value in self._making.pop(cls, ()):
            self.records.append((owner, name, self.token(value)))

    # Code and modules.

    def code(self, number: int, code: CodeType, where: dict[str, Any]) -> None:
        """Follow what the code of function `number` names, with the globals that it was made with."""
        self._followed += 1
        if self._followed > MOST:
            raise UntoldError(f"a map can reach more than {MOST} functions")
        self.record(number, "globals", self._number_of(where))
        names = code_names(code)
        for word in names.words:
            self.word(word)
        for name, taken in names.lookups.items():
            self._look_up(where, name, taken)
        for name in names.imports:
            self._import(name, where)

    def module(self, number: int, module: ModuleType) -> None:
        """Describe a module that code uses otherwise than by naming one of its attributes."""
        name = module.__name__
        self.record(number, "module", name)
        if known.is_known_module(name):
            self.known_code(module)
            self._bare_arrays = self._bare_arrays or known.is_of_arrays(name)
            return
        if known.is_of_library(name):
            raise UntoldError(f"a map reads the module {name}")
        self._modules.append(module)
        self._refuse_modules()
        for word in [word for word in vars(module) if word in self._words]:
            self._attribute_of_module(module, word)

    def close(self) -> None:
        """Watch names of modules that do not exist yet; refuse what is known at the end only."""
        if self._bare_arrays and not self._own_words.isdisjoint(known.OUTSIDE):
            raise UntoldError("a map may read random numbers or a file by numpy")
        if self._abstract and not self._own_words.isdisjoint(_ASKING):
            self.watch.kinship()
            self.records.append(("kinship", str(get_cache_token())))
        if self._every_word:
            self.records += [("order", owner, *names) for owner, names in self._orders]
        for module in self._modules:
            self.watch.names(vars(module), sorted(self._words))
        self.watch.close()

    def _look_up(self, where: dict[str, Any], name: str, taken: frozenset[str] | None) -> None:
        value = where.get(name, MISSING)
        found = where
        if value is MISSING:
            found = _builtins(where)
            value = found.get(name, MISSING)
            self._refuse_builtin(name)
        attributes = sorted(taken) if taken is not None and type(value) is ModuleType else None
        if (id(where), name) not in self._resolved:
            self._resolved.add((id(where), name))
            self.watch.names(where, (name,))
            if found is not where:
                self.watch.names(found, (name,))
            shown = ("missing",) if value is MISSING else _shown(value, attributes) or self.token(value)
            self.records.append(("global", self._number_of(where), name, shown))
        elif value is not MISSING and attributes is None:
            self.token(value)
        if attributes is not None and isinstance(value, ModuleType):
            for attribute in attributes:
                self._attribute_of_module(value, attribute)

    def _refuse_builtin(self, name: str) -> None:
        if name in known.UNTOLD_BUILTINS:
            raise UntoldError(f"a map calls {name}()")
        if name == "type":
            self.word(_ITS_CLASS)

    def _refuse_modules(self) -> None:
        if self._every_word and self._modules:
            raise UntoldError(f"a map computes names, and reads the module {self._modules[0].__name__}")

    def _attribute_of_module(self, module: ModuleType, name: str) -> None:
        here = vars(module)
        if known.is_known_module(module.__name__):
            if known.is_of_arrays(module.__name__) and name in known.OUTSIDE:
                raise UntoldError(f"a map reads {module.__name__}.{name}")
            self.known_code(here.get(name))
        if (id(here), name) in self._resolved:
            return
        self._resolved.add((id(here), name))
        # A module may make what is asked for.
        found = name if name in here else "__getattr__"
        self.watch.names(here, (name, found))
        if found in here and not (known.is_known_module(module.__name__) and known.needs_no_look(here[found])):
            self.records.append(("of module", self._number_of(here), name, found, self.token(here[found])))

    def _import(self, name: str, where: dict[str, Any]) -> None:
        try:
            name = importlib.util.resolve_name(name, where.get("__package__")) if name.startswith(".") else name
        except ImportError as error:
            raise UntoldError(f"a map imports {name}") from error
        path = name.split(".")
        for end in range(1, len(path) + 1):
            module = sys.modules.get(".".join(path[:end]))
            if module is None:
                raise UntoldError(f"a map imports {name}")
            self.watch.names(sys.modules, (".".join(path[:end]),))
            self.records.append(("import", self.token(module)))

    def _number_of(self, names: dict[str, Any]) -> int:
        self._held.append(names)
        return self._numbers.setdefault(id(names), len(self._numbers))


def _shown(value: object, attributes: list[str] | None) -> object:
    """What stands for a module of which code takes some attributes only."""
    return ("module", value.__name__) if attributes is not None and isinstance(value, ModuleType) else None


def _builtins(where: dict[str, Any]) -> dict[str, Any]:
    found = where.get("__builtins__", {})
    return vars(found) if isinstance(found, ModuleType) else found
