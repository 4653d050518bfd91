"""Every notebook runs from top to bottom in the tests' interpreter, shows what it says, and is committed clean."""

import json
import re
import sys
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

import hybrid_model as hm

FOLDER = Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
KERNEL = "this-interpreter"
# A cell takes seconds; a busy machine may take many times that, a hanging FMU for ever.
SECONDS_PER_CELL = 300
NUMBER = r"([-+0-9.e]+)"


@pytest.fixture
def jupyter(tmp_path, monkeypatch):
    """A Jupyter set-up of its own whose kernel is the interpreter of the tests; nothing of the user's is read."""
    spec = tmp_path / "jupyter" / "kernels" / KERNEL
    spec.mkdir(parents=True)
    command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    (spec / "kernel.json").write_text(
        json.dumps({"argv": command, "display_name": KERNEL, "language": "python"}), encoding="utf-8"
    )
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path / "jupyter"))
    for variable in ("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "IPYTHONDIR"):
        monkeypatch.setenv(variable, str(tmp_path / variable.lower()))
    # Figures must be shown as a reader sees them, whatever the tests draw with.
    monkeypatch.delenv("MPLBACKEND", raising=False)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    return temporary


def outputs(notebook):
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


def printed(notebook):
    return "".join(o.text for o in outputs(notebook) if o.output_type == "stream" and o.name == "stdout")


def figures(notebook):
    return [o for o in outputs(notebook) if "image/png" in o.get("data", {})]


def numbers(pattern, text):
    """The number in each match of the pattern, which has one NUMBER."""
    return [float(match) for match in re.findall(pattern, text)]


def check_from_automaton_to_cosimulation(notebook):
    text = printed(notebook)
    # Both the Python run and the co-simulation of the FMUs: published reference values of scenario A.
    assert numbers(rf"events +{NUMBER}\n", text) == [35, 35]
    assert re.findall(r"per agent  \[(.*)\]", text) == ["4, 10, 13, 8"] * 2
    # The limits that the three executions must agree within.
    (times,) = numbers(rf"broadcast times differ from the Python run by at most {NUMBER} s", text)
    assert times < 1e-7
    heights = numbers(rf"largest difference of h to the Python run: {NUMBER} m", text)
    assert len(heights) == 2
    assert max(heights) < 1e-8
    # The closed-form times of the ball: first impact and accumulation of impacts.
    assert numbers(rf" 1  {NUMBER} ", text)[0] == pytest.approx(np.sqrt(2 / 9.81), abs=1e-8)
    (accumulation,) = numbers(rf"accumulate at t = {NUMBER} s", text)
    assert "ZENO" in text
    assert accumulation == pytest.approx(np.sqrt(2 / 9.81) * 1.7 / 0.3, abs=1e-3)
    # What the last section says: a fixed step is worse by many orders of magnitude.
    (exact,) = numbers(rf"event-exact .*\]  +{NUMBER}", text)
    fixed = numbers(rf"fixed step .*\]  +{NUMBER}", text)
    assert exact < 1e-8
    assert len(fixed) == 2
    assert min(fixed) > 1e-3
    assert len(figures(notebook)) == 7


def check_hybrid_arcs(notebook):
    text = printed(notebook)
    # Impacts of the ball in closed form; each is printed with both sides and both jump counts.
    flights = np.sqrt(2 / 9.81) * np.array([1.0, *(2.0 * 0.7 ** np.arange(1, 4))])
    impacts = re.findall(rf"\({NUMBER}, (\d+)\)  ->  \({NUMBER}, (\d+)\)  +{NUMBER} +{NUMBER}\n", text)
    assert [float(row[0]) for row in impacts] == pytest.approx(np.cumsum(flights), abs=1e-9)  # nine digits are printed
    for k, (t, j, same_t, next_j, before, after) in enumerate(impacts):
        assert (same_t, int(j), int(next_j)) == (t, k, k + 1)
        assert float(after) == pytest.approx(-0.7 * float(before), abs=1e-5)  # five digits are printed
    # The limit on what the thermostat's period may be off by: located to a few ulp of t, at 0.14 K/s or more.
    (off,) = numbers(rf"off by at most {NUMBER} s", text)
    assert off < 1e-10
    assert "priority JUMP  jumps at [1. 2. 3. 4. 5. 6.] s" in text
    assert "priority FLOW  jumps at [2. 4. 6.] s" in text
    (accumulation,) = numbers(rf"accumulate at t = {NUMBER} s", text)
    (exact,) = numbers(rf"exact: t\* = {NUMBER} s", text)
    assert exact == pytest.approx(np.sqrt(2 / 9.81) * 1.7 / 0.3, abs=1e-9)
    # The guard ends the run with a rest of the geometric series below 1e-6 s.
    assert accumulation == pytest.approx(exact, abs=1e-6)
    assert all(words in text for words in ("ZENO", hm.Stop.ZENO.value))
    assert "per agent  [4, 10, 13, 8]" in text
    bound, shortest = re.findall(rf"lower bound {NUMBER} s, .* {NUMBER} s", text)[0]
    assert 0.0 < float(bound) < float(shortest)
    assert len(figures(notebook)) == 8


CHECKS = {
    "from_automaton_to_cosimulation": check_from_automaton_to_cosimulation,
    "hybrid_arcs": check_hybrid_arcs,
}


def test_every_notebook_has_a_check():
    assert {path.stem for path in NOTEBOOKS} == set(CHECKS)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_committed_without_outputs(path):
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    assert outputs(notebook) == []
    assert {cell.execution_count for cell in notebook.cells if cell.cell_type == "code"} == {None}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_and_shows_what_it_says(path, jupyter, tmp_path):
    notebook = nbformat.read(path, as_version=4)
    work = tmp_path / "work"
    work.mkdir()
    client = NotebookClient(
        notebook,
        timeout=SECONDS_PER_CELL,
        startup_timeout=SECONDS_PER_CELL,
        kernel_name=KERNEL,
        resources={"metadata": {"path": str(work)}},
    )
    client.execute()  # raises if a cell fails
    assert not [o for o in outputs(notebook) if o.output_type == "error" or o.get("name") == "stderr"]
    CHECKS[path.stem](notebook)
    assert list(work.iterdir()) == []
    assert list(jupyter.iterdir()) == []
