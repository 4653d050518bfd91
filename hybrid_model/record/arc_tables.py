"""Hybrid arcs as tables of pandas and xarray, which are imported only here and only when asked for."""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from hybrid_model.declare.variables import FloatArray, Kind, element_names
from hybrid_model.errors import DataError

if TYPE_CHECKING:
    from hybrid_model.record.arc import HybridArc


def dataframe(arc: HybridArc, names: Iterable[str] | None = None) -> Any:
    """Return the samples of an arc as a pandas DataFrame.

    Parameters
    ----------
    arc : HybridArc
        The run.
    names : iterable of str, optional
        Which variables; default: all but the parameters that are fixed for a run.

    Returns
    -------
    pandas.DataFrame
        One row a sample, index (t in s, j); one column a scalar, the elements of arrays as ``w[1]``, ``w[2]``. Its
        ``attrs`` hold ``units`` and ``descriptions`` by column, the fixed ``parameters``, and how the run ended.

    Raises
    ------
    DataError
        If pandas is not installed.
    """
    pandas = _installed("pandas", "to_dataframe")
    samples = arc.samples(names)
    index = pandas.MultiIndex.from_arrays([samples.t, samples.j], names=["t", "j"])
    frame = pandas.DataFrame(samples.columns(), index=index)
    variables = [arc.variable(name) for name in samples.values]
    frame.attrs.update(
        _about(arc),
        units={column: v.unit for v in variables for column in element_names(v)},
        descriptions={column: v.description for v in variables for column in element_names(v)},
        parameters={name: value.tolist() for name, value in _parameters(arc).items()},
    )
    return frame


def dataset(arc: HybridArc, names: Iterable[str] | None = None) -> Any:
    """Return the samples of an arc as an xarray Dataset.

    Parameters
    ----------
    arc : HybridArc
        The run.
    names : iterable of str, optional
        Which variables; default: all but the parameters that are fixed for a run.

    Returns
    -------
    xarray.Dataset
        Dimension ``sample`` with the index (t, j), then one dimension a length, ``w_1`` for the first of ``w``. Each
        variable has ``units``, ``description`` and ``kind`` in its ``attrs``; the Dataset has how the run ended, and
        the fixed parameters. ``reset_index("sample")`` makes plain coordinates, as netCDF files need them.

    Raises
    ------
    DataError
        If xarray is not installed.
    """
    xarray = _installed("xarray", "to_xarray")
    pandas = _installed("pandas", "to_xarray")
    samples = arc.samples(names)
    index = pandas.MultiIndex.from_arrays([samples.t, samples.j], names=["t", "j"])
    data = {}
    for name, value in samples.values.items():
        variable = arc.variable(name)
        about = {"units": variable.unit, "description": variable.description, "kind": variable.kind.value}
        dimensions = ["sample", *(f"{name}_{k + 1}" for k in range(value.ndim - 1))]
        data[name] = (dimensions, value, about)
    coordinates = xarray.Coordinates.from_pandas_multiindex(index, "sample")
    attributes = {**_about(arc), **{name: value.tolist() for name, value in _parameters(arc).items()}}
    result = xarray.Dataset(data, coords=coordinates, attrs=attributes)
    result["t"].attrs.update(units="s", description="time")
    result["j"].attrs.update(units="1", description="jumps so far")
    return result


def _about(arc: HybridArc) -> dict[str, Any]:
    return {
        "automaton": arc.automaton.name,
        "stop": arc.stop.name,
        "message": arc.message,
        "event_tolerance": arc.event_tolerance,
    }


def _parameters(arc: HybridArc) -> dict[str, FloatArray]:
    fixed = [v.name for v in arc.automaton.of_kind(Kind.PARAMETER) if not v.tunable]
    return {name: np.asarray(arc.at(name, arc.t[0])) for name in fixed}


def _installed(package: str, what: str) -> Any:
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise DataError(f"{what} needs {package}, which is not installed: pip install hybrid-fmu[data].") from error
