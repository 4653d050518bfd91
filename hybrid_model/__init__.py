"""Hybrid automata: declare them once, run them event-exactly, export and co-simulate them."""

from typing import TYPE_CHECKING

from hybrid_model.declare.automaton import Automaton
from hybrid_model.declare.composition import Composition
from hybrid_model.declare.diagrams.wiring import feedback, parallel, product, series
from hybrid_model.declare.dwell import MinimumDwell
from hybrid_model.declare.hybrid_automaton import HybridAutomaton
from hybrid_model.declare.margins import greatest, least, lookup
from hybrid_model.declare.modes import ModalAutomaton, Mode, Switch, TimedSwitch
from hybrid_model.declare.signals import Signal
from hybrid_model.declare.transitions import Clock, Jump, Priority, TimeEvent
from hybrid_model.declare.variables import Dimension, DiscreteState, Input, Output, Parameter, State, Values
from hybrid_model.errors import (
    AlgebraicLoopError,
    DataError,
    DeclarationError,
    HybridModelError,
    SimulationError,
    WiringError,
)
from hybrid_model.lazy_names import lazily
from hybrid_model.record.arc import HybridArc, load_arc
from hybrid_model.record.jump_record import JumpRecord
from hybrid_model.record.samples import Samples
from hybrid_model.reference.execution import Execution
from hybrid_model.simulate import simulate
from hybrid_model.solver import Method, Solver
from hybrid_model.stop import Stop
from hybrid_model.zeno_guard import ZenoGuard

if TYPE_CHECKING:
    from hybrid_model.schedule.event_network import simulate_network
    from hybrid_model.schedule.event_store import load_network_events
    from hybrid_model.schedule.network_arrays import Network
    from hybrid_model.schedule.network_events import NetworkEvents
    from hybrid_model.schedule.network_run import NetworkRun
    from hybrid_model.verification.report import Verification, Violation
    from hybrid_model.verification.subject import Tolerances
    from hybrid_model.verification.verify import verify

__version__ = "0.1.0"

__all__ = [
    "AlgebraicLoopError",
    "Automaton",
    "Clock",
    "Composition",
    "DataError",
    "DeclarationError",
    "Dimension",
    "DiscreteState",
    "Execution",
    "HybridArc",
    "HybridAutomaton",
    "HybridModelError",
    "Input",
    "Jump",
    "JumpRecord",
    "Method",
    "MinimumDwell",
    "ModalAutomaton",
    "Mode",
    "Network",
    "NetworkEvents",
    "NetworkRun",
    "Output",
    "Parameter",
    "Priority",
    "Samples",
    "Signal",
    "SimulationError",
    "Solver",
    "State",
    "Stop",
    "Switch",
    "TimeEvent",
    "TimedSwitch",
    "Tolerances",
    "Values",
    "Verification",
    "Violation",
    "WiringError",
    "ZenoGuard",
    "__version__",
    "feedback",
    "greatest",
    "least",
    "load_arc",
    "load_network_events",
    "lookup",
    "parallel",
    "product",
    "series",
    "simulate",
    "simulate_network",
    "verify",
]

__getattr__ = lazily(__name__)
