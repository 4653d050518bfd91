"""Figures as PGF, whose texts are measured by TeX."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

from hybrid_model.errors import DataError

SYSTEMS = ("xelatex", "pdflatex", "lualatex")


def tex_system() -> str:
    """Return the name of the TeX that is there.

    Raises
    ------
    DataError
        If there is none.
    """
    found = next(filter(shutil.which, SYSTEMS), None)
    if found is None:
        raise DataError(
            "a figure as PGF needs TeX, and there is no xelatex, pdflatex or lualatex: install one, or leave pgf out."
        )
    return found


@contextmanager
def measured_by_tex() -> Iterator[None]:
    """Write PGF by the TeX that is there.

    Raises
    ------
    DataError
        If there is none, or it ends with an error, as where it lacks a package.
    """
    import matplotlib.pyplot as plt
    from matplotlib.backends.backend_pgf import LatexError

    system = tex_system()
    with plt.rc_context({"pgf.texsystem": system}):
        try:
            yield
        except (LatexError, RuntimeError, BrokenPipeError) as error:
            # One that ends before it has read its preamble has said nothing that matplotlib would pass on.
            broken = isinstance(error, BrokenPipeError)
            why = "nothing, and ends at once" if broken else str(error).splitlines()[0].rstrip(".:")
            raise DataError(
                f"a figure as PGF cannot be written, since {system} says: {why}. Remedy: install LaTeX's package pgf "
                "with its recommended ones, or leave pgf out."
            ) from error
