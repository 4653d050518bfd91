"""A run as a moving picture: the graph with its edges lit by their weights, agents flashing at broadcasts, states."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib.pyplot as plt
import networkx as nx
import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter, writers
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from hybrid_model.consensus.figures.run import plot_states
from hybrid_model.consensus.laws.closed_loop import agent_name
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.declare.variables import FloatArray
from hybrid_model.errors import DataError
from hybrid_model.plots import JOURNAL
from hybrid_model.record.arc import HybridArc

__all__ = ["require_film", "save_animation"]

ENDINGS = (".gif", ".mp4")
GLOW = 0.35
"""Time in s of the film that an agent glows after a broadcast."""
MOST_IN_CIRCLE = 12
"""Agents that stand in a circle."""
MOST_NUMBERS = 30
"""Agents that have their numbers."""


def require_film(path: Path) -> None:
    """Refuse a file that no film can be written to.

    Raises
    ------
    DataError
        For another ending than that of a film, or an MP4 without ffmpeg.
    """
    if path.suffix.lower() not in ENDINGS:
        raise DataError(f"{path} ends in {path.suffix!r}: a film is a .gif or an .mp4; give one of these endings.")
    if path.suffix.lower() == ".mp4" and not writers.is_available("ffmpeg"):
        raise DataError(f"{path} needs ffmpeg, which is not there: install it, or write a .gif.")


def save_animation(
    scenario: Scenario,
    arc: HybridArc,
    path: str | Path,
    *,
    seconds: float = 10.0,
    frames_per_second: int = 15,
    progress: Callable[[int, int], object] | None = None,
) -> Path:
    """Write a run as a GIF or an MP4.

    Left the graph: an edge is as dark and wide as its weight, an agent has the colour of its state, and a ring that
    fades round it after each broadcast. Right the states, up to now.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    arc : HybridArc
        Its run.
    path : str or Path
        Ends in ``.gif``, or ``.mp4``, which needs ffmpeg.
    seconds : float
        Length of the film in s.
    frames_per_second : int
        Pictures in a second of it.
    progress : callable, optional
        Called with the number of frames that are drawn, and of all.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    DataError
        For another ending, or an MP4 without ffmpeg.
    """
    path = Path(path)
    require_film(path)
    with plt.rc_context(JOURNAL | {"figure.constrained_layout.use": False}):
        figure, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.2), width_ratios=(1.0, 1.3))
        try:
            times = np.linspace(float(arc.t[0]), float(arc.t[-1]), max(2, round(seconds * frames_per_second)))
            graph = _Graph(scenario, arc, times, left, glow=GLOW * (times[-1] - times[0]) / seconds)
            plot_states(scenario, arc, right)
            now = right.axvline(times[0], color="k", linewidth=0.8)
            figure.subplots_adjust(left=0.01, right=0.98, bottom=0.16, top=0.82, wspace=0.18)

            def draw(frame: int) -> list[Artist]:
                graph.draw(frame)
                now.set_xdata([times[frame], times[frame]])
                return []

            film = FuncAnimation(figure, draw, frames=len(times), blit=False)
            _write(film, path, frames_per_second, progress)
        finally:
            plt.close(figure)
    return path


class _Graph:
    """The graph of a network at the times of the frames of a film."""

    def __init__(self, scenario: Scenario, arc: HybridArc, times: FloatArray, ax: Axes, *, glow: float) -> None:
        names = [agent_name(i) for i in range(1, scenario.network.agents + 1)]
        self._ax, self._times, self._glow = ax, times, glow
        self._states = np.array([arc.at(f"{name}.x", times) for name in names])
        self._events = [arc.event_times(f"{name}.trigger.broadcast") for name in names]
        self._weights = np.array([scenario.edge_weights.value(float(t)) for t in times])
        self._largest = float(self._weights.max()) or 1.0
        self._size = min(260.0, 4000.0 / len(names))
        at = _places(scenario)
        self._lines = LineCollection([(at[a - 1], at[b - 1]) for a, b in scenario.network.edges], zorder=1)
        ax.add_collection(self._lines)
        self._rings = ax.scatter(at[:, 0], at[:, 1], s=self._size, facecolor="#e69f00", edgecolor="none", zorder=2)
        low, high = float(self._states.min()), float(self._states.max()) or 1.0
        self._nodes = ax.scatter(
            at[:, 0],
            at[:, 1],
            s=self._size,
            c=self._states[:, 0],
            cmap="viridis",
            vmin=low,
            vmax=high,
            edgecolor="k",
            zorder=3,
        )
        if len(names) <= MOST_NUMBERS:
            for k, (x, y) in enumerate(at):
                ax.text(x, y, f"{k + 1}", ha="center", va="center", fontsize=7, color="w", zorder=4)
        ax.set(xlim=(-1.35, 1.35), ylim=(-1.35, 1.35), aspect="equal")
        ax.axis("off")

    def draw(self, frame: int) -> None:
        """Show it as it is in a frame, counted from 0."""
        t, part = self._times[frame], self._weights[frame] / self._largest
        self._lines.set_color([(0.1, 0.1, 0.1, 0.08 + 0.92 * w) for w in part])
        self._lines.set_linewidth(0.6 + 4.0 * part)
        self._nodes.set_array(self._states[:, frame])
        since = [t - e[e <= t][-1] if (e <= t).any() else np.inf for e in self._events]
        bright = np.clip(1.0 - np.array(since) / self._glow, 0.0, 1.0)
        self._rings.set_sizes(self._size * (1.0 + 3.0 * bright))
        self._rings.set_alpha(bright.tolist())
        self._ax.set_title(f"$t$ = {t:.2f} s", fontsize=9)


def _places(scenario: Scenario) -> FloatArray:
    """Return where agents are drawn, shape (agents, 2)."""
    agents = range(scenario.network.agents)
    graph = nx.Graph()
    graph.add_nodes_from(agents)
    graph.add_edges_from((a - 1, b - 1) for a, b in scenario.network.edges)
    places = nx.circular_layout(graph) if len(agents) <= MOST_IN_CIRCLE else nx.spring_layout(graph, seed=1)
    return np.array([places[k] for k in agents])


def _write(
    film: FuncAnimation, path: Path, frames_per_second: int, progress: Callable[[int, int], object] | None
) -> None:
    """Write a film: whole, or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    kind = PillowWriter if path.suffix.lower() == ".gif" else FFMpegWriter
    part = path.with_name(f".part-{path.name}")
    try:
        film.save(part, writer=kind(fps=frames_per_second), dpi=100, progress_callback=progress)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
