"""Each name has one door: the module that defines it, or a package's `__init__` that shows it."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("hybrid_model", "fmu", "cosim")
DEFINITIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


def statements(tree, *, inside=True):
    """The statements of a tree, those within others too, such as definitions; expressions are left alone."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.stmt):
            yield node
        if isinstance(node, (ast.stmt, ast.excepthandler)) and (inside or not isinstance(node, DEFINITIONS)):
            yield from statements(node, inside=inside)


def defined(tree):
    """Names that a module gives a value itself."""
    own = list(statements(tree, inside=False))
    names = {node.name for node in own if isinstance(node, DEFINITIONS)}
    return names | {
        name.id
        for node in own
        if not isinstance(node, DEFINITIONS)
        for name in ast.walk(node)
        if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
    }


def taken(tree):
    """The modules and names that a file takes by `from ... import`."""
    return [
        (node.module, alias.name)
        for node in statements(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    ]


def second_doors(own, users):
    """Names that users, what they take by file, take from modules, their own names by dotted name, not their own."""
    return [
        (file, module, name)
        for file, pairs in users.items()
        for module, name in pairs
        if module in own and name not in own[module]
    ]


def test_names_are_imported_from_where_they_are_defined():
    own, users = {}, {}
    for file in (file for name in (*PACKAGES, "tests") for file in (ROOT / name).rglob("*.py")):
        # One tree at a time: many together keep the collector of garbage busy.
        tree = ast.parse(file.read_text(encoding="utf-8"))
        users[file] = taken(tree)
        parts = file.relative_to(ROOT).with_suffix("").parts
        if file.name != "__init__.py" and parts[0] in PACKAGES:
            own[".".join(parts)] = defined(tree)
    assert len(own) > 200
    assert second_doors(own, users) == []


def test_a_second_door_is_noticed():
    own = {"house": defined(ast.parse("from street import key\ndoor = key"))}
    users = {"guest.py": taken(ast.parse("from house import door, key"))}
    assert second_doors(own, users) == [("guest.py", "house", "key")]
