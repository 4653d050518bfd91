"""Formulas as drawings, SVG with the outlines of STIX Two Math: read without a network, scripts or fonts of the reader.

Browsers draw MathML by themselves as well, but without a font that has a table for mathematics they draw it badly.
"""

import html
import re
from typing import Any

import ziamath
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

SIZE = 20.0
"""Units of the drawing in one em."""

ziamath.config.svg2 = False  # outlines in place: names of symbols would be there twice on a page


def drawn(latex: str, *, inline: bool) -> str:
    """Return a formula as an SVG as large as the text around it, on its base line."""
    svg = ziamath.Latex(latex, size=SIZE, color="currentColor", inline=inline).svg()
    (box,) = re.findall(r'viewBox="([^"]*)"', svg)
    _, top, width, height = (float(number) / SIZE for number in box.split())
    style = f"width: {width:.3f}em; height: {height:.3f}em; vertical-align: {-(top + height):.3f}em"
    opening = f'<svg role="img" aria-label="{html.escape(latex)}" style="{style}" viewBox="{box}" fill="currentColor">'
    return re.sub(r"^<svg[^>]*>", lambda _: opening, svg)


def inline(self: HTML5Translator, node: nodes.math) -> None:
    """Write a formula in the line."""
    self.body.append(drawn(node.astext(), inline=True))
    raise nodes.SkipNode


def display(self: HTML5Translator, node: nodes.math_block) -> None:
    """Write a formula on a line of its own."""
    self.body.append(f'<div class="math" style="text-align: center">{drawn(node.astext(), inline=False)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer ``drawings``."""
    app.add_html_math_renderer("drawings", (inline, None), (display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
