"""The house: rooms that are not crowded and say what they are for; contracts that notice an arrow turned round."""

import ast
import fnmatch
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("hybrid_model", "fmu", "cosim")
# About twenty; the library of models is a list, one model a file.
MOST_MODULES = 21
LIST = ROOT / "hybrid_model" / "models"
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]


def rooms():
    return sorted({file.parent for package in PACKAGES for file in (ROOT / package).rglob("*.py")})


def test_no_room_is_crowded():
    sizes = {
        room.relative_to(ROOT).as_posix(): len([*room.glob("*.py"), *room.glob("*.[ch]")]) - 1
        for package in PACKAGES
        for room in [ROOT / package, *(ROOT / package).rglob("*/")]
        if room != LIST
    }
    assert {room: size for room, size in sizes.items() if size > MOST_MODULES} == {}


def test_each_room_says_what_it_is_for():
    # That of fmu is one line on which other distributions agree, see its contract in ARCHITECTURE.md.
    silent = [
        room.relative_to(ROOT).as_posix()
        for room in rooms()
        if room != ROOT / "fmu" and not ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8")))
    ]
    assert silent == []


def test_modules_offer_names_of_their_own_only():
    """Only a package's `__init__` passes on the names of others."""
    foreign = {}
    for file in (file for room in rooms() for file in room.glob("*.py") if file.name != "__init__.py"):
        body = ast.parse(file.read_text(encoding="utf-8")).body
        assigned = {name.id: node for node in body for name in getattr(node, "targets", []) if hasattr(name, "id")}
        if "__all__" in assigned:
            own = {*assigned, *(node.name for node in body if hasattr(node, "name"))}
            own |= {node.target.id for node in body if isinstance(node, ast.AnnAssign)}
            foreign[file.relative_to(ROOT).as_posix()] = {*ast.literal_eval(assigned["__all__"].value)} - own
    assert len(foreign) > 50
    assert {file: names for file, names in foreign.items() if names} == {}


def test_each_room_is_in_a_contract():
    named = {
        part.strip()
        for contract in CONTRACTS
        for entry in contract.get("layers", [])
        for part in re.split("[|:]", entry)
    }
    inside = [room for room in rooms() if room.parent != ROOT]
    assert [str(room) for room in inside if ".".join(room.relative_to(ROOT).parts) not in named] == []


def test_an_arrow_turned_round_breaks_its_contract(tmp_path):
    """In a copy of the packages the lowest layer of each contract imports the highest."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    layered = [contract for contract in CONTRACTS if contract["type"] == "layers"]
    for contract in layered:
        low, high = (re.split("[|:]", contract["layers"][k])[0].strip() for k in (-1, 0))
        place = tmp_path.joinpath(*low.split("."))
        file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
        file.write_text(f"{file.read_text(encoding='utf-8')}\nimport {high}\n", encoding="utf-8")
    command = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as run; run()", "--no-cache"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    for contract in layered:
        assert re.search(rf"^{re.escape(contract['name'])}.*BROKEN", done.stdout, re.MULTILINE), done.stdout


def test_pytest_goes_into_every_folder_of_tests():
    """By default it passes over folders called build, dist or venv without a word."""
    left_out = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["pytest"]["ini_options"]
    folders = {part for file in (ROOT / "tests").rglob("test_*.py") for part in file.relative_to(ROOT).parts[:-1]}
    assert {"build", "rooms"} <= folders
    assert [name for name in folders for pattern in left_out["norecursedirs"] if fnmatch.fnmatch(name, pattern)] == []
