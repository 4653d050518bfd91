"""What each kind of value holds: variables and values of ours, functions and containers of Python, arrays of numpy."""

from __future__ import annotations

import collections
import enum
import functools
import types
from collections.abc import Callable
from dataclasses import fields
from operator import attrgetter
from typing import Any

import numpy as np

from hybrid_model.declare.variables import Variable
from hybrid_model.native.free_values import known
from hybrid_model.native.free_values.classes import describe_class, describe_instance, made_in_python
from hybrid_model.native.free_values.code_names import code_names
from hybrid_model.native.free_values.containers import CONTAINERS, content, items_of
from hybrid_model.native.free_values.reading import Reading, UntoldError

_FIELD_OF_TUPLE = type(vars(collections.namedtuple("_Pair", "first second"))["first"])
_declared = attrgetter(
    *(field.name for field in fields(Variable) if field.name not in ("start", "unit", "description"))
)
"""What of a variable a trace may depend on; its start value is data."""


def describe(reading: Reading, value: Any) -> None:
    """Describe what an object holds.

    Raises
    ------
    UntoldError
        If its state cannot be compared.
    """
    # `type` and not `isinstance`: that asks the object, which may be anything.
    number, kind = reading.number(value), type(value)
    special = _KINDS.get(kind)
    if special is not None:
        special(reading, number, value)
    elif kind in CONTAINERS:
        reading.record(number, kind.__name__, *items_of(reading, CONTAINERS[kind], value))
    elif issubclass(kind, type):
        describe_class(reading, number, value)
    elif issubclass(kind, np.ufunc):
        _ufunc(reading, number, value)
    elif issubclass(kind, np.generic):
        _number(reading, number, value)
    elif issubclass(kind, np.dtype):
        reading.record(number, "dtype", str(value.descr))
    elif not made_in_python(kind) and callable(value) and known.is_known(value):
        reading.known_code(value)
        reading.record(number, "known", value.__module__, value.__qualname__)
    elif issubclass(kind, enum.Enum) and known.is_known(kind):
        reading.record(number, "member", kind.__qualname__, value.name)
    else:
        describe_instance(reading, number, value)


def _variable(reading: Reading, number: int, value: Variable) -> None:
    reading.record(number, "variable", value.start.shape, *map(reading.token, _declared(value)))


def _array(reading: Reading, number: int, value: np.ndarray[Any, Any]) -> None:
    reading.record(number, *content(reading, value))


def _number(reading: Reading, number: int, value: np.generic) -> None:
    if isinstance(value, np.void | np.object_):
        raise UntoldError(f"a map reads {value!r}")
    reading.record(number, "number", value.dtype.str, value.tobytes())


def _ufunc(reading: Reading, number: int, value: np.ufunc) -> None:
    if not known.is_known_ufunc(value):
        raise UntoldError(f"a map calls {value.__name__}, made by np.frompyfunc")
    reading.record(number, "ufunc", value.__name__)


def _dictionary(reading: Reading, number: int, value: dict[object, object]) -> None:
    reading.watch.dictionary(value)
    reading.record(number, "dict", *reading.tokens(value), *reading.tokens(value.values()))


def _view(reading: Reading, number: int, value: types.MappingProxyType[Any, Any]) -> None:
    reading.record(number, "view", *items_of(reading, lambda view: (*view, *view.values()), value))


def _namespace(reading: Reading, number: int, value: types.SimpleNamespace) -> None:
    reading.watch.instance(value)
    reading.record(number, "namespace")
    reading.attributes(number, vars(value))


def _slice(reading: Reading, number: int, value: slice) -> None:
    reading.record(number, "slice", *reading.tokens((value.start, value.stop, value.step)))


def _partial(reading: Reading, number: int, value: functools.partial[Any]) -> None:
    reading.watch.instance(value)
    parts = items_of(reading, lambda partial: (partial.func, partial.args, partial.keywords), value)
    reading.record(number, "partial", *parts, reading.token(tuple(vars(value).items())))


def _method(reading: Reading, number: int, value: types.MethodType) -> None:
    reading.record(number, "method", reading.token(value.__self__), reading.token(value.__func__))


def _wrapped(reading: Reading, number: int, value: staticmethod[Any, Any] | classmethod[Any, Any, Any]) -> None:
    reading.record(number, type(value).__name__, reading.token(value.__func__))


def _property(reading: Reading, number: int, value: property) -> None:
    reading.record(number, "property", *reading.tokens((value.fget, value.fset, value.fdel)))


def _cached_property(reading: Reading, number: int, value: functools.cached_property[Any]) -> None:
    reading.watch.instance(value)
    reading.record(number, "cached property", reading.token(value.func), value.attrname)


def _of_c(reading: Reading, number: int, value: types.BuiltinFunctionType) -> None:
    owner = value.__self__
    module = owner.__name__ if isinstance(owner, types.ModuleType) else value.__module__
    if owner is not None and not isinstance(owner, types.ModuleType):
        reading.record(number, "method of", reading.token(owner), value.__name__)
    elif known.is_known_module(module) and value.__name__ not in known.UNTOLD_BUILTINS:
        reading.known_code(value)
        reading.record(number, "builtin", module, value.__qualname__)
    else:
        raise UntoldError(f"a map calls {module}.{value.__name__}")


def _descriptor(reading: Reading, number: int, value: types.MethodDescriptorType) -> None:
    reading.record(number, "descriptor", value.__name__, reading.reference(value.__objclass__))


def _field_of_tuple(reading: Reading, number: int, value: Any) -> None:
    reading.record(number, "field", value.__reduce__()[1][0])


def _cell(reading: Reading, number: int, value: types.CellType) -> None:
    reading.watch.cell(value)
    try:
        reading.record(number, "cell", reading.token(value.cell_contents))
    except ValueError:
        reading.record(number, "empty cell")


def _function(reading: Reading, number: int, value: types.FunctionType) -> None:
    is_known = known.is_of_known_module(value)
    token = code_names(value.__code__).token
    if is_known:
        if value.__name__ in known.OUTSIDE:
            raise UntoldError(f"a map calls {value.__module__}.{value.__name__}")
        reading.known_code(value)
        if not (value.__closure__ or value.__defaults__ or value.__kwdefaults__):
            reading.record(number, "known function", token)
            return
    reading.watch.function(value)
    keywords = tuple((value.__kwdefaults__ or {}).items())
    parts = reading.tokens((value.__defaults__, keywords, value.__closure__))
    reading.record(number, "function", token, value.__name__, *parts)
    reading.attributes(number, vars(value))
    if not is_known:
        reading.code(number, value.__code__, value.__globals__)


_KINDS: dict[type, Callable[[Reading, int, Any], None]] = {
    Variable: _variable,
    dict: _dictionary,
    np.ndarray: _array,
    slice: _slice,
    functools.partial: _partial,
    functools.cached_property: _cached_property,
    staticmethod: _wrapped,
    classmethod: _wrapped,
    property: _property,
    types.FunctionType: _function,
    types.MethodType: _method,
    types.CellType: _cell,
    types.ModuleType: Reading.module,
    types.MappingProxyType: _view,
    types.SimpleNamespace: _namespace,
    types.BuiltinFunctionType: _of_c,
    types.MethodWrapperType: _of_c,
    types.WrapperDescriptorType: _descriptor,
    types.MethodDescriptorType: _descriptor,
    types.ClassMethodDescriptorType: _descriptor,
    types.GetSetDescriptorType: _descriptor,
    types.MemberDescriptorType: _descriptor,
    _FIELD_OF_TUPLE: _field_of_tuple,
}
