"""Faults that only runs of networks in this process show are seen by quick tests of the suite."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from mutated_engine import NAMED, RUN_MUTANTS, changed_folders

from hybrid_model.native.build.compiler import find_compiler
from hybrid_model.native.build.objects import COMMON_FLAGS

ROOT = Path(__file__).resolve().parents[2]


def outcome(test, **environment):
    """The status of a test in a process of its own."""
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-x", "-p", "no:cacheprovider", "-p", "mutated_engine"]
    paths = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [*command, test],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": paths, **environment},
        capture_output=True,
        text=True,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("mutant", RUN_MUTANTS, ids=lambda mutant: mutant.name)
def test_its_place_is_there(mutant):
    file, test = mutant.first.split("::")
    assert f"def {test}(" in (ROOT / file).read_text()
    mutant.changed()


@pytest.mark.faults
@pytest.mark.parametrize("test", sorted({mutant.first for mutant in RUN_MUTANTS}))
def test_the_engine_as_it_is_survives(test):
    status, said = outcome(test)
    assert status == 0, said


@pytest.mark.faults
@pytest.mark.parametrize("mutant", RUN_MUTANTS, ids=lambda mutant: mutant.name)
def test_killed(mutant, tmp_path):
    folders, _ = changed_folders(mutant, tmp_path)
    name, _ = mutant.changed()
    (file,) = tmp_path.rglob(name)
    includes = [f"-I{folder}" for folder in folders]
    # That a changed engine does not compile kills nothing.
    subprocess.run([*find_compiler(), *COMMON_FLAGS, *includes, "-fsyntax-only", str(file)], check=True)
    status, said = outcome(mutant.first, **{NAMED: mutant.name})
    assert status == 1, f"nobody sees it: {mutant.breaks}\n{said}"
