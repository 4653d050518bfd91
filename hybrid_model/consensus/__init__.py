"""Event-triggered consensus under time-varying, persistently exciting weights and switching topologies.

Source: S. Arun Kumar, N. R. Chowdhury, S. Srikant, J. Raisch, "Consensus analysis of systems with time-varying
interactions: an event-triggered approach" ("the paper" in this package). What holds of its formulas, and what holds
instead, is in docs/paper-audit.md; "audit" with the number of a section means that page.
"""

from hybrid_model.consensus.agents import (
    DynamicTrigger,
    EventGenerator,
    Integrator,
    MixedTrigger,
    StaticTrigger,
    agent,
)
from hybrid_model.consensus.certificates import BoundForm, ConvergenceBound, convergence_bound
from hybrid_model.consensus.certified import Certified
from hybrid_model.consensus.certify import Certificates, certify
from hybrid_model.consensus.connectivity import all_spanning_trees, joint_connectivity_window, spanning_tree_count
from hybrid_model.consensus.digraphs import BalancedSwitching
from hybrid_model.consensus.double_integrators import (
    double_integrator_agents,
    double_integrator_loop,
    double_integrator_wires,
)
from hybrid_model.consensus.edge_comparison import EdgeComparison, compare_edge_domain
from hybrid_model.consensus.edge_domain import edge_domain_system
from hybrid_model.consensus.edge_gains import EdgeGains, edge_domain_gains
from hybrid_model.consensus.edge_tables import FunctionWeights, SequenceSwitching, TabulatedWeights
from hybrid_model.consensus.edges import (
    ConstantWeights,
    GatedAbsoluteSineWeights,
    GatedSineWeights,
    PeriodicSwitching,
    SineWeights,
    SquareWeights,
)
from hybrid_model.consensus.excitation import ExcitationConstants, WindowExtremes, scenario_excitation
from hybrid_model.consensus.floquet import FloquetSpectrum, floquet_spectrum
from hybrid_model.consensus.function_weights import FunctionWeight, distance_weights, reliability_weight
from hybrid_model.consensus.generators import (
    AgentGraph,
    agent_graph,
    complete_graph,
    erdos_renyi_graph,
    geometric_graph,
    path_graph,
    regular_graph,
    ring_graph,
    small_world_graph,
    star_graph,
)
from hybrid_model.consensus.joint_excitation import JointExcitation, joint_excitation, tree_excitations
from hybrid_model.consensus.metrics import communication, gap_statistics, performance, run_metrics
from hybrid_model.consensus.network import broadcast_wires, closed_loop, scenario_agents
from hybrid_model.consensus.periodic_edge_domain import PeriodicGains, period_map, periodic_gains
from hybrid_model.consensus.random_switching import (
    jointly_connected_sequence,
    markov_sequence,
    random_dwell_sequence,
)
from hybrid_model.consensus.report import RunReport, edge_norm, run_report
from hybrid_model.consensus.savings import Savings, run_savings
from hybrid_model.consensus.scenario import load_scenario, preset_names, read_scenario
from hybrid_model.consensus.scenario_data import Channel, Scenario, Trigger, TriggerKind, replace_trigger
from hybrid_model.consensus.spanning_trees import TreePartition
from hybrid_model.consensus.switching_sequence import SwitchingSequence
from hybrid_model.consensus.table_weights import PiecewiseWeight, SampledWeight
from hybrid_model.consensus.tables import ScenarioError
from hybrid_model.consensus.vector_agents import vector_agents, vector_loop, vector_wires
from hybrid_model.consensus.wave_weights import SineWeight, SquareWeight
from hybrid_model.consensus.weights import ConstantWeight, GatedSine
from hybrid_model.consensus.windows import BestWindow, RateForm, best_window

__all__ = [
    "AgentGraph",
    "BalancedSwitching",
    "BestWindow",
    "BoundForm",
    "Certificates",
    "Certified",
    "Channel",
    "ConstantWeight",
    "ConstantWeights",
    "ConvergenceBound",
    "DynamicTrigger",
    "EdgeComparison",
    "EdgeGains",
    "EventGenerator",
    "ExcitationConstants",
    "FloquetSpectrum",
    "FunctionWeight",
    "FunctionWeights",
    "GatedAbsoluteSineWeights",
    "GatedSine",
    "GatedSineWeights",
    "Integrator",
    "JointExcitation",
    "MixedTrigger",
    "PeriodicGains",
    "PeriodicSwitching",
    "PiecewiseWeight",
    "RateForm",
    "RunReport",
    "SampledWeight",
    "Savings",
    "Scenario",
    "ScenarioError",
    "SequenceSwitching",
    "SineWeight",
    "SineWeights",
    "SquareWeight",
    "SquareWeights",
    "StaticTrigger",
    "SwitchingSequence",
    "TabulatedWeights",
    "TreePartition",
    "Trigger",
    "TriggerKind",
    "WindowExtremes",
    "agent",
    "agent_graph",
    "all_spanning_trees",
    "best_window",
    "broadcast_wires",
    "certify",
    "closed_loop",
    "communication",
    "compare_edge_domain",
    "complete_graph",
    "convergence_bound",
    "distance_weights",
    "double_integrator_agents",
    "double_integrator_loop",
    "double_integrator_wires",
    "edge_domain_gains",
    "edge_domain_system",
    "edge_norm",
    "erdos_renyi_graph",
    "floquet_spectrum",
    "gap_statistics",
    "geometric_graph",
    "joint_connectivity_window",
    "joint_excitation",
    "jointly_connected_sequence",
    "load_scenario",
    "markov_sequence",
    "path_graph",
    "performance",
    "period_map",
    "periodic_gains",
    "preset_names",
    "random_dwell_sequence",
    "read_scenario",
    "regular_graph",
    "reliability_weight",
    "replace_trigger",
    "ring_graph",
    "run_metrics",
    "run_report",
    "run_savings",
    "scenario_agents",
    "scenario_excitation",
    "small_world_graph",
    "spanning_tree_count",
    "star_graph",
    "tree_excitations",
    "vector_agents",
    "vector_loop",
    "vector_wires",
]
