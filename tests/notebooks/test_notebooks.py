"""Every notebook agrees with its script, runs, shows what it says and what is kept in the file, and leaves nothing."""

import re

import jupytext
import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from notebook_run import FOLDER, SCRIPTS, run

NUMBER = r"([-+0-9.e]+)"


def name_of(path):
    return path.stem


def printed(notebook):
    return [
        "".join(output.text for output in cell.outputs if output.output_type == "stream")
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def figures(notebook):
    return [
        sum("image/png" in output.get("data", {}) for output in cell.outputs)
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def words(text):
    """A text without its numbers, which may differ in their last digits from machine to machine, and without paths."""
    return re.sub(r"\s+", " ", re.sub(r"np\.float64|/\S+|[-+]?\d[\d.]*(?:e[-+]?\d+)?j?", "#", text))


def numbers(pattern, text):
    """The number in each match of the pattern, which has one NUMBER."""
    return [float(match) for match in re.findall(pattern, text)]


def check_automata_from_scratch(text):
    flights = np.sqrt(2 / 9.81) * np.array([1.0, *(2.0 * 0.7 ** np.arange(1, 4))])
    impacts = re.findall(rf"\({NUMBER}, (\d+)\)  ->  \({NUMBER}, (\d+)\)  +{NUMBER} +{NUMBER}\n", text)
    assert [float(row[0]) for row in impacts] == pytest.approx(np.cumsum(flights), abs=1e-9)  # nine digits are printed
    for k, (t, j, same_t, next_j, before, after) in enumerate(impacts):
        assert (same_t, int(j), int(next_j)) == (t, k, k + 1)
        assert float(after) == pytest.approx(-0.7 * float(before), abs=1e-5)  # five digits are printed
    assert numbers(rf"the run is off by {NUMBER} s", text)[0] < 1e-12  # rounding at 60 s
    assert "priority JUMP  jumps at [1. 2. 3. 4. 5. 6.] s" in text
    assert "priority FLOW  jumps at [2. 4. 6.] s" in text
    accumulation, exact = (
        *numbers(rf"accumulate at t = {NUMBER} s", text),
        *numbers(rf"exact: t\* = {NUMBER} s", text),
    )
    # The guard ends the run with a rest of the geometric series below 1e-6 s.
    assert accumulation == pytest.approx(exact, abs=1e-6)
    assert "The flow chatters at t = 1 s" in text
    assert "stands from 1.000000 s to 3.000000 s" in text


def check_the_paper_end_to_end(text):
    assert "static   25 events, per agent [2, 6, 13, 4]" in text
    assert "dynamic  35 events, per agent [4, 10, 13, 8]" in text
    assert numbers(rf"event-exact +35 events \[4, 10, 13, 8\], states off by up to {NUMBER}", text)[0] < 1e-11
    assert min(numbers(rf"step \S+ s +.*\], states off by up to {NUMBER}", text)) > 1e-3
    rates = dict(re.findall(rf"^(printed|valid|improved) +{NUMBER}", text, re.M))
    assert float(rates["valid"]) < float(rates["printed"]) < float(rates["improved"])


def check_a_trigger_of_your_own(text):
    assert "native: its maps are compiled." in text
    (errors,) = re.findall(r"largest errors \[([^\]]*)\]", text)
    assert max(map(float, errors.split())) <= 0.3
    radii = dict(re.findall(rf"radius of \|\|x_e\|\|, (\w+) +{NUMBER}", text))
    assert float(radii["observed"]) < float(radii["exact"]) < float(radii["energy"]) < float(radii["improved"])
    assert "ZENO" in text
    assert re.search(r"events (\d+) in the FMU, \1 in Python", text)
    assert numbers(rf"x differs by at most {NUMBER}", text)[0] < 1e-10


def check_from_automaton_to_fmi_tools(text):
    off = numbers(rf"h off by at most {NUMBER}", text)
    assert len(off) == 5
    assert max(off) < 1e-7  # of CVode in Model Exchange; the others are at rounding
    assert sorted(off)[3] < 1e-10
    assert max(numbers(rf"event-exact: .* off by {NUMBER} s", text)) < 1e-9
    assert min(numbers(rf"a charge is off by {NUMBER}", text)) > 1e-4
    assert "0 findings" in text


def check_sweeps_and_trade_offs(text):
    assert "54 runs, 0 failed" in text
    assert "54 runs, 0 missing" in text
    assert re.search(
        r"paper-a: 35 broadcasts\n +integral of the squared disagreement +periodic agents need 120\n", text
    )
    assert min(numbers(rf"the energy bound is {NUMBER} to", text)) > 1.0


def check_edge_domain_analysis(text):
    for bound, seen in re.findall(rf"edge \d: at most {NUMBER} in the run, {NUMBER} by the peak gain", text):
        assert float(bound) <= float(seen)
    norm, incidence = re.findall(rf"H-infinity norm {NUMBER}, norm of the incidence matrix {NUMBER}\n", text)[0]
    assert norm == incidence
    assert "exact rate 0.468778 1/s" in text


CHECKS = {name.removeprefix("check_"): check for name, check in list(globals().items()) if name.startswith("check_")}


def test_every_script_has_its_notebook_and_its_check():
    assert {path.stem for path in SCRIPTS} == {path.stem for path in FOLDER.glob("*.ipynb")} == set(CHECKS)


@pytest.mark.parametrize("script", SCRIPTS, ids=name_of)
def test_a_notebook_has_the_cells_of_its_script(script):
    kept = nbformat.read(script.with_suffix(".ipynb"), as_version=4)
    nbformat.validate(kept)
    cells = [[(cell.cell_type, cell.source) for cell in notebook.cells] for notebook in (kept, jupytext.read(script))]
    assert cells[0] == cells[1]
    text = "\n".join(cell.source for cell in kept.cells if cell.cell_type == "markdown")
    assert "**What this teaches:**" in text
    assert "\n## Exercises\n" in text


@pytest.mark.parametrize("script", SCRIPTS, ids=name_of)
def test_a_notebook_runs_and_shows_what_is_kept(script, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(script)
    kept = nbformat.read(script.with_suffix(".ipynb"), as_version=4)
    assert [words(text) for text in printed(done)] == [words(text) for text in printed(kept)]
    assert figures(done) == figures(kept)
    CHECKS[script.stem]("".join(printed(done)))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
@pytest.mark.parametrize("script", SCRIPTS, ids=name_of)
def test_a_notebook_runs_in_jupyter(script, tmp_path, monkeypatch):
    work, temporary = tmp_path / "work", tmp_path / "temporary"
    work.mkdir()
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    notebook = nbformat.read(script.with_suffix(".ipynb"), as_version=4)
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(work)}}).execute()
    assert not [o for cell in notebook.cells for o in cell.get("outputs", ()) if o.output_type == "error"]
    assert list(work.iterdir()) == list(temporary.iterdir()) == []
