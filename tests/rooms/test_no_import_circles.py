"""No module imports itself by way of others; imports in functions and for type checkers alone count too."""

import ast
import graphlib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted(file for package in ("hybrid_model", "fmu", "cosim") for file in (ROOT / package).rglob("*.py"))


def module_name(file):
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports():
    """Of each module, those of the project that it imports, wherever the statement stands."""
    modules = {module_name(file): file for file in FILES}
    found = {}
    for name, file in modules.items():
        named = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                named |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{name}: relative imports are not counted here"
                for alias in node.names:
                    full = f"{node.module}.{alias.name}"
                    named.add(full if full in modules else node.module)
        found[name] = named & modules.keys()
    return found


def test_no_import_leads_back_to_where_it_began():
    graphlib.TopologicalSorter(imports()).prepare()


def test_a_circle_is_noticed():
    graph = imports()
    graph["hybrid_model.declare.variables"] |= {"hybrid_model.simulate"}
    with pytest.raises(graphlib.CycleError, match=r"hybrid_model\.declare\.variables"):
        graphlib.TopologicalSorter(graph).prepare()
