"""Every public name says what it takes and gives: parameters with types, shapes, units, errors raised, sources.

Public names are those in the ``__all__`` of `PACKAGES`, and the public methods that their classes define.
"""

import ast
import dataclasses
import importlib
import inspect
import re
import sys
import textwrap

import pytest
from numpydoc.docscrape import NumpyDocString

PACKAGES = (
    "hybrid_model",
    "hybrid_model.consensus",
    "hybrid_model.models",
    "hybrid_model.plots",
    "hybrid_model.linear",
    "cosim.masters",
)
OWN = ("hybrid_model", "cosim", "fmu")
# What authors of automata write and executions call: the class of automata says what `s` is.
MAPS = {"s", "jump", "self", "cls"}
ARRAY = re.compile(r"ndarray|array_like")
SHAPED = re.compile(r"shape", re.IGNORECASE)
TIME = re.compile(r"^(t|t0|t1|t_\w+|times?|period|dwells?|window|delay|step|\w+_time|duration|shortest|longest)$")
SECONDS = re.compile(r"\bs\b|seconds|unit", re.IGNORECASE)
SOURCE = re.compile(r"paper|audit|\b(19|20)\d\d\b|section|theorem|rule \d", re.IGNORECASE)
# Formulas live here; each name in them says where its own comes from, or its module does.
WITH_FORMULAS = tuple(f"hybrid_model.consensus.{room}" for room in ("certificates", "exact", "excitation", "laws"))


def public():
    """Qualified name -> object: public classes, functions, and the methods and properties that classes define."""
    found = {}
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in module.__all__:
            thing = getattr(module, name)
            if not getattr(thing, "__module__", "").startswith(OWN) or not callable(thing):
                continue
            found[f"{package}.{name}"] = thing
            for key, member in vars(thing).items() if inspect.isclass(thing) else ():
                if not key.startswith("_") and (inspect.isroutine(member) or isinstance(member, property)):
                    found[f"{package}.{name}.{key}"] = getattr(member, "__func__", member)
    return found


PUBLIC = public()
WHOLE = {name: thing for name, thing in PUBLIC.items() if not isinstance(thing, property) and callable(thing)}


TOP = {name: thing for name, thing in WHOLE.items() if name.rpartition(".")[0] in PACKAGES}


def text_of(thing):
    return inspect.getdoc(thing) or ""


def entries(thing):
    """Parameters, attributes and what is returned, as (name, type, description)."""
    doc = NumpyDocString(text_of(thing))
    sections = ("Parameters", "Attributes", "Returns", "Yields", "Other Parameters")
    told = [(p.name, p.type, " ".join(p.desc)) for section in sections for p in doc[section]]
    return [each for each in told if not re.match(r"(As in|See) `", each[2])]


def parameters(thing):
    """Names of what a function takes, and of what a class takes beyond its base."""
    if inspect.isclass(thing):
        fields = {field.name: field for field in dataclasses.fields(thing)} if dataclasses.is_dataclass(thing) else {}
        if hasattr(thing, "__members__") or not ("__init__" in vars(thing) or fields):
            return []
        if fields:
            return [
                key
                for key in vars(thing).get("__annotations__", {})
                if key in fields and fields[key].init and key[0] != "_"
            ]
    return [name for name in inspect.signature(thing).parameters if name not in MAPS and not name.startswith("_")]


def test_there_are_as_many_as_one_thinks():
    assert len(PUBLIC) > 500
    assert sum(inspect.isclass(thing) for thing in PUBLIC.values()) > 120


def test_each_says_what_it_is():
    assert [name for name, thing in PUBLIC.items() if not text_of(thing)] == []


def test_each_parameter_is_named():
    """In a section of its own, or in the sentence of a docstring that is one."""
    assert [
        (name, parameter)
        for name, thing in TOP.items()
        for parameter in parameters(thing)
        if not re.search(rf"\b{parameter}\b", text_of(thing))
    ] == []


def test_each_entry_has_a_type():
    assert [
        (name, entry)
        for name, thing in WHOLE.items()
        for entry, kind, _ in entries(thing)
        if not kind and "**" not in entry
    ] == []


def test_arrays_have_shapes():
    assert [
        (name, entry)
        for name, thing in WHOLE.items()
        for entry, kind, told in entries(thing)
        if ARRAY.search(kind) and not SHAPED.search(f"{kind} {told}")
    ] == []


def test_times_have_units():
    assert [
        (name, entry)
        for name, thing in WHOLE.items()
        for entries_name, kind, told in entries(thing)
        for entry in entries_name.split(", ")
        if TIME.match(entry) and not SECONDS.search(f"{kind} {told}")
    ] == []


def raised(thing):
    """Names of the errors that its own lines raise."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(thing)))
    except (OSError, TypeError, SyntaxError):
        return set()
    body = tree.body[0]
    if isinstance(body, ast.ClassDef):
        body = next((f for f in body.body if getattr(f, "name", "") in ("__init__", "__post_init__")), ast.Pass())
    calls = [node.exc for node in ast.walk(body) if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)]
    return {call.func.id for call in calls if isinstance(call.func, ast.Name) and call.func.id[0].isupper()}


def test_errors_raised_are_named():
    assert [
        (name, error)
        for name, thing in WHOLE.items()
        for error in sorted(raised(thing))
        if error not in text_of(thing) and error not in ("AttributeError", "KeyError", "NotImplementedError")
    ] == []


@pytest.mark.parametrize("room", WITH_FORMULAS)
def test_formulas_have_sources(room):
    """The docstring of the name or of its module says where the formula is from."""
    named = {name: thing for name, thing in TOP.items() if thing.__module__.startswith(room)}
    assert len(named) > 3
    assert [
        name
        for name, thing in named.items()
        if not SOURCE.search(text_of(thing) + (sys.modules[thing.__module__].__doc__ or ""))
    ] == []
