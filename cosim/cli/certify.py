"""`hybrid-fmu certify`: printed, valid and exact bounds of a scenario beside what a run shows."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from typing import Any

import hybrid_model as hm
from cosim.cli.exits import Exit, exit_of
from cosim.cli.outputs import results_folder
from cosim.cli.progress import Work
from hybrid_model.consensus.certificates.certify import Certificates, certify
from hybrid_model.consensus.certificates.forms import Certified, Quantity
from hybrid_model.consensus.certificates.sizes import LARGE
from hybrid_model.consensus.figures.conservatism import save_certificate_figures
from hybrid_model.consensus.figures.style import require_formats
from hybrid_model.consensus.laws.agent_network import agent_network
from hybrid_model.consensus.laws.closed_loop import closed_loop
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.consensus.scenario.trigger import TriggerKind

SOURCES = "paper = Arun Kumar, Chowdhury, Srikant, Raisch; audit = docs/paper-audit.md of this project"
"""What the short names in the sources of values mean."""
MOST_DRAWN = 100
"""Agents that figures can show."""
_RUN, _BOUNDS, _FIGURES = 1.0, 8.0, 6.0
"""About how long these stages take, as parts of the whole."""


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    scenario = load_scenario(options.scenario)
    formats = options.figure_format or ["png", "pdf"]
    require_formats(formats)
    zeno = hm.ZenoGuard(max_jumps=options.max_jumps)
    large = scenario.network.agents >= LARGE and scenario.trigger.kind is not TriggerKind.CONTINUOUS
    arc: hm.HybridArc | hm.NetworkRun
    with Work(_RUN + _BOUNDS + _FIGURES * bool(options.out)) as work:
        work.begin("running the closed loop", _RUN)
        if large:
            arc = hm.simulate_network(agent_network(scenario), scenario.stop_time, zeno=zeno)
        else:
            arc = hm.simulate(closed_loop(scenario), scenario.stop_time, zeno=zeno)
        work.begin("computing the bounds", _BOUNDS)
        found = certify(scenario, arc, patience=options.patience, progress=work)
        document = json.dumps(_document(found, details=options.details), indent=2)
        if options.out:
            with results_folder(options.out, "certify") as folder:
                if scenario.network.agents <= MOST_DRAWN:
                    work.begin("drawing the figures", _FIGURES)
                    # Figures read the agents' curves off one arc.
                    whole = (
                        arc
                        if isinstance(arc, hm.HybridArc)
                        else hm.simulate(closed_loop(scenario), scenario.stop_time, zeno=zeno)
                    )
                    save_certificate_figures(found, whole, folder, formats)
                (folder / "certificates.json").write_text(document + "\n", encoding="utf-8")
    if options.out and scenario.network.agents > MOST_DRAWN:
        print(f"hybrid-fmu: figures are of networks with {MOST_DRAWN} agents or fewer.", file=sys.stderr)
    print(document if options.json else _text(found))
    # Bounds are there also where the thresholds vanish too fast for the run; a note says how far it came.
    return Exit.DONE if arc.stop is hm.Stop.JUMPS else exit_of(arc.stop.name)


def _document(found: Certificates, *, details: bool) -> dict[str, Any]:
    document = found.as_dict()
    if details:
        document["details"] = [asdict(value) for value in found.values]
        document["sources"] = SOURCES
        document["hypotheses"] = [asdict(hypothesis) for hypothesis in found.hypotheses]
    return document


def _text(found: Certificates) -> str:
    lines = [f"{found.scenario.name}: certificates"]
    for quantity in Quantity:
        rows = [value for value in found.values if value.quantity is quantity]
        lines += ["", f"{quantity.heading} [{rows[0].unit}]"]
        lines += [_row(value, found) for value in rows]
    mu1, mu2, window = (found.excitation[key] for key in ("mu1", "mu2", "T"))
    lines += ["", f"excitation of the tree's weights: mu1 {_number(mu1)}, mu2 {_number(mu2)}, T {_number(window)} s"]
    lines += ["", "hypotheses"]
    lines += [f"  {'holds' if h.holds else 'FAILS':<6} {h.name}: {h.detail} ({h.source})" for h in found.hypotheses]
    lines += ["", "notes", *(f"  - {note}" for note in found.notes)]
    return "\n".join([*lines, "", f"sources: {SOURCES}"])


def _row(value: Certified, found: Certificates) -> str:
    failed = [h.name for h in found.hypotheses if h.name in value.needs and not h.holds]
    why = f"  fails: {', '.join(failed)}" if value.value is None and failed else ""
    return f"  {value.form:<9} {_number(value.value):>14}  {value.source}{why}".rstrip()


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.7g}"
