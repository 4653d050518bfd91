"""A plugin of pytest: the engine of runs is built with one fault of run_mutants.txt, which the environment names."""

import os
import shutil
import tempfile
from pathlib import Path

from mutants import read

from hybrid_model.native.build import libraries

RUN_MUTANTS = read(Path(__file__).with_name("run_mutants.txt").read_text())
NAMED = "HYBRID_FMU_MUTANT"


def changed_folders(mutant, folder):
    """The folders of the engine, of which a copy in `folder` has the fault."""
    file, text = mutant.changed()
    root = libraries.ENGINE_FOLDERS[0]
    shutil.copytree(root, folder, dirs_exist_ok=True)
    next(folder.rglob(file)).write_text(text)
    return [
        tuple(folder / place.relative_to(root) for place in folders)
        for folders in (libraries.ENGINE_FOLDERS, libraries.RUNS_FOLDERS)
    ]


if NAMED in os.environ:
    _folder = tempfile.TemporaryDirectory(prefix="hybrid-fmu-mutant-")
    _mutant = next(mutant for mutant in RUN_MUTANTS if mutant.name == os.environ[NAMED])
    libraries.ENGINE_FOLDERS, libraries.RUNS_FOLDERS = changed_folders(_mutant, Path(_folder.name))
