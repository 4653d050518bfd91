"""Folders of results: never half-written, and never beside what an earlier run left of the same command."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cosim.errors import UsageError

LIST = ".hybrid-fmu.json"
"""In a folder of results: which files each command wrote there."""


@contextmanager
def results_folder(out: Path, command: str) -> Iterator[Path]:
    """Give a folder to write results to; they move to `out` when all went well, and else go.

    What an earlier run of the command left there goes first, so that no figure of another scenario stays beside the
    new ones; files of anybody else stay.

    Parameters
    ----------
    out : Path
        The folder, which is made.
    command : str
        Whose results.

    Raises
    ------
    UsageError
        If the folder cannot be made, or is a file.
    """
    _made(out)
    scratch = Path(tempfile.mkdtemp(prefix=".hybrid-fmu-", dir=out))
    try:
        yield scratch
        written = sorted(path.relative_to(scratch).as_posix() for path in scratch.rglob("*") if path.is_file())
        listed = _listed(out)
        for name in listed.get(command, []):
            _removed(out, name)
        for name in written:
            (out / name).parent.mkdir(parents=True, exist_ok=True)
            (scratch / name).replace(out / name)
        (scratch / LIST).write_text(json.dumps({**listed, command: written}, indent=1) + "\n", encoding="utf-8")
        (scratch / LIST).replace(out / LIST)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def _made(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise UsageError(f"{folder} cannot be a folder for results, since there is a file: give another.") from error


def _listed(out: Path) -> dict[str, list[str]]:
    try:
        found = json.loads((out / LIST).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _removed(out: Path, name: str) -> None:
    """Remove what a run wrote, if it still lies where it was written."""
    path = (out / name).resolve()
    if path.is_relative_to(out.resolve()) and path.is_file():
        path.unlink()
