"""Code as a notebook runs it: cells, one after the other, that share their global names."""

import textwrap

import numpy as np

import hybrid_model as hm


class Notebook:
    """Global names, and cells that are run with them."""

    def __init__(self, *cells):
        self.names = {"__name__": "notebook", "hm": hm, "np": np}
        for cell in cells:
            self.run(cell)

    def run(self, cell):
        exec(compile(textwrap.dedent(cell), "<cell>", "exec"), self.names)

    def __getitem__(self, name):
        return self.names[name]
