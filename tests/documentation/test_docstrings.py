"""Every public name says what it takes and gives: parameters with types, shapes, units, errors raised, sources.

Public names are those in the ``__all__`` of `PACKAGES`, those that README, pages and notebooks name or import, and the
public methods of their classes.
"""

import ast
import dataclasses
import importlib
import inspect
import re
import sys
import textwrap
from pathlib import Path

import pytest
from numpydoc.docscrape import NumpyDocString

ROOT = Path(__file__).parents[2]
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


def in_the_documentation():
    """Dotted names that readers are told: in sentences, in directives, and by imports in code."""
    files = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "docs").rglob("*.rst")]
    text = "\n".join(file.read_text(encoding="utf-8") for file in [*files, *(ROOT / "notebooks").glob("*.py")])
    yield from re.findall(rf"\b(?:{'|'.join(OWN)})(?:\.\w+)+", text)
    for module, one_line, several in re.findall(r"^from ([\w.]+) import (?:\(([^)]*)\)|(.*))", text, re.MULTILINE):
        yield from (f"{module}.{name}" for name in re.findall(r"\w+", f"{one_line} {several}"))


def resolved(dotted):
    """The object of a dotted name, and its own qualified name; None for modules and for what is none of ours."""
    module, _, name = dotted.rpartition(".")
    if not module.startswith(OWN) or name.startswith("_"):
        return None
    try:
        thing = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError):
        return None
    ours = callable(thing) and getattr(thing, "__module__", "").startswith(OWN)
    return (f"{thing.__module__}.{thing.__qualname__}", thing) if ours and hasattr(thing, "__qualname__") else None


def public():
    """Qualified name -> object: public classes and functions, and the methods and properties of the classes."""
    doors = [f"{package}.{name}" for package in PACKAGES for name in importlib.import_module(package).__all__]
    top = dict(found for found in map(resolved, [*doors, *in_the_documentation()]) if found)
    members = {}
    for thing in filter(inspect.isclass, top.values()):
        for cls in (base for base in thing.__mro__ if base.__module__.startswith(OWN)):
            for key, member in vars(cls).items():
                if not key.startswith("_") and (inspect.isroutine(member) or isinstance(member, property)):
                    members[f"{cls.__module__}.{cls.__qualname__}.{key}"] = getattr(member, "__func__", member)
    return top, members


TOP, MEMBERS = public()
PUBLIC = TOP | MEMBERS
WHOLE = {name: thing for name, thing in PUBLIC.items() if not isinstance(thing, property) and callable(thing)}


def text_of(thing):
    """Its docstring, with that of the method which it refers to, such as `Slave.step`."""
    text = inspect.getdoc(thing) or ""
    referred = re.match(r"See `(\w+\.\w+)`", text)
    others = [each for name, each in MEMBERS.items() if referred and name.endswith(f".{referred[1]}")]
    return "\n".join([text, *(inspect.getdoc(each) or "" for each in others)])


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
    assert (len(TOP), len(MEMBERS)) > (220, 500)
    assert {"hybrid_model.simulate.simulate", "fmu.export.export_fmu", "cosim.fmu_slave.FmuSlave"} <= set(TOP)
    assert {"cosim.slave.Slave.start", "cosim.result.CosimResult.event_times"} <= set(MEMBERS)


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
