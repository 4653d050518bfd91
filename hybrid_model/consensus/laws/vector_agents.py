"""Agents in R^d: one event for all elements, when the norm of the error is too large (law: paper, section 4)."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
import numpy.typing as npt

import hybrid_model as hm
from hybrid_model.consensus.laws.agents import agent
from hybrid_model.consensus.laws.closed_loop import agent_name, broadcast_wires, edges_of
from hybrid_model.consensus.messages import ScenarioError, shown
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import Threshold, TriggerKind
from hybrid_model.consensus.weights.kinds import weights_block
from hybrid_model.declare.variables import FloatArray, Value

NORM_KINDS = (TriggerKind.STATIC, TriggerKind.DYNAMIC, TriggerKind.MIXED)
"""Triggers that compare the norm of an error with a function of time."""


class VectorIntegrator(hm.HybridAutomaton):
    """A single integrator in R^d under the paper's protocol: ``x' = -k sum_j w_j(t) (xhat - xhat_j)``."""

    degree = hm.Dimension("number of neighbours")
    dimension = hm.Dimension("dimension d of the state")
    x = hm.State(0.0, shape="dimension", description="state of the agent", output=True)
    broadcast = hm.Input(0.0, shape="dimension", discrete=True, description="broadcast value of the agent itself")
    neighbours = hm.Input(
        0.0, shape=("degree", "dimension"), discrete=True, description="broadcast values of the neighbours"
    )
    weights = hm.Input(0.0, shape="degree", unit="1/s", description="weights of the edges to the neighbours")
    gain = hm.Parameter(1.0, description="control gain k")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """The consensus protocol."""
        return {"x": -s.gain * np.sum(s.weights[:, None] * (s.broadcast[None, :] - s.neighbours), axis=0)}


class NormThreshold(hm.HybridAutomaton):
    """Broadcasts when the Euclidean norm of an error reaches ``c0 + c1 exp(-beta t)``.

    The trigger functions of the paper, section 4, and of Seyboth et al. 2013 with a norm in place of the absolute
    value. The margin compares squares: it is smooth where the error is zero.
    """

    events = hm.DiscreteState(0, integer=True, output=True, description="number of broadcasts since the start")
    offset = hm.Parameter(0.0, description="threshold c0 that stays")
    threshold = hm.Parameter(0.5, description="threshold c1 that decays")
    decay = hm.Parameter(0.0, unit="1/s", description="decay rate beta")
    broadcast_clock = hm.Clock("broadcast", description="ticks with each broadcast")

    @abstractmethod
    def squared_error(self, s: hm.Values) -> Value:
        """The squared norm of the error."""

    @abstractmethod
    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """What is broadcast at the start, and then by `send`."""

    def error_too_large(self, s: hm.Values) -> Value:
        """The trigger function, in squares."""
        return self.squared_error(s) - Threshold(s.threshold, s.decay, s.offset).at(s.t) ** 2

    def send(self, s: hm.Values) -> dict[str, Value]:
        """Broadcast what holds now."""
        return {**self.start_map(s), "events": s.events + 1}

    transitions = (hm.Jump("broadcast", error_too_large, send),)


class NormTrigger(NormThreshold):
    """The event generator of an agent in R^d: ``|xhat - x| >= c0 + c1 exp(-beta t)``."""

    dimension = hm.Dimension("dimension d of the state")
    x = hm.Input(0.0, shape="dimension", description="state of the agent")
    broadcast = hm.DiscreteState(shape="dimension", computed=True, output=True, description="value last broadcast")

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The present state."""
        return {"broadcast": s.x}

    def squared_error(self, s: hm.Values) -> Value:
        """``|xhat - x|**2``."""
        return np.sum((s.broadcast - s.x) ** 2)


def vector_agents(scenario: Scenario, initial: npt.ArrayLike) -> dict[str, hm.Composition]:
    """Make agents in R^d for a scenario's network, weights, switching and trigger.

    Parameters
    ----------
    scenario : Scenario
        Its initial states are not used. The trigger is static, dynamic or mixed.
    initial : array_like, shape (n, d)
        Initial states.

    Returns
    -------
    dict
        Agent name -> automaton with an input ``neighbours``, one row for each edge of the agent, and outputs ``x``,
        ``broadcast`` and ``events``.

    Raises
    ------
    ScenarioError
        If the initial states have another shape or are not all finite numbers, or the trigger or the channel is of
        another kind.
    """
    require_norm_trigger(scenario, "agents in R^d")
    states = start_vectors("initial states", initial, scenario.network.agents)
    trigger, found = scenario.trigger, {}
    for i, state in enumerate(states, start=1):
        edges = edges_of(scenario, i)
        found[agent_name(i)] = agent(
            agent_name(i),
            VectorIntegrator(degree=len(edges), x=state, gain=scenario.network.gain),
            weights_block([scenario.weights.waveforms[k] for k in edges]),
            NormTrigger(dimension=len(state), **trigger.numbers),
            scenario.switching.automaton(edges),
        )
    return found


def vector_loop(scenario: Scenario, initial: npt.ArrayLike) -> hm.Composition:
    """Compose the agents of ``vector_agents(scenario, initial)`` to one automaton; errors as there."""
    return hm.Composition(scenario.name, vector_agents(scenario, initial), vector_wires(scenario))


def vector_wires(scenario: Scenario, dimension: int | None = None) -> dict[str, str | list[str]]:
    """Return which broadcasts each agent of `vector_agents` receives.

    Parameters
    ----------
    scenario : Scenario
        The network.
    dimension : int, optional
        With it every wire carries one number, as between the slaves of a co-simulation; without it, one vector.
    """
    rows = [
        (f"{target}[{row}", source)
        for target, sources in broadcast_wires(scenario).items()
        for row, source in enumerate(sources, start=1)
    ]
    if dimension is None:
        return {target: sources for target, sources in broadcast_wires(scenario).items() if sources}
    return {f"{target},{k}]": f"{source}[{k}]" for target, source in rows for k in range(1, dimension + 1)}


def require_norm_trigger(scenario: Scenario, who: str) -> None:
    """Refuse triggers and channels that single integrators alone have.

    Raises
    ------
    ScenarioError
        If the trigger is not one of `NORM_KINDS`, or the channel is not ideal.
    """
    if scenario.trigger.kind not in NORM_KINDS:
        names = ", ".join(kind.value for kind in NORM_KINDS)
        raise ScenarioError(f"[trigger] kind is '{scenario.trigger.name}'; for {who} it must be one of {names}.")
    if not scenario.channel.ideal:
        raise ScenarioError(f"[channel] delays or loses broadcasts; {who} have an ideal channel only, so leave it out.")


def start_numbers(name: str, given: npt.ArrayLike, agents: int) -> FloatArray:
    """One finite number for each agent.

    Parameters
    ----------
    name : str
        How messages call them.
    given : array_like, shape (agents,)
        The numbers.
    agents : int
        Number of agents n.

    Raises
    ------
    ScenarioError
        If they are no numbers, not finite or not one for each agent.
    """
    numbers = _as_numbers(name, given, "one number for each agent")
    if numbers.shape != (agents,):
        raise ScenarioError(f"the {name} have the shape {numbers.shape} for {agents} agents; give one for each agent.")
    return _finite(name, numbers)


def start_vectors(name: str, given: npt.ArrayLike, agents: int) -> FloatArray:
    """One row of finite numbers for each agent, all of one length d >= 1; parameters and errors as `start_numbers`."""
    rows = _as_numbers(name, given, "one row of numbers for each agent, all of one length")
    if rows.ndim != 2 or len(rows) != agents or rows.shape[1] == 0:
        raise ScenarioError(
            f"the {name} have the shape {rows.shape} for {agents} agents; give an array of one row for each agent, "
            "with at least one number in it."
        )
    return _finite(name, rows)


def _as_numbers(name: str, given: npt.ArrayLike, rule: str) -> FloatArray:
    try:
        array = np.asarray(given)
    except ValueError:
        raise ScenarioError(f"the {name} have rows of different lengths; give {rule}.") from None
    # An empty list has a kind by chance; other kinds are text, dates, complex numbers, truth values or a mixture.
    if array.size and array.dtype.kind not in "fiu":
        raise ScenarioError(f"the {name} are not all real numbers; give {rule}.")
    return array.astype(np.float64)


def _finite(name: str, array: FloatArray) -> FloatArray:
    for number, value in enumerate(array, start=1):
        if not np.all(np.isfinite(value)):
            raise ScenarioError(f"the {name} of agent {number} hold {shown(value.tolist())}; they must be finite.")
    return array
