"""What a compiler refuses, told as an error of this package."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from fmu.errors import BuildError
from hybrid_model.errors import BuildError as CompilerError


@contextmanager
def refusals() -> Iterator[None]:
    """Raise what `hybrid_model` raises for a compiler as `fmu.errors.BuildError`, the one that callers know."""
    try:
        yield
    except CompilerError as error:
        raise BuildError(str(error)) from error
