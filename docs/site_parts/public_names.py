"""``.. public-names:: package`` is the documentation of every name in a package's ``__all__``, so none is left out.

Names that come from one module stand together, in the order of modules; the page needs no list of its own.
"""

import importlib
import inspect
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


def directive_of(package: str, name: str) -> list[str]:
    """The lines of autodoc's directive for a public name."""
    found = getattr(importlib.import_module(package), name)
    if inspect.isclass(found):
        return [f".. autoclass:: {package}.{name}", "   :members:", ""]
    if inspect.isroutine(found):
        return [f".. autofunction:: {package}.{name}", ""]
    return [f".. autodata:: {package}.{name}", "   :no-value:", ""]


class PublicNames(SphinxDirective):
    """Documents the public names of the package that is its argument; options ``only`` and ``but`` narrow that."""

    required_arguments = 1
    option_spec = {"only": str.split, "but": str.split}  # noqa: RUF012

    def run(self) -> list[nodes.Node]:
        """See `SphinxDirective`."""
        package = self.arguments[0]
        module = importlib.import_module(package)
        names = [name for name in module.__all__ if name != "__version__"]
        names = [name for name in self.options.get("only", names) if name not in self.options.get("but", ())]
        names.sort(key=lambda name: (getattr(getattr(module, name), "__module__", ""), name))
        lines = [line for name in names for line in directive_of(package, name)]
        around = nodes.section()
        around.document = self.state.document
        self.state.nested_parse(StringList(lines, source=package), 0, around)
        return around.children


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("public-names", PublicNames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
