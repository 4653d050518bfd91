"""Reference results: a run of the automaton itself, to compare an FMU's run with.

They lie where the layered standard for related files (FMI-LS-REF 1.0.0-beta.1) has them, with an experiment in the form
of the Modelica Association's harmonized specification (MA-HS-Experiments) and results as comma-separated values.
"""

from __future__ import annotations

import csv
import hashlib
import io
import math
import xml.etree.ElementTree as ET

import numpy as np
import numpy.typing as npt

import hybrid_model as hm
from fmu.describe.description import TOLERANCE, Description
from fmu.describe.experiment import round_step
from fmu.describe.variables import Bank, FmuVariable
from fmu.describe.xml_text import number, to_bytes, xml_text
from hybrid_model.declare.variables import FloatArray, Kind, element_names

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
NOTE = "documentation/fmi-ls-ref.txt"
_NOTE = """Reference results of {name}

The experiment starts at 0 s and ends at {end} s, with all start values, parameters and inputs as the model description
has them. The results come from a run of the automaton itself (hybrid_model.simulate), recorded by the exporter.
Values are rounded to {digits} digits of the greatest in their column. The instant of a jump has two rows, before its
first and after its last jump there: an importer without event mode has only the second, and that at its next
communication point. To be expected: the same jumps, times equal to 1e-7 s, continuous states to 1e-8 of their size.
"""
_NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
_MOST_COLUMNS, _MOST_VALUES = 100, 100_000
"""Of a table of results: those of large networks would be many times larger than the FMU."""
_DIGITS = 12
"""Of the values: more than the run is exact to, and few enough for the same bytes from other C libraries."""


def reference_results(description: Description, stop_time: float) -> dict[str, bytes]:
    """Run an automaton from its start values and return the results as members of an FMU's archive.

    Parameters
    ----------
    description : Description
        The automaton and its variables; inputs keep their start values.
    stop_time : float
        End of the run in s. A run that stops before it (Zeno) gives results up to there.

    Returns
    -------
    dict of str to bytes
        Manifest, experiment, and results: a row for each step of the experiment, and two for the instant of a jump,
        before and after it. Empty if the automaton has nothing that an FMU shows, or its results are a large table.

    Raises
    ------
    SimulationError
        If the run fails.
    """
    shown = _shown(description)
    if not shown or len(shown) > _MOST_COLUMNS:
        return {}
    arc = hm.simulate(description.automaton, stop_time)
    end = float(arc.t[-1])
    step = description.proposed_step or round_step(stop_time)
    grid = _grid(arc, end, step)
    if len(shown) * (len(grid) + len(arc.jumps)) > _MOST_VALUES:
        return {}
    results = _results(arc, grid, shown)
    experiment = _experiment(description, end, step)
    related = {
        "experiments.xml": (
            experiment,
            "application/x-ma-hs-experiments",
            "experiment/smoke-test",
            "a run of the model",
        ),
        "results.csv": (results, "text/csv", "result", "its results, from a run of the automaton itself"),
    }
    members = {name: content for name, (content, *_) in related.items()}
    members["fmi-ls-manifest.xml"] = _manifest(related)
    told = _NOTE.format(name=xml_text(description.automaton.name), end=number(end), digits=_DIGITS)
    return {f"{FOLDER}/{name}": content for name, content in members.items()} | {NOTE: told.encode()}


def _shown(description: Description) -> list[tuple[str, str, int | None]]:
    """Return name in the FMU, name in the automaton, and element, of the outputs; of states if there are none."""
    layout = description.traced.layout
    banks = {Bank.STATE: Kind.STATE, Bank.DISCRETE: Kind.DISCRETE, Bank.OUTPUT: Kind.OUTPUT}
    places = {
        (bank, place.at.start + k): (place.variable.name, k if place.variable.shape else None)
        for bank, kind in banks.items()
        for place in layout.places[kind]
        for k in range(len(element_names(place.variable)))
    }

    def listed(wanted: str) -> list[tuple[str, str, int | None]]:
        pairs: list[tuple[str, FmuVariable]] = list(zip(description.names, description.variables, strict=True))
        return [
            (name, *places[variable.bank, variable.index])
            for name, variable in pairs
            if variable.causality == wanted and variable.bank in banks and not variable.shape
        ]

    return listed("output") or listed("local")


def _grid(arc: hm.HybridArc, end: float, step: float) -> FloatArray:
    """Return the points of the experiment and the instants of the jumps, ascending, each once."""
    count = math.floor(end / step * (1 + 1e-12))
    # By index: a sum of steps drifts. Fifteen digits: 19.65 and not the next number to it.
    points: npt.NDArray[np.float64] = np.array([min(float(f"{k * step:.15g}"), end) for k in range(count + 1)])
    jumps = [jump.t for jump in arc.jumps]
    return np.unique(np.concatenate([points, jumps, [0.0, end]]))


def _results(arc: hm.HybridArc, grid: FloatArray, shown: list[tuple[str, str, int | None]]) -> bytes:
    names = list(dict.fromkeys(name for _, name, _ in shown))
    samples = arc.resample(grid, names, both_sides=True)
    columns = [
        samples.values[name] if element is None else samples.values[name].reshape(len(samples.t), -1)[:, element]
        for _, name, element in shown
    ]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", *(name for name, _, _ in shown)])
    for t, *row in zip(samples.t, *map(_rounded, columns), strict=True):
        # Times are told in full: two rows of one instant are one instant.
        writer.writerow([number(t), *(f"{value + 0.0:.{_DIGITS}g}" for value in row)])
    return text.getvalue().encode()


def _rounded(column: FloatArray) -> FloatArray:
    """Round a column where its greatest value ends: rounding errors about zero differ from machine to machine."""
    greatest = float(np.max(np.abs(column)))
    return column if greatest == 0.0 else np.round(column, _DIGITS - math.ceil(math.log10(greatest)))


def _experiment(description: Description, end: float, step: float) -> bytes:
    name = xml_text(description.automaton.name)
    root = ET.Element("Experiments", name=name)
    experiment = ET.SubElement(root, "Experiment", name="default", tolerance=number(TOLERANCE))
    experiment.set("description", f"{name} from its start values")
    ET.SubElement(experiment, "TransientSimulation", startTime="0", stopTime=number(end), stepSize=number(step))
    ET.SubElement(experiment, "References", source="results.csv", type="text/csv")
    return to_bytes(root)


def _manifest(related: dict[str, tuple[bytes, str, str, str]]) -> bytes:
    ET.register_namespace("fmi-ls", _NAMESPACE)
    root = ET.Element(
        "fmiReferences",
        {
            f"{{{_NAMESPACE}}}fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
            f"{{{_NAMESPACE}}}fmi-ls-version": "1.0.0-beta.1",
            f"{{{_NAMESPACE}}}fmi-ls-description": (
                "Layered Standard providing information on related files included in an FMU."
            ),
        },
    )
    for name, (content, mime, role, text) in related.items():
        checksum = hashlib.sha3_256(content).hexdigest()
        ET.SubElement(
            root,
            "Related",
            type=mime,
            source=name,
            role=role,
            description=text,
            checksum=checksum,
            checksumType="SHA3-256",
        )
    return to_bytes(root)
