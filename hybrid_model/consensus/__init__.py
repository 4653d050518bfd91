"""Event-triggered consensus under time-varying, persistently exciting weights and switching topologies.

Source: S. Arun Kumar, N. R. Chowdhury, S. Srikant, J. Raisch, "Consensus analysis of systems with time-varying
interactions: an event-triggered approach" ("the paper" in this package), and an audit of its formulas ("audit") that
says which of them hold as printed.
"""

from hybrid_model.consensus.agents import DynamicTrigger, EventGenerator, Integrator, StaticTrigger, agent
from hybrid_model.consensus.certificates import BoundForm, ConvergenceBound, convergence_bound
from hybrid_model.consensus.edge_domain import edge_domain_system
from hybrid_model.consensus.edges import (
    ConstantWeights,
    GatedAbsoluteSineWeights,
    GatedSineWeights,
    PeriodicSwitching,
)
from hybrid_model.consensus.excitation import ExcitationConstants, scenario_excitation
from hybrid_model.consensus.floquet import FloquetSpectrum, floquet_spectrum
from hybrid_model.consensus.network import broadcast_wires, closed_loop, scenario_agents
from hybrid_model.consensus.report import RunReport, edge_norm, run_report
from hybrid_model.consensus.scenario import load_scenario, preset_names, read_scenario
from hybrid_model.consensus.scenario_data import Scenario, replace_trigger
from hybrid_model.consensus.spanning_trees import TreePartition
from hybrid_model.consensus.tables import ScenarioError

__all__ = [
    "BoundForm",
    "ConstantWeights",
    "ConvergenceBound",
    "DynamicTrigger",
    "EventGenerator",
    "ExcitationConstants",
    "FloquetSpectrum",
    "GatedAbsoluteSineWeights",
    "GatedSineWeights",
    "Integrator",
    "PeriodicSwitching",
    "RunReport",
    "Scenario",
    "ScenarioError",
    "StaticTrigger",
    "TreePartition",
    "agent",
    "broadcast_wires",
    "closed_loop",
    "convergence_bound",
    "edge_domain_system",
    "edge_norm",
    "floquet_spectrum",
    "load_scenario",
    "preset_names",
    "read_scenario",
    "replace_trigger",
    "run_report",
    "scenario_agents",
    "scenario_excitation",
]
