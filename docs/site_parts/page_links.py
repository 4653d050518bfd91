"""Pages name each other as `docs/NAME.md`, which reads well as text; on the site that is a link."""

import re
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

PAGE = re.compile(r"^docs/([\w-]+)\.md$")


class PageLinks(SphinxTransform):
    """Makes a reference of each literal that is the path of a page."""

    default_priority = 400

    def apply(self, **options: Any) -> None:
        """See `SphinxTransform`."""
        for literal in list(self.document.findall(nodes.literal)):
            found = PAGE.match(literal.astext())
            if found and not isinstance(literal.parent, nodes.reference):
                link = addnodes.pending_xref(
                    "", refdomain="std", reftype="doc", reftarget=f"/{found[1]}", refexplicit=False, refwarn=True
                )
                link["refdoc"] = self.env.docname
                link += nodes.inline("", found[0])
                literal.replace_self(link)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the transform."""
    app.add_transform(PageLinks)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
