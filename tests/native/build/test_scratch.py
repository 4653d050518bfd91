"""Temporary folders go with their process, and those of killed ones with the next use."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from hybrid_model.native.build.scratch import PREFIX, YOUNG, ScratchFolder

HOLDS = """
import time
from hybrid_model.native.build.scratch import ScratchFolder
folder = ScratchFolder()
open(folder.name + "/part.o", "w").close()
print(folder.name, flush=True)
time.sleep(60)
"""


@pytest.fixture
def places(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def grown_old(folder):
    old = time.time() - 2.0 * YOUNG
    os.utime(folder, (old, old))


def test_a_folder_goes_with_its_block(places):
    with ScratchFolder() as folder:
        assert Path(folder).parent == places
        (Path(folder) / "part.o").touch()
    assert list(places.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_what_a_killed_process_leaves_is_removed_by_the_next_use_and_nothing_else_is(places):
    run = subprocess.Popen(
        [sys.executable, "-c", HOLDS], env={**os.environ, "TMPDIR": str(places)}, stdout=subprocess.PIPE, text=True
    )
    left = Path(run.stdout.readline().strip())
    others = [places / f"{PREFIX}file", places / "hybrid-fmu-other", places / f"{PREFIX}link"]
    others[0].touch()
    others[1].mkdir()
    others[2].symlink_to(others[1])
    for path in (left, *others):
        grown_old(path)
    with ScratchFolder():
        assert left.exists()
    run.send_signal(signal.SIGKILL)
    run.wait()
    run.stdout.close()
    assert (left / "part.o").exists()
    grown_old(left)
    with ScratchFolder() as own:
        grown_old(own)
        with ScratchFolder():
            assert Path(own).exists()
    assert sorted(places.iterdir()) == sorted(others)


@pytest.mark.skipif(sys.platform == "win32", reason="locks")
def test_a_young_folder_is_left_alone_for_it_may_not_be_locked_yet(places):
    young = places / f"{PREFIX}young"
    young.mkdir()
    with ScratchFolder():
        assert young.exists()
