"""Where the command begins: it imports nothing before an interrupt has somebody to answer it."""

import sys


def main() -> int:
    """Run the command line of the process; see `cosim.cli.main.main`."""
    try:
        from cosim.cli.main import main as run

        return run()
    except KeyboardInterrupt:
        print("hybrid-fmu: interrupted.", file=sys.stderr)
        return 130
