"""The point of a run has one writer: its own class."""

import ast
from pathlib import Path

import hybrid_model
from hybrid_model.models import BouncingBall
from hybrid_model.reference.point import Point

PACKAGE = Path(hybrid_model.__file__).parent
STATE = {"t", "j", "x", "z", "p", "t_jump", "sizes", "floor", "levels", "next_step"}


def writers(file):
    """Names of attributes that a module writes, whole or in part."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        for target in node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]:
            for part in ast.walk(target) if target is not None else ():
                if isinstance(part, ast.Attribute) and not isinstance(part.ctx, ast.Del):
                    found.add(part.attr)
    return found


def test_only_the_point_writes_what_it_is():
    assert vars(Point(BouncingBall())).keys() >= STATE
    point = PACKAGE / "reference" / "point.py"
    assert writers(point) >= STATE
    others = [*(PACKAGE / "reference").glob("*.py"), *(PACKAGE / "schedule").glob("*.py"), PACKAGE / "simulate.py"]
    wrong = {file.name: writers(file) & STATE for file in others if file != point}
    # The scheduler's own time, and where each of its blocks is.
    assert wrong.pop("scheduler.py") <= {"t"}
    assert not any(wrong.values()), wrong
