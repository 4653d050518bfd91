"""Hybrid arcs as tables of pandas and xarray, which are imported only here and only when asked for."""

from __future__ import annotations

import importlib
from typing import Any

from hybrid_model.declare.variables import FloatArray, Kind, element_names
from hybrid_model.errors import DataError
from hybrid_model.record.run_record import RunRecord
from hybrid_model.record.samples import Samples


def dataframe(record: RunRecord, samples: Samples) -> Any:
    """Return the samples of an arc as a pandas DataFrame.

    Parameters
    ----------
    record : RunRecord
        The run.
    samples : Samples
        Its samples, of the variables wanted.

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
    index = pandas.MultiIndex.from_arrays([samples.t, samples.j], names=["t", "j"])
    frame = pandas.DataFrame(samples.columns(), index=index)
    variables = [record.read.variable(name) for name in samples.values]
    frame.attrs.update(
        _about(record),
        units={column: v.unit for v in variables for column in element_names(v)},
        descriptions={column: v.description for v in variables for column in element_names(v)},
        parameters={name: value.tolist() for name, value in _parameters(record).items()},
    )
    return frame


def dataset(record: RunRecord, samples: Samples) -> Any:
    """Return the samples of an arc as an xarray Dataset.

    Parameters
    ----------
    record : RunRecord
        The run.
    samples : Samples
        Its samples, of the variables wanted.

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
    index = pandas.MultiIndex.from_arrays([samples.t, samples.j], names=["t", "j"])
    data = {}
    for name, value in samples.values.items():
        variable = record.read.variable(name)
        about = {"units": variable.unit, "description": variable.description, "kind": variable.kind.value}
        dimensions = ["sample", *(f"{name}_{k + 1}" for k in range(value.ndim - 1))]
        data[name] = (dimensions, value, about)
    coordinates = xarray.Coordinates.from_pandas_multiindex(index, "sample")
    attributes = {**_about(record), **{name: value.tolist() for name, value in _parameters(record).items()}}
    result = xarray.Dataset(data, coords=coordinates, attrs=attributes)
    result["t"].attrs.update(units="s", description="time")
    result["j"].attrs.update(units="1", description="jumps so far")
    return result


def _about(record: RunRecord) -> dict[str, Any]:
    return {
        "automaton": record.read.automaton.name,
        "stop": record.stop.name,
        "message": record.message,
        "event_tolerance": record.event_tolerance,
    }


def _parameters(record: RunRecord) -> dict[str, FloatArray]:
    read, first = record.read, record.flows[0]
    fixed = [v.name for v in read.automaton.of_kind(Kind.PARAMETER) if not v.tunable]
    return {name: read.value(name, first.t0, first.x0, first.z) for name in fixed}


def _installed(package: str, what: str) -> Any:
    try:
        return importlib.import_module(package)
    except ImportError as error:
        raise DataError(f"{what} needs {package}, which is not installed: pip install hybrid-fmu[data].") from error
