"""``.. model:: file`` is an entry of the gallery: what the models say of themselves, a run drawn now, the code.

The content is what draws the picture; `plot_pre_code` of the configuration has its imports.
"""

import inspect
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

import hybrid_model.models


def told(name: str) -> list[str]:
    """What a model's docstring says, without its sections."""
    text = inspect.getdoc(getattr(hybrid_model.models, name)) or ""
    return text.partition("\nParameters\n---")[0].splitlines()


class ModelEntry(SphinxDirective):
    """An entry; the option ``classes`` names the models of the file, the main one first."""

    required_arguments = 1
    option_spec = {"classes": str.split}  # noqa: RUF012
    has_content = True

    def run(self) -> list[nodes.Node]:
        """See `SphinxDirective`."""
        first, *others = self.options["classes"]
        lines = [*told(first), "", ".. plot::", "", *(f"   {line}" for line in self.content), ""]
        for name in others:
            lines += [f"`{name} <hybrid_model.models.{name}>`: {told(name)[0]}", ""]
        lines += [".. raw:: html", "", f"   <details><summary>The code of {first}</summary>", ""]
        lines += [f".. literalinclude:: ../hybrid_model/models/{self.arguments[0]}.py", "   :language: python", ""]
        lines += [".. raw:: html", "", "   </details>", ""]
        around = nodes.section()
        around.document = self.state.document
        self.state.nested_parse(StringList(lines, source=self.get_source_info()[0]), 0, around)
        return around.children


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("model", ModelEntry)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
