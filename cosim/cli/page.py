"""The interactive page, a marimo notebook: `hybrid-fmu app` serves it, `marimo edit` opens it to be changed."""

import marimo

__generated_with = "0.25.2"
app = marimo.App(width="medium", app_title="hybrid-fmu")

with app.setup:
    from typing import Any


@app.cell
def _() -> tuple[Any, ...]:
    import gc
    import time

    import marimo as mo

    from cosim.cli.live import GRAPHS, PAPER, fmus, live, scenario_of
    from cosim.cli.live_picture import draw

    # What was imported stays: a change of a slider does not wait for it to be searched for garbage.
    gc.freeze()
    return GRAPHS, PAPER, draw, fmus, live, mo, scenario_of, time


@app.cell
def _(GRAPHS: Any, PAPER: Any, mo: Any) -> tuple[Any, ...]:
    graph = mo.ui.dropdown(list(GRAPHS), value=PAPER, label="graph")
    threshold = mo.ui.slider(0.05, 2.0, 0.05, value=0.5, label="threshold c", show_value=True)
    decay = mo.ui.slider(0.0, 0.3, 0.01, value=0.06, label="decay beta (1/s)", show_value=True)
    gain = mo.ui.slider(0.2, 5.0, 0.1, value=1.0, label="gain k", show_value=True)
    dwell = mo.ui.slider(1, 8, 1, value=2, label="dwell time of a topology (pi/2 s)", show_value=True)
    agent = mo.ui.slider(1, 4, 1, value=1, label="error of agent", show_value=True)
    mo.vstack(
        [
            mo.md("## Event-triggered consensus of four agents, run event-exactly"),
            mo.hstack([graph, threshold, decay], justify="start"),
            mo.hstack([gain, dwell, agent], justify="start"),
        ]
    )
    return agent, decay, dwell, gain, graph, threshold


@app.cell
def _(
    decay: Any, dwell: Any, gain: Any, graph: Any, live: Any, scenario_of: Any, threshold: Any, time: Any
) -> tuple[Any, ...]:
    began = time.perf_counter()
    shown = live(scenario_of(graph.value, threshold.value, decay.value, gain.value, dwell.value))
    spent = time.perf_counter() - began
    return shown, spent


@app.cell
def _(agent: Any, draw: Any, mo: Any, shown: Any, spent: Any, time: Any) -> None:
    started = time.perf_counter()
    picture = mo.Html(draw(shown, agent.value))
    drawn = time.perf_counter() - started
    said = f"{shown.text()} Run and bounds in {1e3 * spent:.0f} ms, drawn in {1e3 * drawn:.0f} ms."
    mo.vstack([picture, mo.md(said)])
    return


@app.cell
def _(fmus: Any, mo: Any, shown: Any) -> None:
    mo.download(lambda: fmus(shown.scenario), filename="agents.zip", label="The agents as FMUs")
    return


if __name__ == "__main__":
    app.run()
