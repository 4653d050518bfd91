"""Python code in a process of its own: what hangs or crashes there fails a test, and not the whole suite."""

import os
import subprocess
import sys
from pathlib import Path

SUPPORT = str(Path(__file__).parent)


def run_child(code, *arguments, seconds=60, **environment):
    """What code prints that can import the modules of this folder; it has to end well, and in time."""
    paths = os.pathsep.join([SUPPORT, *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        env=os.environ | {"PYTHONPATH": paths} | environment,
        capture_output=True,
        text=True,
        timeout=seconds,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout.strip()
