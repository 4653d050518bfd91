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


def second_doors(modules, users):
    """Names that users, trees by file, take from modules, trees by dotted name, that do not define them."""
    own = {module: defined(tree) for module, tree in modules.items()}
    return [
        (file, node.module, alias.name)
        for file, tree in users.items()
        for node in statements(tree)
        if isinstance(node, ast.ImportFrom) and node.module in own
        for alias in node.names
        if alias.name not in own[node.module]
    ]


def test_names_are_imported_from_where_they_are_defined():
    folders = [ROOT / name for name in (*PACKAGES, "tests")]
    trees = {file: ast.parse(file.read_text(encoding="utf-8")) for folder in folders for file in folder.rglob("*.py")}
    modules = {
        ".".join(file.relative_to(ROOT).with_suffix("").parts): tree
        for file, tree in trees.items()
        if file.name != "__init__.py" and file.relative_to(ROOT).parts[0] in PACKAGES
    }
    assert len(modules) > 200
    assert second_doors(modules, trees) == []


def test_a_second_door_is_noticed():
    modules = {"house": ast.parse("from street import key\ndoor = key")}
    users = {"guest.py": ast.parse("from house import door, key")}
    assert second_doors(modules, users) == [("guest.py", "house", "key")]
