"""Figures of a scenario's run: states, edge norm with its bounds, error against threshold, broadcasts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from hybrid_model.consensus.certificates.certify import Certificates
from hybrid_model.consensus.certificates.envelopes import slowest_decay
from hybrid_model.consensus.certificates.forms import Form, Quantity
from hybrid_model.consensus.certificates.tree_bound import ConvergenceBound
from hybrid_model.consensus.figures.style import (
    DASHES,
    FORMS,
    MARKER,
    agent_color,
    agent_look,
    agent_mark,
    in_column,
    legend_above,
    over_time,
    row_step,
    save_figures,
)
from hybrid_model.consensus.graphs.undirected import incidence
from hybrid_model.consensus.laws.closed_loop import agent_name
from hybrid_model.consensus.runs.metrics import disagreement
from hybrid_model.consensus.runs.report import edge_norm
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import Trigger
from hybrid_model.declare.variables import FloatArray
from hybrid_model.plots import COLORS, curve, new_axes, plot_raster
from hybrid_model.record.arc import HybridArc

__all__ = ["plot_broadcasts", "plot_edge_norm", "plot_error_against_threshold", "plot_states", "save_paper_figures"]


FAR = 100.0
"""A bound that is always so many times the largest value of the run says nothing in a figure."""
_EDGE_LINES = {Form.EXACT: DASHES[2], Form.ENERGY: DASHES[1]}


def plot_states(scenario: Scenario, arc: HybridArc, ax: Axes | None = None) -> Axes:
    """Draw the agents' states, with a dot at each broadcast (paper, figures 3 and 5).

    Parameters
    ----------
    scenario : Scenario
        What ran.
    arc : HybridArc
        Its run.
    ax : Axes, optional
        Where to draw.
    """
    ax = new_axes(ax)
    n = scenario.network.agents
    for i in range(1, n + 1):
        name = agent_name(i)
        # With more agents than colours a legend could not tell them apart.
        label, width = (f"$x_{{{i}}}$", 1.0) if n <= len(COLORS) else (None, 0.6)
        ax.plot(*curve(arc, f"{name}.x"), **agent_look(i), linewidth=width, label=label)
        times = arc.event_times(f"{name}.trigger.broadcast")
        if times.size:  # an empty line counts as a point in the corner when figures are cropped
            ax.plot(times, arc.at(f"{name}.x", times), clip_on=False, **agent_mark(i, n))
    mean = float(np.mean(scenario.network.initial))
    ax.axhline(mean, color="0.5", linewidth=0.6, linestyle=(0, (4, 3)), zorder=0, label="mean")
    ax.set_ylabel("states $x_i$")
    over_time(ax, scenario)
    many = [Line2D([], [], color="0.3", label=f"{n} agents")] if n > len(COLORS) else []
    legend_above(ax, [*many, Line2D([], [], color="0.3", label="broadcast", **MARKER)], handlelength=2.0)
    return ax


def plot_edge_norm(
    scenario: Scenario,
    arc: HybridArc,
    bounds: Sequence[ConvergenceBound] = (),
    ax: Axes | None = None,
    *,
    found: Certificates | None = None,
) -> Axes:
    """Draw the norm of the edge states with its bounds, on a logarithmic axis (paper, figures 4 and 6).

    Of what is certified `certified_curves` are drawn; those and bounds along a tree that lie far above the run are
    words in the legend.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    arc : HybridArc
        Its run.
    bounds : sequence of ConvergenceBound
        The legend says which of them do not hold for the scenario; their notes say why.
    ax : Axes, optional
        Where to draw.
    found : Certificates, optional
        Of the scenario.
    """
    ax = new_axes(ax)
    times, first = curve(arc, f"{agent_name(1)}.x")
    others = [curve(arc, f"{agent_name(i)}.x")[1] for i in range(2, scenario.network.agents + 1)]
    norm = edge_norm(scenario, np.array([first, *others]))
    ax.semilogy(times, norm, color="k", label=r"$\|x_e(t)\|$")
    grid = np.linspace(0.0, scenario.stop_time, 300)
    curves = certified_curves(found, grid)
    words = ["no certified bound"] if found is not None and not curves else []
    drawn: dict[str, tuple[FloatArray, dict[str, Any]]] = {
        form: (values, {"color": FORMS[form]["color"], "linestyle": _EDGE_LINES[form]})
        for form, values in curves.items()
    }
    for bound in bounds:
        if bound.kappa2 is None:
            words.append(f"no {bound.form.value} bound")
        else:
            look = {key: FORMS[bound.form.value][key] for key in ("color", "linestyle")}
            drawn[bound.form.value] = bound.at(grid), look
    for form, (values, look) in drawn.items():
        if found is not None and values.min() > FAR * norm.max():
            words.append(rf"{form} bound $> 10^{{{int(np.log10(values.min()))}}}$")
        else:
            ax.semilogy(grid, values, **look, label=f"{form} bound")
    ax.set_ylabel(r"norm of edge states $\|x_e\|$")
    over_time(ax, scenario)
    legend_above(ax, [Line2D([], [], linestyle="none", label=text) for text in words])
    return ax


def certified_curves(found: Certificates | None, t: FloatArray) -> dict[Form, FloatArray]:
    """Return the bounds on ``||x_e(t)||`` that hold from the start on, by the form of their radius.

    What a start leaves is at most ``m exp(-rate t) ||D'|| ||xi(0)||``, with Floquet's rate and its factor m or the
    improved ones, which are factors of the norm of xi: the norm of x_e itself may grow at first. What errors do from
    the start on is at most the exact radius, or that by energy, with the decay of the threshold (docs/paper-audit.md,
    sections 3, 5.3 and 7).

    Parameters
    ----------
    found : Certificates, optional
        Of a scenario; without one, or where it lacks a number, there is no bound.
    t : array, shape (n,)
        Times in s.

    Returns
    -------
    dict of Form to array, shape (n,)
        By superposition: what the start leaves, and what the errors do.
    """
    if found is None:
        return {}
    network = found.scenario.network
    start = np.linalg.norm(incidence(network.agents, network.underlying_edges), 2) * disagreement(
        np.array(network.initial)
    )
    left = np.full(len(t), np.inf)
    for form in (Form.FLOQUET, Form.IMPROVED):
        rate, factor = (found.value(quantity, form) for quantity in (Quantity.RATE, Quantity.TRANSIENT))
        if rate is not None and factor is not None:
            left = np.minimum(left, factor * start * np.exp(-rate * t))
    if not np.isfinite(left).all():
        return {}
    decay = slowest_decay(found.scenario)
    radii = {form: found.value(Quantity.RADIUS, form) for form in (Form.EXACT, Form.ENERGY)}
    return {form: left + radius * np.exp(-decay * t) for form, radius in radii.items() if radius is not None}


def plot_error_against_threshold(scenario: Scenario, arc: HybridArc, agent: int, ax: Axes | None = None) -> Axes:
    """Draw one agent's error ``|xhat - x|`` and the threshold it may not pass, with a dot at each broadcast.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    arc : HybridArc
        Its run.
    agent : int
        Number of the agent, counted from 1.
    ax : Axes, optional
        Where to draw.

    Raises
    ------
    ValueError
        If there is no such agent.
    """
    if not 1 <= agent <= scenario.network.agents:
        raise ValueError(
            f"there is no agent {agent} in {scenario.name}: its agents are 1 to {scenario.network.agents}."
        )
    ax = new_axes(ax)
    name, color = agent_name(agent), agent_color(agent)
    times, x = curve(arc, f"{name}.x")
    _, broadcast = curve(arc, f"{name}.broadcast")
    error = rf"$|\hat{{x}}_{{{agent}}} - x_{{{agent}}}|$"
    ax.plot(times, np.abs(broadcast - x), color=color, label=error)
    grid = np.linspace(0.0, scenario.stop_time, 300)
    ax.plot(grid, scenario.trigger.level(grid), color="k", linestyle=DASHES[0], label=_threshold(scenario.trigger))
    events = arc.event_times(f"{name}.trigger.broadcast")
    if events.size:
        reached = np.abs(arc.at(f"{name}.broadcast", events, before=True) - arc.at(f"{name}.x", events))
        ax.plot(events, reached, color=color, label="broadcast", clip_on=False, **MARKER)
    ax.set_ylim(bottom=0.0)
    ax.set_ylabel(f"error of agent {agent}")
    over_time(ax, scenario)
    legend_above(ax)
    return ax


def _threshold(trigger: Trigger) -> str:
    decaying = r"\,e^{-\beta t}" if trigger.decay > 0 else ""
    return f"threshold $c_0 + c_1{decaying}$" if trigger.offset > 0 else f"threshold $c{decaying}$"


def plot_broadcasts(scenario: Scenario, event_times: Sequence[npt.ArrayLike], ax: Axes | None = None) -> Axes:
    """Draw who broadcasts when: one row an agent, with the number of its broadcasts at the right.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    event_times : sequence of array_like
        Times in s of each agent's broadcasts, each of shape ``(number of them,)``, as in `RunReport.event_times`; of a
        co-simulation as well.
    ax : Axes, optional
        Where to draw.

    Raises
    ------
    ValueError
        If there is not one row of times for each agent.
    """
    if len(event_times) != scenario.network.agents:
        raise ValueError(
            f"{len(event_times)} rows of broadcast times for the {scenario.network.agents} agents of {scenario.name}: "
            "give one row an agent."
        )
    rows = {f"agent {i}": np.asarray(times, dtype=float) for i, times in enumerate(event_times, start=1)}
    ax = new_axes(ax)
    ax.set_xlim(0.0, scenario.stop_time)
    ax = plot_raster(rows, ax=ax)
    figure = ax.get_figure(root=True)
    assert figure is not None
    step = row_step(len(rows), 0.8 * figure.get_size_inches()[1])
    ax.set_yticks(range(0, len(rows), step), list(rows)[::step])
    for i, (collection, times) in enumerate(zip(ax.collections, rows.values(), strict=True), start=1):
        collection.set_color(agent_color(i))
        if (i - 1) % step == 0:
            ax.text(1.02, i - 1, f"{len(times)}", transform=ax.get_yaxis_transform(), va="center", fontsize="small")
    ax.text(1.06, 1.0, "broadcasts", transform=ax.transAxes, ha="right", va="bottom", fontsize="small")
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.tick_params(axis="y", length=0)
    over_time(ax, scenario)
    legend_above(ax)
    return ax


def save_paper_figures(
    kind: str,
    scenario: Scenario,
    arc: HybridArc,
    bounds: Sequence[ConvergenceBound],
    folder: Path,
    found: Certificates | None = None,
    formats: Sequence[str] = ("png", "pdf"),
) -> list[Path]:
    """Write the two figures of one trigger.

    Parameters
    ----------
    kind : str
        Name of the trigger, for the file names.
    scenario, arc, bounds, found
        As in `plot_edge_norm`.
    folder : Path
        Where to write.
    formats : sequence of str
        Out of png, pdf, svg, pgf.

    Returns
    -------
    list of Path
        The files written.
    """
    figures = {
        f"{kind}_states": in_column(lambda ax: plot_states(scenario, arc, ax)),
        f"{kind}_edge_norm": in_column(lambda ax: plot_edge_norm(scenario, arc, bounds, ax, found=found), 1.25),
    }
    return save_figures(figures, folder, formats)
