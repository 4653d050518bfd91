"""Double integrators that broadcast position and velocity, and extrapolate what they have heard.

G. S. Seyboth, D. V. Dimarogonas, K. H. Johansson, "Event-based broadcasting for multi-agent average consensus",
Automatica 49 (2013) 245-252, section on double-integrator agents; audit, section 11.2. Between two broadcasts everybody
takes agent i to move on evenly,

    xhat_i(t) = x_i(t_k) + (t - t_k) v_i(t_k),      vhat_i(t) = v_i(t_k),

and the protocol ``v_i' = -k sum_j w_ij(t) ((xhat_i - xhat_j) + mu (vhat_i - vhat_j))`` acts on these. The sum of the
velocities is conserved, whatever was broadcast, so the mean position moves on evenly.
"""

from __future__ import annotations

from numbers import Real

import numpy as np
import numpy.typing as npt

import hybrid_model as hm
from hybrid_model.consensus.laws.closed_loop import agent_name, edges_of, other_end
from hybrid_model.consensus.laws.vector_agents import NormThreshold, require_norm_trigger, start_numbers
from hybrid_model.consensus.messages import ScenarioError
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.weights.kinds import weights_block
from hybrid_model.declare.variables import Value

SENT = ("position", "velocity", "time")
"""What a broadcast holds: position and velocity, and the time that they belong to."""


class DoubleIntegrator(hm.HybridAutomaton):
    """A double integrator under the consensus protocol on extrapolated broadcasts."""

    degree = hm.Dimension("number of neighbours")
    x = hm.State(0.0, description="position", output=True)
    v = hm.State(0.0, unit="1/s", description="velocity", output=True)
    own_position = hm.Input(0.0, discrete=True, description="position last broadcast by the agent itself")
    own_velocity = hm.Input(0.0, discrete=True, unit="1/s", description="velocity last broadcast by the agent itself")
    own_time = hm.Input(0.0, discrete=True, unit="s", description="time of the agent's own last broadcast")
    positions = hm.Input(0.0, shape="degree", discrete=True, description="positions last broadcast by the neighbours")
    velocities = hm.Input(0.0, shape="degree", discrete=True, unit="1/s", description="their velocities")
    times = hm.Input(0.0, shape="degree", discrete=True, unit="s", description="times of their last broadcasts")
    weights = hm.Input(0.0, shape="degree", description="weights of the edges to the neighbours")
    gain = hm.Parameter(1.0, description="control gain k")
    damping = hm.Parameter(1.0, unit="s", description="weight mu of the velocities")

    def flow_map(self, s: hm.Values) -> dict[str, Value]:
        """The consensus protocol."""
        own = s.own_position + (s.t - s.own_time) * s.own_velocity
        others = s.positions + (s.t - s.times) * s.velocities
        difference = (own - others) + s.damping * (s.own_velocity - s.velocities)
        return {"x": s.v, "v": -s.gain * np.sum(s.weights * difference)}


class ModelBasedTrigger(NormThreshold):
    """Broadcasts position and velocity when ``|(xhat - x, mu (vhat - v))| >= c0 + c1 exp(-beta t)``."""

    x = hm.Input(0.0, description="position of the agent")
    v = hm.Input(0.0, unit="1/s", description="velocity of the agent")
    position = hm.DiscreteState(computed=True, output=True, description="position last broadcast")
    velocity = hm.DiscreteState(computed=True, output=True, unit="1/s", description="velocity last broadcast")
    time = hm.DiscreteState(computed=True, output=True, unit="s", description="time of the last broadcast")
    damping = hm.Parameter(1.0, unit="s", description="weight mu of the velocities")

    def start_map(self, s: hm.Values) -> dict[str, Value]:
        """The present position and velocity, and the time."""
        return {"position": s.x, "velocity": s.v, "time": s.t}

    def squared_error(self, s: hm.Values) -> Value:
        """``(xhat - x)**2 + mu**2 (vhat - v)**2``."""
        position_error = s.position + (s.t - s.time) * s.velocity - s.x
        velocity_error = s.damping * (s.velocity - s.v)
        return position_error**2 + velocity_error**2


def double_integrator_agents(
    scenario: Scenario, velocities: npt.ArrayLike, damping: float = 1.0
) -> dict[str, hm.Composition]:
    """Make double integrators for a scenario's network, weights, switching and trigger.

    Parameters
    ----------
    scenario : Scenario
        Its initial states are the initial positions. The trigger is static, dynamic or mixed.
    velocities : array_like, shape (n,)
        Initial velocities.
    damping : float
        mu > 0 [s], the weight of the velocities in the protocol and in the trigger.

    Returns
    -------
    dict
        Agent name -> automaton with inputs ``positions``, ``velocities`` and ``times`` of the neighbours' broadcasts,
        and outputs ``x``, ``v``, ``broadcast_position``, ``broadcast_velocity``, ``broadcast_time`` and ``events``.

    Raises
    ------
    ScenarioError
        If the velocities or the damping are not possible, or the trigger or the channel is of another kind.
    """
    require_norm_trigger(scenario, "double integrators")
    count = scenario.network.agents
    speeds = start_numbers("velocities", velocities, count)
    if not (isinstance(damping, Real) and 0 < damping < np.inf):
        raise ScenarioError(f"the damping mu is {damping}; it must be a positive, finite number of seconds.")
    return {agent_name(i): _agent(scenario, i, float(speeds[i - 1]), damping) for i in range(1, count + 1)}


def double_integrator_wires(scenario: Scenario) -> dict[str, list[str]]:
    """Return which broadcasts each agent of ``double_integrator_agents(scenario, ...)`` receives."""
    wires = {}
    for i in range(1, scenario.network.agents + 1):
        others = [other_end(scenario, edge, i) for edge in edges_of(scenario, i)]
        for heard, item in zip(("positions", "velocities", "times"), SENT, strict=True):
            wires[f"{agent_name(i)}.{heard}"] = [f"{agent_name(j)}.broadcast_{item}" for j in others]
    return wires


def double_integrator_loop(scenario: Scenario, velocities: npt.ArrayLike, damping: float = 1.0) -> hm.Composition:
    """Compose ``double_integrator_agents(scenario, velocities, damping)`` to one automaton; errors as there."""
    agents = double_integrator_agents(scenario, velocities, damping)
    return hm.Composition(scenario.name, agents, double_integrator_wires(scenario))


def _agent(scenario: Scenario, number: int, velocity: float, damping: float) -> hm.Composition:
    edges = edges_of(scenario, number)
    network, trigger = scenario.network, scenario.trigger
    switching = scenario.switching.automaton(edges)
    parts: dict[str, hm.Automaton] = {"weights": weights_block([scenario.weights.waveforms[k] for k in edges])}
    wires = {"trigger.x": "motion.x", "trigger.v": "motion.v"}
    wires |= {f"motion.own_{item}": f"trigger.{item}" for item in SENT}
    wires["motion.weights"] = "weights.weights"
    if switching is not None:
        parts["switching"] = switching
        wires |= {"switching.raw": "weights.weights", "motion.weights": "switching.weights"}
    parts["motion"] = DoubleIntegrator(
        degree=len(edges), x=network.initial[number - 1], v=velocity, gain=network.gain, damping=damping
    )
    parts["trigger"] = ModelBasedTrigger(damping=damping, **trigger.numbers)
    names = {f"motion.{item}": item for item in ("x", "v", "gain", "damping", "positions", "velocities", "times")}
    names |= {f"trigger.{item}": f"broadcast_{item}" for item in SENT}
    names |= {f"trigger.{item}": item for item in ("events", "broadcast_clock", *trigger.numbers)}
    return hm.Composition(agent_name(number), parts, wires, names)
