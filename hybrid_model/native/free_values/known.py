"""What never changes while a process runs: code of the framework, of numpy and of the pure part of Python's library.

Whatever is not known here is looked at as a user's own; what then cannot be looked at cannot be told.
"""

from __future__ import annotations

import dis
import functools
import inspect
import operator
import sys
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.class_body import UNBOUND
from hybrid_model.declare.composition import Composition
from hybrid_model.declare.dwell import MinimumDwell
from hybrid_model.declare.hybrid_automaton import HybridAutomaton
from hybrid_model.declare.modes import ModalAutomaton
from hybrid_model.declare.state_space import ContinuousStateSpace, DiscreteStateSpace, LinearAutomaton
from hybrid_model.declare.wrapper import Wrapper

_FRAMEWORK = (
    Automaton,
    HybridAutomaton,
    ModalAutomaton,
    LinearAutomaton,
    ContinuousStateSpace,
    DiscreteStateSpace,
    Composition,
    Wrapper,
    MinimumDwell,
)
"""Classes whose code reads attributes of automata."""
_FOR_COPIES = "made_from"
"""Attribute that holds matrices for copies to be made from; no map reads it."""
_AUTHORS = ("consensus", "models")
"""Rooms of ours that write automata as users do."""
_OF_MAPS = ("hybrid_model.declare", "hybrid_model.errors")
_READS_VALUES = ("hybrid_model.declare.layout", "hybrid_model.declare.vector_form")
_PURE = frozenset(
    {"__future__", "_abc", "_bisect", "_collections", "_collections_abc", "_functools", "_heapq", "_operator"}
    | {"_struct", "_warnings", "abc", "bisect", "builtins", "cmath", "collections", "collections.abc", "contextlib"}
    | {"copy", "dataclasses", "enum", "fractions", "functools", "heapq", "itertools", "keyword", "math", "numbers"}
    | {"operator", "re", "reprlib", "statistics", "string", "struct", "textwrap", "types", "typing", "warnings"}
    | {"typing_extensions"}
)
"""Modules of Python's library whose functions give the same for the same."""
_ARRAYS = ("numpy", "scipy")
OUTSIDE = frozenset(("random", "load", "loadtxt", "genfromtxt", "fromfile", "memmap", "io", "datasets"))
"""What of numpy and scipy looks at random numbers or files."""
_READS_ATTRIBUTES = ("copy", "dataclasses")
UNTOLD_BUILTINS = frozenset(
    ("globals", "locals", "eval", "exec", "compile", "open", "input", "id", "__import__", "breakpoint")
)
"""Builtins through which code reads what it does not name."""
_TAKING_NAMES = (getattr, hasattr, vars, dir, setattr, delattr, operator.attrgetter, operator.methodcaller)
"""What takes the name of an attribute, which may be computed."""
_NEUTRAL_BASES = frozenset(("object", "ABC", "Generic", "Protocol"))
"""Bases whose code reads no attribute that a subclass has of its own."""


def is_known_module(name: object) -> bool:
    """Whether a module's functions and constants never change, and its functions look at nothing but arguments."""
    if not isinstance(name, str):
        return False
    root, _, rest = name.partition(".")
    first = rest.partition(".")[0]
    if root in _ARRAYS:
        return first not in OUTSIDE
    if root == "hybrid_model":
        return first not in _AUTHORS
    return name in _PURE


def is_known(value: Any) -> bool:
    """Whether a class, or anything else that has the name of its module, is what a known module holds by its name."""
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if not (is_known_module(module) and isinstance(name, str)) or getattr(value, "__name__", None) in OUTSIDE:
        return False
    found: Any = sys.modules.get(str(module))
    for part in name.split("."):
        found = getattr(found, part, None)
    return found is value


def is_of_known_module(function: FunctionType) -> bool:
    """Whether a function was written in a known module; what it holds in its closure may still be a user's."""
    name = function.__globals__.get("__name__")
    module = sys.modules.get(name) if isinstance(name, str) else None
    return is_known_module(name) and module is not None and vars(module) is function.__globals__


def needs_no_look(value: object) -> bool:
    """Whether what a known module has by a name is its own, and not what somebody else has put there."""
    if isinstance(value, FunctionType):
        return is_of_known_module(value) and not value.__closure__
    return is_known_ufunc(value) if isinstance(value, np.ufunc) else is_known(value)


def is_known_ufunc(ufunc: np.ufunc) -> bool:
    """Whether an element-wise function is one of numpy or scipy; one of `np.frompyfunc` holds another function."""
    return any(getattr(module, ufunc.__name__, None) is ufunc for module in (np, sys.modules.get("scipy.special")))


def is_of_library(module: str) -> bool:
    """Whether a module is one of Python, numpy or scipy, which nobody but they themselves can look into."""
    root = module.partition(".")[0]
    return root in sys.stdlib_module_names or root in _ARRAYS


def is_of_arrays(module: str) -> bool:
    """Whether a module is part of numpy or scipy."""
    return module.partition(".")[0] in _ARRAYS


def reads_start_values(value: object) -> bool:
    """Whether a module of ours, a function or a class of it looks at the start values of automata."""
    module = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
    if not isinstance(module, str) or module.partition(".")[0] != "hybrid_model":
        return False
    return module in _READS_VALUES or (is_known_module(module) and not module.startswith(_OF_MAPS))


def takes_apart(value: object) -> bool:
    """Whether a function of Python's library, or a module of such, may read any attribute of what it is given."""
    if isinstance(value, ModuleType):
        return value.__name__ in _READS_ATTRIBUTES
    if any(value is one for one in _TAKING_NAMES):
        return True
    is_function = isinstance(value, FunctionType) and "<locals>" not in value.__qualname__
    return is_function and getattr(value, "__module__", None) in _READS_ATTRIBUTES


def has_reading_base(cls: type) -> bool:
    """Whether code that is not looked at may read any attribute of a class and of its instances."""
    return any(
        is_known(base) and base.__name__ not in _NEUTRAL_BASES and base not in _FRAMEWORK for base in cls.__mro__
    )


@functools.cache
def framework_words() -> frozenset[str]:
    """Names of the attributes that the framework's own code reads from automata and their classes."""
    found = set(UNBOUND)
    for cls in _FRAMEWORK:
        found.update(vars(cls), inspect.get_annotations(cls))
        for function in map(inspect.unwrap, filter(inspect.isfunction, vars(cls).values())):
            found.update(item.argval for item in dis.get_instructions(function) if item.opname == "STORE_ATTR")
    return frozenset(word for word in found - {_FOR_COPIES} if not word.startswith(("__", "_abc")))
