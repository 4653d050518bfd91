"""Event-triggered consensus under time-varying, persistently exciting weights and switching topologies.

Source: S. Arun Kumar, N. R. Chowdhury, S. Srikant, J. Raisch, "Consensus analysis of systems with time-varying
interactions: an event-triggered approach" ("the paper" in this package), and an audit of its formulas ("audit") that
says which of them hold as printed.
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
from hybrid_model.consensus.double_integrators import (
    double_integrator_agents,
    double_integrator_loop,
    double_integrator_wires,
)
from hybrid_model.consensus.edge_domain import edge_domain_system
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
from hybrid_model.consensus.joint_excitation import JointExcitation, joint_excitation, tree_excitations
from hybrid_model.consensus.network import broadcast_wires, closed_loop, scenario_agents
from hybrid_model.consensus.random_switching import (
    jointly_connected_sequence,
    markov_sequence,
    random_dwell_sequence,
)
from hybrid_model.consensus.report import RunReport, edge_norm, run_report
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
    "BestWindow",
    "BoundForm",
    "Certificates",
    "Certified",
    "Channel",
    "ConstantWeight",
    "ConstantWeights",
    "ConvergenceBound",
    "DynamicTrigger",
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
    "PeriodicSwitching",
    "PiecewiseWeight",
    "RateForm",
    "RunReport",
    "SampledWeight",
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
    "best_window",
    "broadcast_wires",
    "certify",
    "closed_loop",
    "convergence_bound",
    "distance_weights",
    "double_integrator_agents",
    "double_integrator_loop",
    "double_integrator_wires",
    "edge_domain_system",
    "edge_norm",
    "floquet_spectrum",
    "joint_excitation",
    "jointly_connected_sequence",
    "load_scenario",
    "markov_sequence",
    "preset_names",
    "random_dwell_sequence",
    "read_scenario",
    "reliability_weight",
    "replace_trigger",
    "run_report",
    "scenario_agents",
    "scenario_excitation",
    "tree_excitations",
    "vector_agents",
    "vector_loop",
    "vector_wires",
]
