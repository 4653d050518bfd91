"""The picture of the interactive page as SVG, written line by line: a change of a slider is drawn in some ms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

from cosim.cli.live import Live
from hybrid_model.consensus.figures.style import MARKS, agent_color
from hybrid_model.consensus.laws.closed_loop import agent_name
from hybrid_model.consensus.runs.report import edge_norm
from hybrid_model.declare.variables import FloatArray

POINTS = 1000
LABEL = "states, broadcasts, error and edge norm of the run"
_MOST_MARKS = 300
_WIDTH, _HEIGHT = 400.0, 190.0
_DASHES = ("", "5 2", "1.5 1.5", "7 2 1.5 2")
_SHAPES = {
    "o": "M-2.6,0a2.6,2.6 0 1,0 5.2,0a2.6,2.6 0 1,0 -5.2,0z",
    "s": "M-2.4,-2.4h4.8v4.8h-4.8z",
    "D": "M0,-3.2l3.2,3.2l-3.2,3.2l-3.2,-3.2z",
    "^": "M0,-3.2l3,5.4h-6z",
}


@dataclass
class _Panel:
    """Axes at a place of the picture; what is drawn on them is kept as elements of SVG."""

    left: float
    top: float
    title: str
    end: float
    low: float
    high: float
    logarithmic: bool = False
    parts: list[str] = field(default_factory=list)

    def x(self, t: FloatArray) -> FloatArray:
        return self.left + _WIDTH * np.asarray(t) / self.end

    def y(self, value: FloatArray | Sequence[float]) -> FloatArray:
        given = np.asarray(value, dtype=float)
        low, high = self.low, self.high
        if self.logarithmic:
            given, low, high = np.log10(np.maximum(given, low * 1e-3)), math.log10(low), math.log10(high)
        share = np.clip((given - low) / (high - low), -0.02, 1.02)
        return np.asarray(self.top + _HEIGHT * (1.0 - share))

    def line(self, t: FloatArray, values: FloatArray, color: str, dashes: str = "") -> None:
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(self.x(t).tolist(), self.y(values).tolist(), strict=True))
        dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
        self.parts.append(f'<polyline points="{points}" stroke="{color}"{dashed}/>')

    def marks(self, t: FloatArray, values: FloatArray, shape: str, color: str) -> None:
        at = zip(self.x(t).tolist(), self.y(values).tolist(), strict=True)
        path = "".join(f'<path transform="translate({x:.1f},{y:.1f})" d="{shape}"/>' for x, y in at)
        self.parts.append(f'<g fill="{color}">{path}</g>')

    def ticks(self, t: FloatArray, row: float, color: str) -> None:
        """Upright strokes side by side in a row."""
        y = float(self.y([row])[0])
        path = "".join(f"M{x:.1f},{y - 12:.1f}v24" for x in self.x(t).tolist())
        self.parts.append(f'<path d="{path}" stroke="{color}"/>')

    def text(self, x: float, y: float, text: str, more: str = "") -> None:
        self.parts.append(f'<text x="{x:.1f}" y="{y:.1f}" {more}>{escape(text)}</text>')

    def framed(self, names: Sequence[tuple[float, str]], unit: str = "") -> str:
        """The panel with its frame, its title and the names of its values on the left."""
        self.text(self.left, self.top - 7, f"{self.title}{unit}", 'font-size="13"')
        for value, name in names:
            y = float(self.y([value])[0])
            self.parts.append(f'<path d="M{self.left},{y:.1f}h-4" stroke="#444"/>')
            self.text(self.left - 7, y + 3.5, name, 'text-anchor="end"')
        for t in round_values(0.0, self.end):
            x = float(self.x(np.array(t)))
            self.parts.append(f'<path d="M{x:.1f},{self.top + _HEIGHT}v4" stroke="#444"/>')
            self.text(x, self.top + _HEIGHT + 16, f"{t:g}", 'text-anchor="middle"')
        self.text(self.left + _WIDTH, self.top + _HEIGHT + 30, "time (s)", 'text-anchor="end"')
        frame = f'<rect x="{self.left}" y="{self.top}" width="{_WIDTH}" height="{_HEIGHT}" stroke="#444"/>'
        return "".join([frame, *self.parts])


def round_values(low: float, high: float) -> list[float]:
    """Round numbers between two, four to eight of them."""
    rough = (high - low) / 6.0
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(each * power for each in (1.0, 2.0, 5.0, 10.0) if each * power >= rough)
    return [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def draw(shown: Live, agent: int) -> str:
    """Return the picture of a run as an element svg.

    Parameters
    ----------
    shown : Live
        The run.
    agent : int
        Whose error is drawn, counted from 1.
    """
    end = shown.end
    t = np.linspace(0.0, end, POINTS)
    x = np.array([shown.arc.at(f"{agent_name(i)}.x", t) for i in range(1, 5)])
    panels = [_states(shown, t, x), _broadcasts(shown), _error(shown, t, agent), _norms(shown, t, x)]
    return (
        f'<svg role="img" aria-label="{LABEL}" viewBox="0 0 980 540" width="100%" style="background:white" fill="none" '
        'font-family="sans-serif" font-size="11" stroke-width="1.2" stroke-linejoin="round">'
        f"<style>svg text{{fill:#222;stroke:none}}</style>{''.join(panels)}</svg>"
    )


def _states(shown: Live, t: FloatArray, x: FloatArray) -> str:
    low, high = float(x.min()) - 0.1, float(x.max()) + 0.1
    panel = _Panel(70.0, 40.0, "states", shown.end, low, high)
    for i, times in enumerate(shown.report.event_times):
        color, shape = agent_color(i + 1), _SHAPES[MARKS[i]]
        panel.line(t, x[i], color, _DASHES[i])
        if 0 < len(times) <= _MOST_MARKS:
            panel.marks(np.array(times), shown.arc.at(f"{agent_name(i + 1)}.x", times), shape, color)
        place = panel.left + 80 + 81 * i
        panel.parts.append(
            f'<path d="M{place},29h24" stroke="{color}" stroke-dasharray="{_DASHES[i] or "none"}"/>'
            f'<path transform="translate({place + 12},29)" d="{shape}" fill="{color}"/>'
        )
        panel.text(place + 29, 33.0, f"agent {i + 1}")
    return panel.framed([(value, f"{value:.3g}") for value in round_values(low, high)])


def _broadcasts(shown: Live) -> str:
    panel = _Panel(560.0, 40.0, "broadcasts", shown.end, 4.6, 0.4)
    for i, times in enumerate(shown.report.event_times, start=1):
        panel.ticks(np.array(times), float(i), agent_color(i))
    return panel.framed([(float(i), f"agent {i}") for i in range(1, 5)])


def _error(shown: Live, t: FloatArray, agent: int) -> str:
    """The error with both sides of each broadcast, where it meets the threshold and falls to zero."""
    arc, names = shown.arc, (f"{agent_name(agent)}.broadcast", f"{agent_name(agent)}.x")
    events = np.array(shown.report.event_times[agent - 1])
    sides = [(t, False), *([(events, True), (events, False)] if len(events) else [])]
    error = np.concatenate(
        [abs(np.subtract(*(arc.at(name, times, before=before) for name in names))) for times, before in sides]
    )
    times = np.concatenate([times for times, _ in sides])
    order = np.lexsort((np.repeat(np.arange(len(sides)), [len(times) for times, _ in sides]), times))
    level = np.broadcast_to(np.asarray(shown.scenario.trigger.level(t)), t.shape)
    high = 1.1 * max(float(level.max()), float(error.max()))
    panel = _Panel(70.0, 310.0, f"error of agent {agent} against its threshold", shown.end, 0.0, high)
    panel.line(times[order], error[order], agent_color(agent))
    panel.line(t, level, "#222", "5 3")
    return panel.framed([(value, f"{value:.3g}") for value in round_values(0.0, high)])


def _norms(shown: Live, t: FloatArray, x: FloatArray) -> str:
    norm, bound = edge_norm(shown.scenario, x), shown.bound(t)
    top = float(max(norm.max(), 0.0 if bound is None else bound.max()))
    low, high = max(float(norm.min()), 1e-6 * top) / 2.0, 3.0 * top
    told = "" if bound is None else ", and bound (Floquet, energy; dashed)"
    panel = _Panel(560.0, 310.0, f"norm of edge states{told}", shown.end, low, high, logarithmic=True)
    panel.line(t, norm, "#222")
    if bound is not None:
        panel.line(t, bound, "#222", "7 2 1.5 2")
    decades = range(math.ceil(math.log10(low)), math.floor(math.log10(high)) + 1)
    return panel.framed([(10.0**power, f"{10.0**power:g}") for power in decades])
