"""A process that has everything imported, and forks one child an experiment: each is fresh, and begins at once."""

from __future__ import annotations

import gc
import os
import sys

from fmu.validate.child.experiments import main


def serve() -> None:
    """Make the experiment of each folder that a line on stdin names; answer with its process, then with its status."""
    gc.freeze()  # its children leave sooner: what they share with it is no garbage of theirs
    for line in sys.stdin:
        folder = line.rstrip("\n")
        pid = os.fork()
        if pid == 0:
            _settle(folder)
            sys.exit(main(os.path.join(folder, "plan.json")))
        # Here as well as in the child: whoever reads the number may end its group.
        os.setpgid(pid, pid)
        print(pid, flush=True)
        print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), flush=True)


def _settle(folder: str) -> None:
    """Give the child a group, a working folder, and files of its own for what is printed."""
    os.setpgid(0, 0)
    os.chdir(os.path.join(folder, "work"))
    for place, name, flags in (
        (0, os.devnull, os.O_RDONLY),
        (1, os.path.join(folder, "stdout"), os.O_WRONLY | os.O_CREAT),
        (2, os.path.join(folder, "stderr"), os.O_WRONLY | os.O_CREAT),
    ):
        opened = os.open(name, flags, 0o600)
        os.dup2(opened, place)
        os.close(opened)
