"""The notebooks: scripts of cells, run in this process; what they print and draw is kept in the paired files.

`make notebooks` writes those anew: ``python tests/support/notebook_run.py``.
"""

import base64
import contextlib
import io
import os
import tempfile
from pathlib import Path

import jupytext
import matplotlib
import nbformat
from nbformat.v4 import new_output

FOLDER = Path(__file__).parents[2] / "notebooks"
SCRIPTS = sorted(FOLDER.glob("*.py"))
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


def run(script: Path):
    """Run a script of cells in the present folder and return it as a notebook with its outputs."""
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.close("all")  # of whoever ran before in this process
    notebook = jupytext.read(script)
    names, number = {"__name__": "__main__"}, 0
    with matplotlib.rc_context():
        for place, cell in enumerate(notebook.cells, start=1):
            cell.id, cell.metadata = f"cell-{place:02d}", {}
            if cell.cell_type == "code":
                number += 1
                with contextlib.redirect_stdout(io.StringIO()) as said:
                    exec(compile(cell.source, f"{script.name}, cell {place}", "exec"), names)
                cell.execution_count = number
                cell.outputs = [
                    *([new_output("stream", name="stdout", text=said.getvalue())] if said.getvalue() else []),
                    *(_shown(plt.figure(figure)) for figure in plt.get_fignums()),
                ]
                plt.close("all")
    notebook.metadata = METADATA
    return notebook


def _shown(figure):
    """A figure as a notebook shows it."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi="figure", bbox_inches="tight", metadata={"Software": None})
    return new_output("display_data", data={"image/png": base64.b64encode(picture.getvalue()).decode()})


if __name__ == "__main__":
    for script in SCRIPTS:
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            done = run(script)
            nbformat.validate(done)
            assert not os.listdir(), f"{script.name} leaves files"
        nbformat.write(done, script.with_suffix(".ipynb"))
