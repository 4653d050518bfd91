"""Which exit status an error is: the mistakes of whoever called, and what failed."""

from __future__ import annotations

from cosim.cli.exits import Exit
from cosim.errors import CosimError, UsageError


def status_of(error: Exception) -> Exit | None:
    """Return the exit status of an error, or None if it is a fault of this program.

    Wrong usage is what was typed, and what a scenario says that was named there: names that there are not, values out
    of range. Failed is what could be begun and did not work: a model, an FMU, a file, a run.
    """
    if isinstance(error, UsageError):
        return Exit.USAGE
    # Not before there is an error: these take longer to import than the command line.
    from fmu.errors import BuildError, ExportError
    from hybrid_model.consensus.messages import ScenarioError
    from hybrid_model.errors import HybridModelError, NamingError

    if isinstance(error, (ScenarioError, NamingError)):
        return Exit.USAGE
    return Exit.FAILED if isinstance(error, (HybridModelError, ExportError, BuildError, CosimError, OSError)) else None


def sentence_of(error: Exception) -> str:
    """Return what people are told of an error: its message, and of the system's errors the file and what to do."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror}. Give a file or a folder that you may read or write."
    return str(error)
