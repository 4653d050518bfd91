"""``.. public-names:: package`` is the documentation of every name in a package's ``__all__``, so none is left out.

Names that come from one module stand together, in the order of modules; the page needs no list of its own.
"""

import importlib
import inspect
from typing import Any

from docutils import nodes
from docutils.parsers.rst import directives
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


def directive_of(package: str, name: str, members: bool) -> list[str]:
    """The lines of autodoc's directive for a public name."""
    found = getattr(importlib.import_module(package), name)
    if inspect.isclass(found):
        return [f".. autoclass:: {package}.{name}", *(["   :members:"] if members else []), ""]
    if inspect.isroutine(found):
        return [f".. autofunction:: {package}.{name}", ""]
    return [f".. autodata:: {package}.{name}", "   :no-value:", ""]


class PublicNames(SphinxDirective):
    """Documents the public names of its argument, a package; ``but`` leaves some out, ``flat`` their members."""

    required_arguments = 1
    option_spec = {"but": str.split, "flat": directives.flag}  # noqa: RUF012

    def run(self) -> list[nodes.Node]:
        """See `SphinxDirective`."""
        package = self.arguments[0]
        module = importlib.import_module(package)
        names = [name for name in module.__all__ if name not in ("__version__", *self.options.get("but", ()))]
        names.sort(key=lambda name: (getattr(getattr(module, name), "__module__", ""), name))
        lines = [line for name in names for line in directive_of(package, name, "flat" not in self.options)]
        around = nodes.section()
        around.document = self.state.document
        self.state.nested_parse(StringList(lines, source=package), 0, around)
        return around.children


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("public-names", PublicNames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
