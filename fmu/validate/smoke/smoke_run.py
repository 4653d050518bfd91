"""Run an FMU shortly: which experiments are made, on which interface types."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from fmu.standard.capabilities import DERIVATIVES, Capability
from fmu.standard.platforms import EXTENSIONS, parts_of, runs_here, this_machine
from fmu.validate.findings import Finding, note, quoted, softened
from fmu.validate.reading.description import Description
from fmu.validate.smoke.child_process import Children, RunLimits, run_experiment
from fmu.validate.smoke.claims import claims
from fmu.validate.smoke.moves import moves
from fmu.validate.smoke.plan import LARGEST_ARRAY, plan_of

MISUSE = ("token", "bad steps")
"""Experiments that do what no importer does."""
WITHOUT_EVENT_MODE = "life cycle without event mode"
_NOT_LOADED = ("run.load", "run.library")


def run_fmu(folder: Path, description: Description, limits: RunLimits) -> tuple[tuple[str, ...], list[Finding]]:
    """Run each interface type of an extracted FMU.

    Parameters
    ----------
    folder : Path
        The FMU, extracted.
    description : Description
    limits : RunLimits

    Returns
    -------
    tuple of str
        Interface types that were run.
    list of Finding
    """
    executed: list[str] = []
    findings: list[Finding] = []
    with Children() as children:
        for kind, attributes in description.interfaces.items():
            binary = _binary(folder, attributes.get("modelIdentifier", ""))
            if binary is None:
                machine = "-".join(this_machine())
                findings.append(
                    note("run.platform", f"{kind} was not run: there is no binary for this machine, {machine}.")
                )
                continue
            if description.can(kind, Capability.EXECUTION_TOOL):
                findings.append(
                    note("run.tool", f"{kind} was not run: it needs its tool at run time (needsExecutionTool).")
                )
                continue
            plan = plan_of(folder, binary, description, kind)
            found = _run_kind(
                plan,
                {**_experiments(description, kind), **claims(description, kind), **moves(description, kind)},
                limits,
                children,
            )
            if not any(finding.rule == "run.library" for _, finding in found):
                executed.append(kind)
            findings += _told_once(kind, found)
    large = [v for v in description.variables if (description.size(v) or 0) > LARGEST_ARRAY]
    if large:
        findings.append(note("run.large", f"The array {quoted(large[0].name)} is too large to be read in the run."))
    return tuple(executed), findings


def _run_kind(
    plan: dict[str, Any], experiments: dict[str, dict[str, Any]], limits: RunLimits, children: Children
) -> list[tuple[str, Finding]]:
    """Make the experiments on an interface type, and return what each finds, by its name."""
    found: list[tuple[str, Finding]] = []
    for name, changes in experiments.items():
        here = list(run_experiment({**plan, **changes}, limits, children))
        # Of an FMU that is given what no importer gives, only robustness is learned; clocks need Event Mode.
        soft = name in MISUSE or (name == WITHOUT_EVENT_MODE and plan["clocks"])
        found += [(name, softened(finding) if soft else finding) for finding in here]
        if any(finding.rule in _NOT_LOADED for finding in here):
            break
    return found


def _told_once(kind: str, found: list[tuple[str, Finding]]) -> list[Finding]:
    """Return each finding once, with the experiments that it comes from."""
    names: dict[Finding, list[str]] = {}
    for name, finding in found:
        names.setdefault(finding, []).append(name)
    return [
        dataclasses.replace(finding, message=f"{kind}, {_joined(places)}: {finding.message}")
        for finding, places in names.items()
    ]


def _joined(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]} (and {len(names) - 1} more experiments)"


def _binary(folder: Path, identifier: str) -> Path | None:
    places = folder / "binaries"
    for place in sorted(places.iterdir()) if places.is_dir() else []:
        parts = parts_of(place.name)
        if parts is not None and runs_here(place.name) and not parts[2]:
            file = place / f"{identifier}{EXTENSIONS[parts[1]]}"
            if file.is_file():
                return file
    return None


def _experiments(description: Description, kind: str) -> dict[str, dict[str, Any]]:
    """Return what each experiment changes in the plan, by its name in messages."""
    experiments: dict[str, dict[str, Any]] = {
        "life cycle": {"experiment": "life_cycle"},
        "token": {"experiment": "token"},
    }
    if kind == "CoSimulation" and description.can(kind, Capability.EVENT_MODE):
        # Most importers leave event mode off: the FMU then handles its events inside.
        experiments[WITHOUT_EVENT_MODE] = {"experiment": "life_cycle", "event_mode": False}
    if description.can(kind, Capability.STATE):
        experiments["state"] = {"experiment": "state"}
    if kind == "CoSimulation":
        experiments["bad steps"] = {"experiment": "bad_steps"}
    if kind != "ScheduledExecution" and any(description.can(kind, capability) for capability in DERIVATIVES):
        experiments["derivatives"] = {"experiment": "derivatives"}
    return experiments
