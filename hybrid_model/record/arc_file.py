"""Hybrid arcs in files: NumPy's npz without pickle, with a schema version, complete without the automaton's class.

A file holds the declarations of the variables, every sample bit by bit, both sides of every jump, and the dense output
of every step as polynomials for states, inputs and outputs together. Only the maps of the automaton stay behind.
"""

from __future__ import annotations

import json
import struct
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_model.declare.transitions import ClockInfo, JumpInfo, Priority, Trigger
from hybrid_model.declare.variables import FloatArray, Kind, Variable
from hybrid_model.errors import DataError, MissingFileError
from hybrid_model.record.arc_values import ArcValues, LoadedValues
from hybrid_model.record.flow_piece import FlowPiece
from hybrid_model.record.flow_record import FlowRecord
from hybrid_model.record.interpolants import Interpolant, Polynomial, interpolate
from hybrid_model.record.jump_record import JumpRecord
from hybrid_model.record.loaded_automaton import LoadedAutomaton
from hybrid_model.record.run_record import RunRecord
from hybrid_model.stop import Stop

SCHEMA = "hybrid-fmu hybrid arc"
VERSION = 2
"""Version 2 has the parameters as a table in time; files of version 1, in which they are one row, are read as well."""
ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
"""Error of the stored dense output that is aimed at, as a part of the largest value of each scalar in the run: a few
dozen operations, as the dense output itself has."""

UNREADABLE = (zipfile.BadZipFile, zlib.error, struct.error, OSError, EOFError, ValueError, KeyError, RuntimeError)
"""What the zip and npy readers raise on files that are not theirs or not whole."""

NOT_KEPT = ("kind", "start", "value_names")
"""What files hold of variables in another way, or not at all."""
_SAMPLE_READERS = {
    ".csv": "hm.Samples.from_csv",
    ".mat": "scipy.io.loadmat",
    ".nc": "xarray.open_dataset",
}

Table = Mapping[str, Any]


def write_record(record: RunRecord, path: Path) -> None:
    """Write a run to a file, which it replaces; `HybridArc.save` calls it."""
    read, flows = record.read, record.flows
    points = [(t, record.first_j + k, x, flow.z) for k, flow in enumerate(flows) for t, x in flow.points]
    t, j, x, z = (np.array(column) for column in zip(*points, strict=True))
    samples = read.channels_along(t, x, z)
    scale = np.max(np.abs(samples), axis=0, initial=0.0)
    tolerance = np.maximum(ROUNDING * scale, np.finfo(np.float64).tiny)
    fitted = [_dense(read, piece, flow.z, tolerance) for flow in flows for piece in flow.pieces]
    parts = [part for interpolant, _ in fitted for part in interpolant.parts]
    sides = {
        f"jump_{side}": _rows([getattr(jump, side) for jump in record.jumps])
        for side in ("x_before", "z_before", "x_after", "z_after")
    }
    times, parameters = read.parameter_steps(float(t[0]), float(t[-1]))
    content: dict[str, Any] = {
        "schema": np.array(SCHEMA),
        "version": np.array(VERSION),
        "about": np.frombuffer(json.dumps(_about(record)).encode(), dtype=np.uint8),
        "start_values": np.concatenate([np.zeros(0), *(v.start.ravel() for v in read.automaton.variables)]),
        "parameter_times": times,
        "parameters": parameters,
        "event_tolerance": np.array(record.event_tolerance),
        "t": t,
        "j": j,
        "channels": samples,
        "discrete": np.array([flow.z[: read.layout.sizes[Kind.DISCRETE]] for flow in flows]),
        "jump_t": np.array([jump.t for jump in record.jumps], dtype=np.float64),
        "jump_index": np.array([jump.index for jump in record.jumps], dtype=np.int64),
        **sides,
        "piece_parts": np.array([len(interpolant.parts) for interpolant, _ in fitted], dtype=np.int64),
        "part_ends": np.array([(part.a, part.b) for part in parts], dtype=np.float64).reshape(-1, 2),
        "part_points": np.array([len(part.values) for part in parts], dtype=np.int64),
        "points": np.concatenate([np.zeros((0, len(scale))), *(part.values for part in parts)]),
        "interpolation_error": np.max([_stored_error(read, len(scale)), *(error for _, error in fitted)], axis=0),
    }
    with path.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **content)


def read_record(path: Path) -> RunRecord:
    """Read what `write_record` has written; `load_arc` calls it and says what it raises."""
    if reader := _SAMPLE_READERS.get(path.suffix.lower()):
        raise DataError(f"{path} holds samples alone, if anything: read it by {reader}; arcs are .npz files.")
    content = _content(path)
    try:
        return _record(content)
    except (KeyError, ValueError, IndexError, TypeError) as error:
        raise DataError(f"{path} is damaged: its parts do not fit together ({error}); save the arc anew.") from error


def _content(path: Path) -> Table:
    try:
        with zipfile.ZipFile(path) as archive:
            broken = archive.testzip()
        if broken is not None:
            raise zipfile.BadZipFile(f"checksum of {broken}")
        with np.load(path, allow_pickle=False) as file:
            schema = str(file["schema"]) if "schema" in file else None
            version = int(file["version"]) if "version" in file else None
            if schema == SCHEMA and version in (1, VERSION):
                return {name: file[name] for name in file.files}
    except FileNotFoundError as error:
        raise MissingFileError(
            f"there is no file {path}: give the path of one that HybridArc.save has written."
        ) from error
    except UNREADABLE as error:
        raise DataError(
            f"{path} is no hybrid arc, or is damaged ({error}): give a file that HybridArc.save wrote completely."
        ) from error
    if schema != SCHEMA:
        raise DataError(f"{path} holds no hybrid arc: give a file that HybridArc.save has written.")
    raise DataError(
        f"{path} has version {version} of the schema, and this package reads versions 1 to {VERSION}: "
        "install the version of hybrid-fmu that wrote the file, or a later one."
    )


def _dense(read: ArcValues, piece: FlowPiece, z: FloatArray, tolerance: FloatArray) -> tuple[Interpolant, FloatArray]:
    """Return the channels along a piece as polynomials, and their error."""
    dense = piece.interpolate
    if isinstance(dense, Interpolant):
        # From a file: the same polynomials again, so that saving once more changes no bit.
        kept = [part for part in dense.parts if part.b > piece.t0 and part.a < piece.t1]
        return Interpolant(tuple(kept or dense.parts[:1])), np.zeros(len(tolerance))
    # Inputs are continuous from the right: at the end of a piece their limit from the left belongs to it.
    last = max(piece.t0, float(np.nextafter(piece.t1, -np.inf)))
    return interpolate(
        lambda t: read.channels(min(t, last), piece.at(t), z), piece.t0, max(piece.t1, piece.t0), tolerance
    )


def _stored_error(read: ArcValues, width: int) -> FloatArray:
    return read.errors if isinstance(read, LoadedValues) else np.zeros(width)


def _rows(vectors: Sequence[FloatArray]) -> FloatArray:
    return np.array(vectors) if vectors else np.zeros((0, 0))


def _about(record: RunRecord) -> dict[str, Any]:
    """Return what is text: names, units, flags, and how the run ended."""
    automaton = record.read.automaton
    variables = []
    for variable in automaton.variables:
        entry = {key: getattr(variable, key) for key in Variable.__dataclass_fields__ if key not in NOT_KEPT}
        variables.append({**entry, "kind": variable.kind.name, "shape": variable.shape})
    return {
        "automaton": automaton.name,
        "priority": automaton.priority.name,
        "has_flow_set": automaton.has_flow_set,
        "variables": variables,
        "jumps": [{**asdict(info), "trigger": info.trigger.name} for info in automaton.jumps],
        "clocks": [asdict(clock) for clock in automaton.clocks],
        "stop": record.stop.name,
        "message": record.message,
    }


def _automaton(about: Table, starts: FloatArray) -> LoadedAutomaton:
    variables = []
    at = 0
    for entry in about["variables"]:
        shape = tuple(entry["shape"])
        size = int(np.prod(shape))
        start = starts[at : at + size].reshape(shape)
        flags = {key: value for key, value in entry.items() if key not in ("kind", "shape")}
        flags["dimensions"] = tuple(flags.get("dimensions", ()))
        variables.append(Variable(kind=Kind[entry["kind"]], start=start, **flags))
        at += size
    return LoadedAutomaton(
        about["automaton"],
        tuple(variables),
        tuple(JumpInfo(**{**entry, "trigger": Trigger[entry["trigger"]]}) for entry in about["jumps"]),
        tuple(ClockInfo(**entry) for entry in about["clocks"]),
        Priority[about["priority"]],
        has_flow_set=about["has_flow_set"],
    )


def _record(content: Table) -> RunRecord:
    about = json.loads(content["about"].tobytes().decode())
    automaton = _automaton(about, content["start_values"])
    times = content.get("parameter_times", content["t"][:1])
    parameters = np.atleast_2d(content["parameters"])
    read = LoadedValues(automaton, times, parameters, content["interpolation_error"])
    _require_lengths(content, sum(read.layout.sizes[kind] for kind in (Kind.STATE, Kind.INPUT, Kind.OUTPUT)))
    flows = _flows(content)
    first = int(content["j"][0])
    sides = [content[f"jump_{side}"] for side in ("x_before", "z_before", "x_after", "z_after")]
    jumps = [
        JumpRecord(float(t), first + k, int(index), automaton.jumps[index].name, *row)
        for k, (t, index, *row) in enumerate(zip(content["jump_t"], content["jump_index"], *sides, strict=True))
    ]
    return RunRecord(
        read,
        flows,
        jumps,
        stop=Stop[about["stop"]],
        message=about["message"],
        event_tolerance=float(content["event_tolerance"]),
        first_j=first,
    )


def _require_lengths(content: Table, width: int) -> None:
    samples, parts = len(content["t"]), len(content["part_ends"])
    flows = int(content["j"][-1]) - int(content["j"][0]) + 1
    shapes = {
        "j": (samples,),
        "channels": (samples, width),
        "interpolation_error": (width,),
        "jump_t": (flows - 1,),
        "piece_parts": (samples - flows,),
        "part_ends": (int(np.sum(content["piece_parts"])), 2),
        "part_points": (parts,),
        "points": (int(np.sum(content["part_points"])), width),
    }
    if "parameter_times" in content:
        shapes["parameter_times"] = (len(content["parameters"]),)
    for name, shape in shapes.items():
        if content[name].shape != shape:
            raise ValueError(f"{name} has shape {content[name].shape} in place of {shape}")
    if len(content["discrete"]) != flows:
        raise ValueError(f"{len(content['discrete'])} rows of discrete states for {flows} flows")


def _flows(content: Table) -> list[FlowRecord]:
    """Put the flows together from samples and polynomials."""
    t, j, channels = content["t"], content["j"], content["channels"]
    values = np.split(content["points"], np.cumsum(content["part_points"])[:-1])
    parts = [Polynomial(float(a), float(b), rows) for (a, b), rows in zip(content["part_ends"], values, strict=False)]
    ends = np.cumsum(content["piece_parts"])
    dense = iter(
        [Interpolant(tuple(parts[end - n : end])) for n, end in zip(content["piece_parts"], ends, strict=True)]
    )
    flows = []
    for number, z in enumerate(content["discrete"]):
        rows = np.flatnonzero(j == j[0] + number)
        pieces = [FlowPiece(float(t[k]), float(t[k + 1]), channels[k], channels[k + 1], next(dense)) for k in rows[:-1]]
        flows.append(FlowRecord(float(t[rows[0]]), channels[rows[0]], z, tuple(pieces)))
    return flows
