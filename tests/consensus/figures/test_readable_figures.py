"""Figures that say what they show: bounds that hold, two events that stay two, up to 100 agents, every form of file."""

import shutil
import subprocess
import tomllib
from functools import partial
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import pytest
from certified import coarse
from PIL import Image

import hybrid_model as hm
from hybrid_model.consensus import closed_loop, load_scenario, read_scenario, run_report
from hybrid_model.consensus.certificates.certify import certify
from hybrid_model.consensus.certificates.forms import Form
from hybrid_model.consensus.figures import animation
from hybrid_model.consensus.figures.animation import save_animation
from hybrid_model.consensus.figures.details import MOST_AXES, plot_gaps_against_bounds
from hybrid_model.consensus.figures.run import certified_curves, plot_broadcasts, plot_edge_norm
from hybrid_model.consensus.figures.style import PAGE, height_of, in_column, row_step, save_figures
from hybrid_model.consensus.runs.report import edge_norm
from hybrid_model.consensus.scenario.files import scenario_entries
from hybrid_model.errors import DataError
from hybrid_model.plots import JOURNAL, plot_raster

TEX = list(filter(shutil.which, ("xelatex", "pdflatex", "lualatex")))


@pytest.fixture(scope="module")
def paper():
    scenario = load_scenario("paper-a")
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    return scenario, arc, certify(scenario, arc)


@pytest.fixture
def ax():
    with plt.rc_context(JOURNAL):
        figure, axes = plt.subplots(figsize=(5.1, 2.5))
        yield axes
        plt.close(figure)


def test_bounds_from_the_start_on_hold_along_the_run(paper, ax):
    scenario, arc, found = paper
    t = np.linspace(0.0, scenario.stop_time, 2001)
    norm = edge_norm(scenario, np.array([arc.at(f"agent{i}.x", t) for i in (1, 2, 3, 4)]))
    curves = certified_curves(found, t)
    assert list(curves) == [Form.EXACT, Form.ENERGY]
    assert (norm <= curves[Form.EXACT]).all()
    assert (curves[Form.EXACT] <= curves[Form.ENERGY]).all()
    # They say something: at the end the exact one is less than a tenth of where the run began.
    assert curves[Form.EXACT][-1] < 0.1 * norm[0]
    plot_edge_norm(scenario, arc, ax=ax, found=found)
    assert [text.get_text() for text in ax.get_legend().get_texts()][1:] == ["exact bound", "energy bound"]


def test_edge_states_that_grow_at_first_stay_below_what_is_drawn():
    """Two edges of weights far apart: the fast one relaxes by moving the slow one."""
    toml = """
        name = "apart"
        stop_time = 2.0
        network = { agents = 3, edges = [[1, 2], [2, 3]], initial = [0.0, 3.0, 4.0] }
        weights = { kind = "constant", value = [0.01, 10.0] }
        trigger = { kind = "static", threshold = 1e-4 }
    """
    scenario = read_scenario(tomllib.loads(toml))
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    t = np.linspace(0.0, scenario.stop_time, 201)
    norm = edge_norm(scenario, np.array([arc.at(f"agent{i}.x", t) for i in (1, 2, 3)]))
    assert norm.max() > 1.05 * norm[0]
    curves = certified_curves(certify(scenario), t)
    assert list(curves) == [Form.EXACT, Form.ENERGY]
    for values in curves.values():
        assert (norm <= values).all()


def test_weights_without_a_period_have_the_bounds_that_there_are(ax):
    entries, _ = scenario_entries("paper-a")
    drawn = {"kind": "random-dwell", "active": [[1, 2], [2, 3], [1, 3]], "shortest": 0.3, "longest": 0.9, "seed": 5}
    scenario = read_scenario({**entries, "stop_time": 10.0, "switching": drawn})
    arc = hm.simulate(closed_loop(scenario), scenario.stop_time)
    found = coarse(scenario, arc)
    assert found.value("rate", "floquet") is None
    plot_edge_norm(scenario, arc, ax=ax, found=found)
    told = [text.get_text() for text in ax.get_legend().get_texts()]
    assert "exact bound" in told


def test_two_broadcasts_a_tenth_of_a_second_apart_stay_two(ax):
    """On an axis of 50 s, where their lines would touch: they stand in different halves of the row."""
    ax.set_xlim(0.0, 50.0)
    plot_raster({"a": [10.0, 10.1, 30.0], "b": [5.0]}, ax=ax)
    segments = [np.array(s) for s in ax.collections[0].get_segments()]
    spans = [sorted(s[:, 1]) for s in segments]
    assert spans[0][0] > spans[1][1] or spans[1][0] > spans[0][1]
    assert spans[2] == [-0.35, 0.35]
    assert sorted(ax.collections[0].get_positions()) == [10.0, 10.1, 30.0]
    figure = ax.figure
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())[..., 0]
    (x0, y), (x1, _) = ax.transData.transform([(9.5, 0.0), (10.6, 0.0)])
    rows = pixels[pixels.shape[0] - int(y) - 6 : pixels.shape[0] - int(y) + 7, int(x0) : int(x1) + 1]
    assert (rows.min(axis=1) == 255).any()  # a white line between both


@pytest.mark.parametrize("agents", [4, 30, 100])
def test_rows_have_room_for_their_names(agents, ax):
    height = height_of(agents)
    assert height <= PAGE[1]
    ax.figure.set_size_inches(5.1, height)
    scenario = Named(type("Network", (), {"agents": agents}))
    plot_broadcasts(scenario, [[1.0, 2.0]] * agents, ax)
    ax.figure.canvas.draw()
    boxes = [label.get_window_extent() for label in ax.get_yticklabels()]
    assert len(boxes) == -(-agents // row_step(agents, 0.8 * height))
    assert all(not a.overlaps(b) for a, b in pairwise(boxes))


class Named:
    """As much of a scenario as a raster needs."""

    name, stop_time = "many", 10.0

    def __init__(self, network):
        self.network = network


def test_many_agents_have_one_entry_in_a_legend(ax):
    scenario = Named(type("Network", (), {"agents": 30}))
    plot_gaps_against_bounds(scenario, [[1.0, 2.0, 4.0]] * 30, {"valid": 0.1, "exact": 0.5}, ax)
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["30 agents", "valid bound", "exact bound"]
    low, high = ax.get_ylim()
    assert low < 0.1 < 0.5 < high
    assert MOST_AXES < 30


@pytest.mark.parametrize("form", ["png", "pdf", "svg"])
def test_forms_of_figures(form, tmp_path):
    (path,) = save_figures({"a": lambda: plt.subplots()[0]}, tmp_path, [form])
    assert path.name == f"a.{form}"
    start = {"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[form]
    assert path.read_bytes().startswith(start)


@pytest.mark.skipif(not TEX, reason="apt-get install texlive-latex-recommended texlive-pictures: figures as PGF")
def test_figures_as_pgf_go_into_a_document(paper, tmp_path):
    scenario, arc, _ = paper
    draw = in_column(partial(plot_broadcasts, scenario, run_report(scenario, arc).event_times))
    (path,) = save_figures({"a": draw}, tmp_path, ["pgf"])
    assert "agent 4" in path.read_text()
    (tmp_path / "b.tex").write_text(
        r"\documentclass{article}\usepackage{pgf}\def\mathdefault#1{#1}\begin{document}\input{a.pgf}\end{document}"
    )
    call = [TEX[0], "-interaction=nonstopmode", "-halt-on-error", "b.tex"]
    subprocess.run(call, cwd=tmp_path, check=True, capture_output=True, timeout=120)
    assert (tmp_path / "b.pdf").read_bytes().startswith(b"%PDF")


def test_without_tex_there_is_no_pgf(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(DataError, match=r"a figure as PGF needs TeX.*: install one, or leave pgf out"):
        save_figures({"a": plt.figure}, tmp_path, ["pgf"])
    # One that ends at once, as TeX does where a package is missing.
    (tmp_path / "pdflatex").write_text("#!/bin/sh\necho '! LaTeX Error: File pgf.sty not found.'\nexit 1\n")
    (tmp_path / "pdflatex").chmod(0o755)
    # A preamble of its own: matplotlib keeps the TeX that has measured before.
    says = "cannot be written, since pdflatex says: .+[.] Remedy: install LaTeX's package pgf"
    with plt.rc_context({"pgf.preamble": "% none"}), pytest.raises(DataError, match=says):
        save_figures({"a": lambda: plt.subplots()[0]}, tmp_path, ["pgf"])


def test_other_forms_are_refused(tmp_path):
    with pytest.raises(DataError, match="figures are written as png, pdf, svg, pgf, and not as 'bmp'"):
        save_figures({"a": plt.figure}, tmp_path, ["bmp"])


def test_a_film_flashes_at_broadcasts(paper, tmp_path):
    """Five frames over 0.4 s: agent 2 broadcasts at 0.187 s and 0.291 s, agent 3 at 0.229 s."""
    scenario, arc, _ = paper
    done = []
    path = save_animation(
        scenario,
        arc.restrict(t=(0.0, 0.4)),
        tmp_path / "a.gif",
        seconds=1.0,
        frames_per_second=5,
        progress=lambda k, n: done.append((k, n)),
    )
    with Image.open(path) as film:
        assert film.n_frames == 5
        frames = []
        for k in range(5):
            film.seek(k)
            frames.append(np.asarray(film.convert("RGB"), dtype=int)[:, :250])
    assert done == [(k, 5) for k in range(5)]
    glow = [int((np.abs(f - [0xE6, 0x9F, 0x00]).sum(axis=2) < 60).sum()) for f in frames]
    assert glow[0] == glow[1]
    assert glow[2] > glow[1] + 20
    assert [p.name for p in tmp_path.iterdir()] == ["a.gif"]


def test_films_of_other_kinds_are_refused(paper, tmp_path, monkeypatch):
    scenario, arc, _ = paper
    monkeypatch.setattr(animation.writers, "is_available", lambda name: False)
    for name, sentence in (("a.avi", "a film is a .gif or an .mp4"), ("a.mp4", "needs ffmpeg.*or write a .gif")):
        with pytest.raises(DataError, match=sentence):
            save_animation(scenario, arc, tmp_path / name)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="apt-get install ffmpeg: films as MP4")
def test_a_film_as_mp4_has_its_frames(paper, tmp_path):
    scenario, arc, _ = paper
    path = save_animation(scenario, arc.restrict(t=(0.0, 0.4)), tmp_path / "a.mp4", seconds=1.0, frames_per_second=5)
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    call = [shutil.which("ffmpeg"), "-v", "error", "-i", str(path), *raw]
    shown = subprocess.run(call, check=True, capture_output=True, timeout=120).stdout
    frames = np.frombuffer(shown, dtype=np.uint8).reshape(5, 320, 720, 3).astype(int)[:, :, :250]
    glow = [int((np.abs(f - [0xE6, 0x9F, 0x00]).sum(axis=2) < 60).sum()) for f in frames]
    assert glow[2] > glow[1] + 20
