"""Reading the table ``[weights]`` of a scenario file; docs/scenarios.md lists the keys of each kind."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from hybrid_model.consensus.messages import ScenarioError, shown
from hybrid_model.consensus.scenario.definition import WeightKind, Weights
from hybrid_model.consensus.scenario.samples_file import read_samples
from hybrid_model.consensus.scenario.tables import Table
from hybrid_model.consensus.weights.gated_sine import ConstantWeight, GatedSine, WeightMap
from hybrid_model.consensus.weights.tables import PiecewiseWeight, SampledWeight
from hybrid_model.consensus.weights.waveform import Waveform
from hybrid_model.consensus.weights.waves import SineWeight, SquareWeight

__all__ = ["WEIGHT_KEYS", "read_weights"]

WEIGHT_KEYS = {
    WeightKind.GATED_SINE: ("kind", "map", "gate_rate", "sine_rate", "duty_percent", "phase"),
    WeightKind.CONSTANT: ("kind", "value"),
    WeightKind.SINE: ("kind", "mean", "depth", "rate", "phase"),
    WeightKind.SQUARE: ("kind", "high", "low", "gate_rate", "duty_percent", "phase"),
    WeightKind.PIECEWISE: ("kind", "starts", "values", "cycle"),
    WeightKind.SAMPLED: ("kind", "file", "times", "values", "repeat"),
    WeightKind.FUNCTION: ("kind",),
}
"""The keys that each kind knows."""


def read_weights(make_table: Callable[[tuple[str, ...]], Table], edge_count: int, folder: Path) -> Weights:
    """Read the weights of all edges.

    Parameters
    ----------
    make_table : callable
        Makes the table from the keys that it may have.
    edge_count : int
        Number of edges.
    folder : Path
        Folder that the name of a file of samples counts from.

    Raises
    ------
    ScenarioError
        If a key is unknown or missing, or a value is of the wrong type or out of range; the message names it.
    """
    # The kind decides which keys are known, so it is read from a table that accepts them all.
    any_kind = make_table(tuple(dict.fromkeys(key for keys in WEIGHT_KEYS.values() for key in keys)))
    kind = any_kind.choice("kind", WeightKind)
    return _READERS[kind](make_table(WEIGHT_KEYS[kind]), edge_count, folder)


def _constant(table: Table, edges: int, folder: Path) -> Weights:
    values = table.per_edge("value", edges)
    for number, value in enumerate(values, start=1):
        if value < 0:
            raise table.error(f"value[{number}]" if table.lists("value") else "value", value, "must not be negative")
    return _each_edge(ConstantWeight, zip(values, strict=True))


def _gated_sine(table: Table, edges: int, folder: Path) -> Weights:
    weight_map = table.choice("map", WeightMap, default=WeightMap.SQUARE)
    columns = [table.per_edge(key, edges) for key in ("gate_rate", "sine_rate", "duty_percent")]
    phases = table.per_edge("phase", edges, default=0.0)
    return _each_edge(GatedSine, zip(*columns, phases, (weight_map,) * edges, strict=True))


def _sine(table: Table, edges: int, folder: Path) -> Weights:
    columns = [table.per_edge(key, edges) for key in ("mean", "depth", "rate")]
    return _each_edge(SineWeight, zip(*columns, table.per_edge("phase", edges, default=0.0), strict=True))


def _square(table: Table, edges: int, folder: Path) -> Weights:
    high, low = table.per_edge("high", edges), table.per_edge("low", edges, default=0.0)
    columns = [table.per_edge(key, edges) for key in ("gate_rate", "duty_percent")]
    return _each_edge(SquareWeight, zip(high, low, *columns, table.per_edge("phase", edges, default=0.0), strict=True))


def _piecewise(table: Table, edges: int, folder: Path) -> Weights:
    starts = table.numbers("starts")
    cycle = table.number("cycle") if "cycle" in table else None
    return _each_edge(PiecewiseWeight, ((starts, values, cycle) for values in table.rows("values", edges)))


def _sampled(table: Table, edges: int, folder: Path) -> Weights:
    repeat = table.flag("repeat", default=False)
    if "file" in table:
        for key in ("times", "values"):
            if key in table:
                raise table.error(key, "given beside file", "must be left out if the samples come from a file")
        name = table.text("file")
        times, columns = read_samples(folder / name, edges)
        return _each_edge(
            SampledWeight, ((times, values, repeat) for values in columns), f"file {shown(name)}, samples"
        )
    times, columns = table.numbers("times"), table.rows("values", edges)
    return _each_edge(SampledWeight, ((times, values, repeat) for values in columns))


def _function(table: Table, edges: int, folder: Path) -> Weights:
    raise table.error(
        "kind", "function", "is for scenarios made in Python (FunctionWeight); sample the function for a file"
    )


_READERS: dict[WeightKind, Callable[[Table, int, Path], Weights]] = {
    WeightKind.CONSTANT: _constant,
    WeightKind.GATED_SINE: _gated_sine,
    WeightKind.SINE: _sine,
    WeightKind.SQUARE: _square,
    WeightKind.PIECEWISE: _piecewise,
    WeightKind.SAMPLED: _sampled,
    WeightKind.FUNCTION: _function,
}


def _each_edge(waveform: Callable[..., Waveform], rows: Iterable[Any], source: str = "") -> Weights:
    waveforms = []
    for number, row in enumerate(rows, start=1):
        try:
            waveforms.append(waveform(*row))
        except ValueError as error:
            where = f"{source} of edge {number}" if source else f"of edge {number}"
            raise ScenarioError(f"[weights] {where}: {error}") from error
    return Weights(tuple(waveforms))
