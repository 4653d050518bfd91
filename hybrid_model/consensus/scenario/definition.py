"""A scenario: the network, its weights, its switching and its trigger, as immutable and checked data."""

import enum
import math
from dataclasses import dataclass, replace
from functools import cached_property

from hybrid_model.consensus.graphs.undirected import Edge, complete_edges, validate_edges
from hybrid_model.consensus.messages import ScenarioError, shown
from hybrid_model.consensus.scenario.channel import IDEAL, Channel
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind
from hybrid_model.consensus.switching.base import Switching
from hybrid_model.consensus.weights.edge_weights import EdgeWeights
from hybrid_model.consensus.weights.kinds import WeightKind
from hybrid_model.consensus.weights.waveform import Waveform

__all__ = ["Network", "Scenario", "Underlying", "Weights", "replace_trigger"]


class Underlying(enum.Enum):
    """Which edges the edge states x_e are taken over."""

    LISTED = "listed"
    COMPLETE = "complete"


_NOTHING = 1e-9
"""Share of the largest initial state below which one may be what rounding has left of zero."""


@dataclass(frozen=True)
class Network:
    """Agents, the edges that can carry weight, the initial states and the gain.

    Parameters
    ----------
    agents : int
        Number of agents n.
    edges : tuple of Edge
        The m edges that can carry weight; agents count from 1.
    initial : tuple of float
        Initial states, one for each agent.
    gain : float
        The gain k > 0 of the control law (paper, section 3).
    underlying : Underlying
        COMPLETE if the underlying graph is the complete graph on the agents, LISTED if it has the listed edges only.

    Raises
    ------
    ScenarioError
        If the edges are not those of a simple graph, or a number is missing, not finite or out of range.
    """

    agents: int
    edges: tuple[Edge, ...]
    initial: tuple[float, ...]
    gain: float = 1.0
    underlying: Underlying = Underlying.LISTED

    def __post_init__(self) -> None:
        """Check the values."""
        if self.agents < 2:
            raise ScenarioError(f"[network] agents is {shown(self.agents)}; consensus needs at least 2 agents.")
        try:
            validate_edges(self.agents, self.edges)
        except ValueError as error:
            raise ScenarioError(f"[network] {error}" if not self.edges else f"[network] edges: {error}") from None
        if len(self.initial) != self.agents:
            raise ScenarioError(
                f"[network] initial lists {len(self.initial)} numbers for {shown(self.agents)} agents; give one each."
            )
        for agent, value in enumerate(self.initial, start=1):
            _require_finite(f"[network] initial[{agent}]", value)
        _require_positive("[network] gain", self.gain)

    @cached_property
    def size_beside_zeros(self) -> float | None:
        """Size of the initial states, a power of ten, if one of them is zero beside the others or nearly so."""
        sizes = [abs(value) for value in self.initial]
        largest = max(sizes)
        # In powers of ten, so that scenarios with other start values have the same agents.
        return 10.0 ** math.ceil(math.log10(largest)) if min(sizes) < _NOTHING * largest else None

    @cached_property
    def edges_at(self) -> tuple[list[int], ...]:
        """Of each agent its edges, as indices from 0 into the list."""
        found: tuple[list[int], ...] = tuple([] for _ in range(self.agents))
        for k, edge in enumerate(self.edges):
            for agent in edge:
                found[agent - 1].append(k)
        return found

    @cached_property
    def underlying_edges(self) -> tuple[Edge, ...]:
        """Edges of the underlying graph: the listed ones first, in their order."""
        return complete_edges(self.agents, self.edges) if self.underlying is Underlying.COMPLETE else self.edges


@dataclass(frozen=True)
class Weights:
    """The waveform of each edge, all of one kind.

    Raises
    ------
    ScenarioError
        If there is no waveform or the kinds differ.
    """

    waveforms: tuple[Waveform, ...]

    def __post_init__(self) -> None:
        """Check that there is one kind."""
        if len({type(waveform) for waveform in self.waveforms}) != 1:
            raise ScenarioError("[weights] must hold at least one waveform, and all of the same kind.")

    @property
    def kind(self) -> WeightKind:
        """The family of the waveforms."""
        return next(kind for kind in WeightKind if isinstance(self.waveforms[0], kind.waveform))


@dataclass(frozen=True)
class Scenario:
    """Everything that a run needs.

    Parameters
    ----------
    name : str
        Name in reports.
    stop_time : float
        End of the run [s], positive; it begins at t = 0.
    network : Network
        Agents and edges.
    weights : Weights
        One waveform for each edge.
    switching : Switching
        Which edges are active when; ``NoSwitching(edge_count)`` for all of them at all times.
    trigger : Trigger
        When an agent broadcasts.
    channel : Channel
        Delay and loss of broadcasts; by default there is neither.

    Raises
    ------
    ScenarioError
        If the parts are not made for the same number of edges, or the stop time is not positive.
    """

    name: str
    stop_time: float
    network: Network
    weights: Weights
    switching: Switching
    trigger: Trigger
    channel: Channel = IDEAL

    def __post_init__(self) -> None:
        """Check that the parts fit."""
        if not self.name:
            raise ScenarioError("name is empty; a scenario needs a name for its reports.")
        _require_positive("stop_time", self.stop_time)
        if self.trigger.kind is TriggerKind.CONTINUOUS and not self.channel.ideal:
            raise ScenarioError(
                "[channel] delays or loses broadcasts, but the trigger 'continuous' sends none; leave [channel] out."
            )
        edge_count = len(self.network.edges)
        counts = {"[weights]": len(self.weights.waveforms), "[switching]": self.switching.edge_count}
        for table, count in counts.items():
            if count != edge_count:
                raise ScenarioError(
                    f"{table} is made for {count} edges, but [network] lists {edge_count}; they must be the same edges."
                )
        domains = [("[switching]", "dwell", self.switching.domain)]
        domains += [
            (f"[weights] of edge {k}", "its times", wave.domain)
            for k, wave in enumerate(self.weights.waveforms, start=1)
        ]
        for table, key, (first, last) in domains:
            if first > 0 or last < self.stop_time:
                raise ScenarioError(
                    f"{table} is given from {first:.6g} s to {last:.6g} s, but the run goes from 0 s to "
                    f"{self.stop_time:.6g} s; let {key} cover the run, set repeat = true or change stop_time."
                )

    @cached_property
    def edge_weights(self) -> EdgeWeights:
        """Weights of the listed edges as functions of time, switching included."""
        return EdgeWeights(self.weights.waveforms, self.switching)


def replace_trigger(scenario: Scenario, kind: TriggerKind | str) -> Scenario:
    """The same scenario with the static or the dynamic trigger, keeping its threshold and its name.

    Parameters
    ----------
    scenario : Scenario
        The scenario; it is not changed.
    kind : TriggerKind or str
        "static" drops the decay. "dynamic" leaves a scenario with a dynamic trigger as it is.

    Raises
    ------
    ScenarioError
        If the kind is unknown, or the scenario's trigger has not the numbers that it needs.
    """
    names = [member.value for member in TriggerKind]
    if isinstance(kind, str) and kind not in names:
        raise ScenarioError(f"trigger kind is '{kind}'; it must be one of {', '.join(names)}.")
    wanted, given = TriggerKind(kind), scenario.trigger
    if wanted is given.kind:
        return scenario
    if wanted is TriggerKind.STATIC and given.threshold > 0:
        return replace(scenario, trigger=Trigger(wanted, given.threshold))
    if wanted is TriggerKind.DYNAMIC and given.kind is TriggerKind.STATIC:
        raise ScenarioError(
            f"scenario '{scenario.name}' has the static trigger and so no decay for a dynamic one; "
            "give it a trigger with kind = 'dynamic' and a decay."
        )
    raise ScenarioError(
        f"the trigger '{given.name}' of scenario '{scenario.name}' does not have the numbers of the trigger "
        f"'{wanted.value}'; give it a trigger of that kind with its numbers."
    )


def _require_finite(name: str, value: float) -> None:
    if not math.isfinite(value):
        raise ScenarioError(f"{name} is {value}; it must be a finite number.")


def _require_positive(name: str, value: float) -> None:
    _require_finite(name, value)
    if value <= 0:
        raise ScenarioError(f"{name} is {value}; it must be positive.")


def require_scenario(caller: str, given: object) -> None:
    """Refuse the name of a scenario, or something else, where a scenario is wanted.

    Raises
    ------
    ScenarioError
        With what to write.
    """
    if not isinstance(given, Scenario):
        raise ScenarioError(f"{caller} was given {shown(given)}: write {caller}(load_scenario(name or path)).")
