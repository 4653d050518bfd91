"""`hybrid-fmu app`: the interactive page, served by marimo."""

from __future__ import annotations

import argparse
import importlib.util
import os
import socket
import subprocess
import sys
from pathlib import Path

from cosim.cli.exits import Exit
from cosim.errors import UsageError


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    if importlib.util.find_spec("marimo") is None:
        raise UsageError('the page needs marimo, which is not installed: pip install "hybrid-fmu[app]".')
    _require_free(options.port)
    page = Path(__file__).with_name("page.py")
    # Nobody but who sits here: it runs code, if only that of the page.
    call = [
        sys.executable,
        "-m",
        "marimo",
        "run",
        str(page),
        "--host",
        "127.0.0.1",
        "--port",
        str(options.port),
        "--no-token",
    ]
    if options.no_browser:
        call.append("--headless")
    print(f"http://127.0.0.1:{options.port} until Ctrl-C", flush=True)
    return int(Exit.DONE if subprocess.run(call, check=False).returncode in (0, 130, -2) else Exit.FAILED)


def _require_free(port: int) -> None:
    with socket.socket() as tried:
        if os.name == "posix":  # elsewhere it would share a port with whoever has it
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            tried.bind(("127.0.0.1", port))
        except (OSError, OverflowError) as error:
            raise UsageError(
                f"the page cannot be served at port {port} of this machine: {str(error).rstrip('.')}; give another "
                "one, --port N."
            ) from error
