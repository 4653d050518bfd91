"""Where the command begins: it imports nothing before an interrupt has somebody to answer it."""

import gc
import sys

MOST_NEW_OBJECTS = 50_000
"""New objects after which Python looks for circles of dead ones; its own 700 cost a twentieth of a command's time."""


def main() -> int:
    """Run the command line of the process; see `cosim.cli.main.main`."""
    gc.set_threshold(MOST_NEW_OBJECTS)
    try:
        from cosim.cli.main import main as run

        return run()
    except KeyboardInterrupt:
        print("hybrid-fmu: interrupted.", file=sys.stderr)
        return 130
