"""Sphinx: how the pages of this folder become the documentation site (`make docs`)."""

import gc
import sys
from pathlib import Path

import hybrid_model
from hybrid_model.plots import JOURNAL

sys.path.insert(0, str(Path(__file__).parent))
gc.disable()  # trees of pages stay to the end: looking through them for garbage takes a quarter of all time

project = "hybrid-fmu"
author = "the authors of hybrid-fmu"
release = version = hybrid_model.__version__
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "numpydoc",
    "matplotlib.sphinxext.plot_directive",
    "site_parts.formulas",
    "site_parts.model_entry",
    "site_parts.page_links",
    "site_parts.public_names",
]

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # notebooks keep their outputs, and tests run them

# Members are listed by autodoc, once.
numpydoc_show_class_members = False
default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # numpydoc sections have them in words

plot_pre_code = """
import matplotlib.pyplot as plt
import numpy as np
import hybrid_model as hm
from hybrid_model import plots
from hybrid_model.models import *
"""
plot_include_source = True
plot_html_show_formats = False
plot_html_show_source_link = False
plot_formats = [("png", 120)]
plot_rcparams = {**JOURNAL, "figure.figsize": (5.4, 2.6)}
plot_apply_rcparams = True

html_theme = "furo"
html_title = "hybrid-fmu"
html_show_copyright = False
html_math_renderer = "drawings"
html_show_sourcelink = False
html_copy_source = False
