"""What is built to be installed: complete, and it runs in an environment that has nothing else."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("hybrid_model", "fmu", "cosim")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def tracked():
    """Files of the packages that are part of the project."""
    if not (ROOT / ".git").exists():
        pytest.skip("needs the repository: git tells which files belong to it")
    done = subprocess.run(["git", "ls-files", "-z", *PACKAGES], cwd=ROOT, capture_output=True, text=True, check=True)
    return {name for name in done.stdout.split("\0") if name and (ROOT / name).is_file()}


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The wheel and the sdist, by the build backend itself, in this environment."""
    out = tmp_path_factory.mktemp("dist")
    program = (
        "import sys; from hatchling.build import build_sdist, build_wheel; "
        "print(build_sdist(sys.argv[1])); print(build_wheel(sys.argv[1]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(out)], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return [out / name for name in done.stdout.split()]


def test_the_wheel_has_every_file_of_the_packages(built):
    _, wheel = built
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        (entry_points,) = [name for name in names if name.endswith("entry_points.txt")]
        assert "hybrid-fmu = cosim.cli.entry:main" in archive.read(entry_points).decode()
    assert tracked() - names == set()
    assert {f"{package}/py.typed" for package in PACKAGES} <= names
    assert not [name for name in names if name.split("/")[0] not in PACKAGES and ".dist-info/" not in name]


def test_the_sdist_has_them_too_and_what_a_test_needs(built):
    sdist, _ = built
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert tracked() - names == set()
    assert {"Makefile", "constraints.txt", "tests/conftest.py", "LICENSE", "CITATION.cff"} <= names
    assert not [name for name in names if name.startswith((".venv", "results", "dist/"))]


def test_the_citation_has_the_version_of_the_package():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    (version,) = re.findall(r"^version: (\S+)$", text, re.M)
    assert f'__version__ = "{version}"' in (ROOT / "hybrid_model" / "__init__.py").read_text(encoding="utf-8")


def test_the_conda_recipe_says_what_the_wheel_says():
    """Conda-forge has matplotlib without its windows under another name, and compilers as packages."""
    text = (ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    (run,) = re.findall(r"^  run:\n((?:    .*\n)+)", text, re.M)
    wanted = {line.strip(" -").replace(" ", "") for line in run.splitlines() if line.strip()[0] == "-"}
    asked = {line.replace(" ", "").replace("matplotlib", "matplotlib-base") for line in PROJECT["dependencies"]}
    assert wanted == asked | {f"python{PROJECT['requires-python']}", "c-compiler"}
    (version,) = re.findall(r'^  version: "(.*)"$', text, re.M)
    assert f'__version__ = "{version}"' in (ROOT / "hybrid_model" / "__init__.py").read_text(encoding="utf-8")
    assert set(re.findall(r"^ +- (\S+ = \S+:\S+)$", text, re.M)) == {
        f"{name} = {place}" for name, place in PROJECT["scripts"].items()
    }


def run(python, *call, **more):
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    return subprocess.run(
        [python, *call], capture_output=True, text=True, check=True, env=environment | more, timeout=900
    )


@pytest.mark.long
@pytest.mark.parametrize("kind", ["wheel", "sdist"])
def test_in_an_empty_environment_it_runs(kind, built, tmp_path):
    sdist, wheel = built
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / "bin" / "python"
    file = wheel if kind == "wheel" else sdist
    run(python, "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", file)
    cache = {"HYBRID_FMU_CACHE": str(tmp_path / "cache")}
    command = tmp_path / "env" / "bin" / "hybrid-fmu"
    assert "native: its maps are compiled" in run(python, command, "doctor", **cache).stdout
    # What it can do without extras, and the sentence where one is missing.
    out = run(python, command, "export", "paper-a", "--out", tmp_path / "fmus", **cache).stdout.split()
    assert len(out) == 4
    assert "sound: 0 errors" in run(python, command, "validate", out[0], **cache).stdout.lower()
    missing = subprocess.run([python, command, "app"], capture_output=True, text=True, check=False)
    assert missing.returncode == 2
    assert 'pip install "hybrid-fmu[app]"' in missing.stderr


@pytest.mark.long
@pytest.mark.parametrize("extra", sorted(set(PROJECT["optional-dependencies"]) - {"dev", "interop", "mosaik"}))
def test_each_extra_can_be_installed(extra, built, tmp_path):
    """Those of other platforms' importers are installed with the extra dev, in which the tests run."""
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / "bin" / "python"
    run(python, "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", f"{built[1]}[{extra}]")
    lines = run(python, tmp_path / "env" / "bin" / "hybrid-fmu", "doctor").stdout.splitlines()
    (line,) = [line for line in lines if line.startswith(f"extra      {extra}:")]
    assert "missing" not in line


def interpreter(version):
    """A Python of that version that runs, on the path or as pyenv keeps it; None if there is none."""
    kept = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python"))
    for found in (shutil.which(f"python{version}"), *kept):
        if found and subprocess.run([found, "--version"], capture_output=True, check=False).returncode == 0:
            return found
    return None


REUSE = """
from dataclasses import replace
from hybrid_model.consensus import closed_loop, load_scenario
from hybrid_model.native.free_values.snapshots import snapshot
paper = load_scenario("paper-a")
other = replace(paper, network=replace(paper.network, initial=(1.0, 2.0, 3.0, 4.0)))
print(snapshot(closed_loop(paper)).key == snapshot(closed_loop(other)).key)
"""


@pytest.mark.long
@pytest.mark.parametrize("version", ["3.12", "3.13", "3.14"])
def test_with_another_python_it_runs(version, built, tmp_path):
    found = interpreter(version)
    if found is None:
        pytest.skip(f"needs python{version}")
    subprocess.run([found, "-m", "venv", str(tmp_path / "env")], check=True, capture_output=True)
    python, command = (tmp_path / "env" / "bin" / name for name in ("python", "hybrid-fmu"))
    run(python, "-m", "pip", "install", "-q", "-c", ROOT / "constraints.txt", built[1])
    assert "native: its maps are compiled" in run(python, command, "doctor").stdout
    out = run(python, command, "export", "paper-a", "--out", tmp_path / "fmus").stdout.split()
    assert "sound: 0 errors" in run(python, command, "validate", out[0]).stdout.lower()
    wrong = subprocess.run([python, command, "simulate", "paper-a", "--stop", "1"], capture_output=True, text=True)
    assert wrong.returncode == 2
    assert "'hybrid-fmu simulate' has no option '--stop'. Did you mean '--stop-time'?" in wrong.stderr
    # What a map reads is read off its bytecode, which differs between versions.
    assert run(python, "-c", REUSE).stdout == "True\n"
