"""Event-triggered consensus under time-varying, persistently exciting weights and switching topologies.

Source: S. Arun Kumar, N. R. Chowdhury, S. Srikant, J. Raisch, "Consensus analysis of systems with time-varying
interactions: an event-triggered approach" ("the paper" in this package). What holds of its formulas, and what holds
instead, is in docs/paper-audit.md; "audit" with the number of a section means that page. The rooms are a ladder that
pyproject.toml holds: `graphs` at its foot, `figures` at its top.
"""

from typing import TYPE_CHECKING

from hybrid_model.lazy_names import lazily

if TYPE_CHECKING:
    from hybrid_model.consensus.certificates.certify import Certificates, certify
    from hybrid_model.consensus.certificates.edge_comparison import EdgeComparison, compare_edge_domain
    from hybrid_model.consensus.certificates.forms import Certified
    from hybrid_model.consensus.certificates.tree_bound import BoundForm, ConvergenceBound, convergence_bound
    from hybrid_model.consensus.certificates.windows import BestWindow, RateForm, best_window
    from hybrid_model.consensus.exact.edge_domain import EdgeGains, edge_domain_gains, edge_domain_system
    from hybrid_model.consensus.exact.floquet import FloquetSpectrum, floquet_spectrum
    from hybrid_model.consensus.exact.periodic_edge_domain import PeriodicGains, period_map, periodic_gains
    from hybrid_model.consensus.excitation.joint import JointExcitation, joint_excitation
    from hybrid_model.consensus.excitation.persistence import ExcitationConstants, WindowExtremes, scenario_excitation
    from hybrid_model.consensus.excitation.trees import tree_excitations
    from hybrid_model.consensus.graphs.digraphs import BalancedSwitching
    from hybrid_model.consensus.graphs.generators import (
        AgentGraph,
        GraphKind,
        agent_graph,
        complete_graph,
        erdos_renyi_graph,
        geometric_graph,
        graph_of_kind,
        path_graph,
        regular_graph,
        ring_graph,
        small_world_graph,
        star_graph,
    )
    from hybrid_model.consensus.graphs.spanning_trees import TreePartition, all_spanning_trees, spanning_tree_count
    from hybrid_model.consensus.laws.agent_network import agent_network
    from hybrid_model.consensus.laws.agents import Integrator, agent
    from hybrid_model.consensus.laws.closed_loop import broadcast_wires, closed_loop, scenario_agents
    from hybrid_model.consensus.laws.double_integrators import (
        double_integrator_agents,
        double_integrator_loop,
        double_integrator_wires,
    )
    from hybrid_model.consensus.laws.threshold_triggers import (
        DynamicTrigger,
        EventGenerator,
        MixedTrigger,
        StaticTrigger,
    )
    from hybrid_model.consensus.laws.vector_agents import vector_agents, vector_loop, vector_wires
    from hybrid_model.consensus.messages import ScenarioError
    from hybrid_model.consensus.runs.communication import communication, gap_statistics
    from hybrid_model.consensus.runs.metrics import performance, run_metrics
    from hybrid_model.consensus.runs.report import RunReport, edge_norm, run_report
    from hybrid_model.consensus.runs.savings import Savings, run_savings
    from hybrid_model.consensus.scenario.channel import Channel
    from hybrid_model.consensus.scenario.definition import Scenario, replace_trigger
    from hybrid_model.consensus.scenario.files import load_scenario, read_scenario
    from hybrid_model.consensus.scenario.own_trigger import OwnTrigger
    from hybrid_model.consensus.scenario.sources import preset_names
    from hybrid_model.consensus.scenario.trigger import Threshold, Trigger, TriggerKind
    from hybrid_model.consensus.switching.cycle import PeriodicSwitching
    from hybrid_model.consensus.switching.joint_connectivity import joint_connectivity_window
    from hybrid_model.consensus.switching.random_sequences import (
        jointly_connected_sequence,
        markov_sequence,
        random_dwell_sequence,
    )
    from hybrid_model.consensus.switching.sequence import SequenceSwitching, SwitchingSequence
    from hybrid_model.consensus.weights.constant import ConstantWeight, ConstantWeights
    from hybrid_model.consensus.weights.distances import distance_weights, reliability_weight
    from hybrid_model.consensus.weights.function import FunctionWeight, FunctionWeights
    from hybrid_model.consensus.weights.gated_sine import GatedAbsoluteSineWeights, GatedSine, GatedSineWeights
    from hybrid_model.consensus.weights.piecewise import PiecewiseWeight
    from hybrid_model.consensus.weights.sampled import SampledWeight
    from hybrid_model.consensus.weights.sine import SineWeight, SineWeights
    from hybrid_model.consensus.weights.square import SquareWeight, SquareWeights
    from hybrid_model.consensus.weights.tabulated import TabulatedWeights

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
    "GraphKind",
    "Integrator",
    "JointExcitation",
    "MixedTrigger",
    "OwnTrigger",
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
    "Threshold",
    "TreePartition",
    "Trigger",
    "TriggerKind",
    "WindowExtremes",
    "agent",
    "agent_graph",
    "agent_network",
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
    "graph_of_kind",
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

__getattr__ = lazily(__name__)
