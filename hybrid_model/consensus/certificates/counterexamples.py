"""Counterexamples to printed statements of the paper: each returns what is printed and what is true, as numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import hybrid_model as hm
from hybrid_model.consensus.certificates.gaps import frozen_gap, printed_gap
from hybrid_model.consensus.certificates.rates import rate_of_contraction
from hybrid_model.consensus.certificates.tree_bound import BoundForm, ConvergenceBound, convergence_bound
from hybrid_model.consensus.exact.floquet import floquet_spectrum
from hybrid_model.consensus.excitation.persistence import Signal, signal_factor
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.graphs.undirected import incidence, weighted_laplacian
from hybrid_model.consensus.laws.closed_loop import agent_name, closed_loop
from hybrid_model.consensus.runs.metrics import run_states
from hybrid_model.consensus.runs.report import edge_norm, run_report
from hybrid_model.consensus.scenario.definition import Network, Scenario, Weights
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind
from hybrid_model.consensus.switching.base import NoSwitching
from hybrid_model.consensus.weights.constant import ConstantWeight
from hybrid_model.consensus.weights.gated_sine import GatedSine, WeightMap

__all__ = [
    "Counterexample",
    "certifiable_rate",
    "corrected_gap_without_kappa1",
    "decay_of_the_example",
    "derivative_at_own_event",
    "derivative_on_a_path",
    "integrated_norm",
    "literal_excitation",
    "minimum_gap",
    "no_common_tree",
    "partial_window",
    "printed_sum",
    "shrinking_gaps",
    "signed_multipliers",
    "signed_weights",
    "valid_sum",
    "vanishing_weights",
]


@dataclass(frozen=True)
class Counterexample:
    """A printed statement and a case that contradicts it.

    Parameters
    ----------
    claim : str
        The statement, with its place in the paper.
    printed : float
        What the statement says: an upper bound, or a lower bound if `is_lower`.
    actual : float
        What is true in this case.
    is_lower : bool
        Whether the statement bounds from below.
    unit : str
        Of both numbers.
    """

    claim: str
    printed: float
    actual: float
    is_lower: bool = False
    unit: str = "1"

    @property
    def refutes(self) -> bool:
        """Whether the case contradicts the statement, beyond rounding."""
        if self.is_lower:
            return self.actual < self.printed * (1 - 1e-9)
        return self.actual > self.printed * (1 + 1e-9)


def _constant_network(
    edges: tuple[tuple[int, int], ...], initial: tuple[float, ...], weight: float, trigger: Trigger, stop_time: float
) -> Scenario:
    return Scenario(
        name="counterexample",
        stop_time=stop_time,
        network=Network(len(initial), edges, initial),
        weights=Weights((ConstantWeight(weight),) * len(edges)),
        switching=NoSwitching(len(edges)),
        trigger=trigger,
    )


def literal_excitation(weight: float = 10.0, window: float = 0.005) -> Counterexample:
    """Theorem 1 with definition 1 read literally for g = W, ``int W W^T``: two agents, a constant weight."""
    scenario = _constant_network(((1, 2),), (0.0, 1.0), weight, Trigger(TriggerKind.STATIC, 0.5), 1.0)
    largest = float(TreePartition(2, ((1, 2),)).Lambda[-1])
    mu = weight**2 * window
    gamma = 2 * largest * mu / (1 + largest * mu) ** 2
    return Counterexample(
        "Theorem 1 with int W W^T in definition 1",
        rate_of_contraction(gamma, window),
        floquet_spectrum(scenario).rate,
        is_lower=True,
        unit="1/s",
    )


def signed_multipliers() -> NDArray[np.float64]:
    """Moduli of the multipliers of the example over one cycle with the weights w = g, negative half of the time.

    The absolute weights with the sign of the sine; on each half wave the flow is that of a constant Laplacian.
    """
    scenario = load_scenario("paper-a")
    waveforms = tuple(replace(w, map=WeightMap.ABS) for w in scenario.weights.waveforms if isinstance(w, GatedSine))
    scenario = replace(scenario, weights=replace(scenario.weights, waveforms=waveforms))
    factor, flow = signal_factor(scenario, Signal.DISAGREEMENT), np.eye(scenario.network.agents - 1)
    for piece in scenario.edge_weights.pieces(0.0, 2 * math.pi):
        carrier = piece.shared_carrier
        if carrier is not None:
            sign = np.sign(np.sin(waveforms[0].sine_rate * (piece.start + piece.end) / 2))
            values, vectors = np.linalg.eigh((factor * piece.amplitudes) @ factor.T)
            flow = (vectors * np.exp(-sign * carrier.integral(piece.start, piece.end) * values)) @ vectors.T @ flow
    return np.asarray(np.abs(np.linalg.eigvals(flow)))


def signed_weights() -> Counterexample:
    """The example with the weights w = g: its largest multiplier over one cycle."""
    claim = "Simulation section: consensus with the weights w = g, so no multiplier above 1"
    return Counterexample(claim, 1.0, float(np.max(signed_multipliers())))


def integrated_norm(parts: int = 3) -> Counterexample:
    """``int ||M|| <= mu2`` in the proof of theorem 2: M is ``e_i e_i^T`` on the i-th of p equal parts of the window."""
    projections = np.stack([np.outer(e, e) for e in np.eye(parts)]) / parts
    return Counterexample(
        "Proof of theorem 2: the integral of ||M|| over a window is at most mu2",
        float(np.linalg.norm(projections.sum(axis=0), 2)),
        float(sum(np.linalg.norm(m, 2) for m in projections)),
    )


def printed_sum(delta: float, t: float, window: float, mu2: float = 1.0) -> float:
    """Right-hand side of eq. (7) with t0 = 0 and ``delta = alpha - beta > 0`` [1/s]; times in seconds."""
    whole = math.floor(t / window)
    return mu2 * math.exp(delta * window) * math.expm1(delta * whole * window) / math.expm1(delta * window)


def valid_sum(delta: float, t: float, window: float, mu2: float = 1.0) -> float:
    """The same integral bounded with windows counted back from t (audit, section 5.2); mu2 is ``sup int ||M||``."""
    return mu2 * (math.exp(delta * t) - math.exp(-delta * window)) / -math.expm1(-delta * window)


def partial_window(delta: float = 1.0, window: float = 1.0) -> Counterexample:
    """Eq. (7) before the first window is over: theta = 0 makes the printed bound zero. ``||M|| = 1/T`` throughout."""
    t = window / 2
    return Counterexample(
        "Eq. (7): the integral of e^{(alpha-beta)s} ||M|| up to t, t < T",
        printed_sum(delta, t, window),
        math.expm1(delta * t) / (delta * window),
    )


def minimum_gap() -> Counterexample:
    """The printed minimum gap: two agents, w = k = 1, c = 0.5, x(0) = (0, 0.05), T = 0.05 (audit, section 6)."""
    scenario, bound, speed = _two_close_agents()
    gap = run_report(scenario, hm.simulate(closed_loop(scenario), scenario.stop_time)).min_gap
    return Counterexample(
        "Eq. zeno dynamic upper bound: the minimum gap with kappa_1 + kappa_2",
        printed_gap(0.5, 0.0, speed, bound.kappa1 or 0.0, bound.kappa2 or 0.0),
        math.inf if gap is None else gap,
        is_lower=True,
        unit="s",
    )


def corrected_gap_without_kappa1() -> float:
    """The gap of `minimum_gap` with kappa_2 alone: the limit of the paper's own inequality, which holds [s]."""
    _, bound, speed = _two_close_agents()
    return frozen_gap(0.5, 0.0, speed * (bound.kappa2 or 0.0))


def _two_close_agents() -> tuple[Scenario, ConvergenceBound, float]:
    """The network of `minimum_gap`, its printed bound and ``rho ||D||``."""
    scenario = _constant_network(((1, 2),), (0.0, 0.05), 1.0, Trigger(TriggerKind.STATIC, 0.5), 15.0)
    bound = convergence_bound(scenario, BoundForm.PRINTED, window=0.05)
    return scenario, bound, bound.rho * float(np.linalg.norm(incidence(2, ((1, 2),)), 2))


def derivative_at_own_event(scenario: Scenario, arc: hm.HybridArc, samples: int = 4000) -> Counterexample:
    """``|x_i'(t)| <= k ||D|| ||W(t)|| ||x_e(t1)||`` between two events of agent i, the first at t1 (proof, Zeno part).

    The neighbours' broadcasts enter x_i', and they are neither x(t1) nor constant.

    Parameters
    ----------
    scenario : Scenario
        What ran.
    arc : HybridArc
        Its run.
    samples : int
        Number of times at which both sides are compared.

    Returns
    -------
    Counterexample
        `actual` is the largest ratio of the two sides, `printed` is 1.
    """
    network = scenario.network
    names = [agent_name(i) for i in range(1, network.agents + 1)]
    times = np.linspace(0.0, scenario.stop_time, samples + 1)[1:-1]
    D = incidence(network.agents, network.underlying_edges)
    norm = float(np.linalg.norm(D, 2))
    broadcasts = np.array([arc.at(f"{name}.broadcast", times) for name in names])
    events = [np.concatenate(([0.0], times_)) for times_ in run_report(scenario, arc).event_times]
    last = np.array([own[np.searchsorted(own, times, side="right") - 1] for own in events])
    states = run_states(scenario, arc)
    norms = np.array([edge_norm(scenario, states(starts)) for starts in last])
    worst = 0.0
    for column, t in enumerate(times):
        weights = scenario.edge_weights.value(float(t))
        largest = float(np.max(weights))
        if largest == 0:
            continue
        speed = np.abs(weighted_laplacian(network.agents, network.edges, weights) @ broadcasts[:, column])
        worst = max(worst, float(np.max(speed / (norm * largest * norms[:, column]))))
    return Counterexample("Proof of theorem 2, Zeno part: x' is k D W D^T x(t1) up to the next event", 1.0, worst)


def derivative_on_a_path() -> Counterexample:
    """`derivative_at_own_event` where it can be done by hand: three agents on a path, x(0) = (0, 0.4, 1), c = 0.5.

    Agent 1 broadcasts at 1.25 s, with edge states (7, 2)/120 in size; agent 2 broadcasts 0.9 at 3.54 s, and from then
    on agent 1 moves with 0.4: 48/sqrt(159) times the stated bound.
    """
    trigger = Trigger(TriggerKind.STATIC, 0.5)
    scenario = _constant_network(((1, 2), (2, 3)), (0.0, 0.4, 1.0), 1.0, trigger, 6.0)
    return derivative_at_own_event(scenario, hm.simulate(closed_loop(scenario), scenario.stop_time), 100)


def shrinking_gaps(decay: float = 3.0, stop_time: float = 6.0) -> Counterexample:
    """A threshold that decays faster than disagreement: gaps have no positive lower bound.

    Two agents, w = k = 1, so the rate is 2/s. `printed` is the shortest gap in the first half of the run, `actual` that
    in the second; with more time it falls further, like ``exp(-(beta - rate) t)``.
    """
    trigger = Trigger(TriggerKind.DYNAMIC, 0.5, decay)
    scenario = _constant_network(((1, 2),), (0.0, 1.0), 1.0, trigger, stop_time)
    events = run_report(scenario, hm.simulate(closed_loop(scenario), stop_time)).event_times[0]
    early = np.diff(events[events < stop_time / 2])
    late = np.diff(events[events >= stop_time / 2])
    return Counterexample(
        "Theorem 2: no Zeno behaviour, by a positive minimum gap, when beta is greater than alpha_v",
        float(early.min()),
        float(late.min()),
        is_lower=True,
        unit="s",
    )


def vanishing_weights(terms: int = 60) -> Counterexample:
    """Corollary 1: two agents with weight ``2^-j`` in interval j of 1 s; every union is connected.

    `actual` is what is left of the disagreement for t to infinity, ``exp(-2 k sum_j 2^-j) = exp(-4)``.
    """
    total = sum(2.0**-j for j in range(terms))
    return Counterexample("Corollary 1: contiguous intervals with connected unions suffice", 0.0, math.exp(-2 * total))


def no_common_tree(window: float = 100.0) -> Counterexample:
    """The proof of corollary 1: no spanning tree excites every window of one length.

    Three agents; intervals of 1 s with the tree {12, 23} or {13, 23}, in runs of 1, 1, 2, 2, 4, 4, ... intervals. Every
    interval has a tree, but edge 12 (13) carries no weight during a whole run of the other.

    Parameters
    ----------
    window : float
        The T that is claimed to do [s].

    Returns
    -------
    Counterexample
        `actual` is the least integrated weight of the edges 12 and 13 over windows of that length, `printed` the least
        that excitation of a fixed tree would need (any positive number; here the smallest float).
    """
    runs = math.ceil(math.log2(window)) + 2 if window > 1 else 2
    lengths = np.repeat(2.0 ** np.arange(runs), 2)
    ends = np.cumsum(lengths)
    starts = ends - lengths
    on = [float(np.sum(np.clip(np.minimum(ends, s + window) - np.maximum(starts, s), 0, None)[0::2])) for s in starts]
    return Counterexample(
        "Proof of corollary 1: Van der Waerden's theorem gives a tree and a window for theorem 2",
        float(np.finfo(float).tiny),
        min(on),
        is_lower=True,
        unit="1",
    )


def certifiable_rate(agents: int, edges: tuple[tuple[int, int], ...], window: float) -> float:
    """Largest alpha_v [1/s] that theorem 1 can give along a tree, whatever the weights, for windows from `window` s on.

    ``2 k lmin mu1/(1 + k sqrt(p) lmax mu2)^2 <= lmin/(2 sqrt(p) lmax)`` as mu1 <= mu2; gaps of the weights decide how
    short a window can be (audit, section 9).
    """
    spectrum = TreePartition(agents, edges).Lambda
    gamma = float(spectrum[0]) / (2 * math.sqrt(agents - 1) * float(spectrum[-1]))
    return rate_of_contraction(gamma, window)


def decay_of_the_example() -> Counterexample:
    """The largest alpha_v that any reading of the example can certify, against beta = 0.06 of its dynamic trigger.

    All gates are closed for 0.4 pi s, so a window has to be longer; the trees are the star and the path on four agents.
    """
    trees = (((1, 2), (1, 3), (1, 4)), ((1, 2), (2, 3), (3, 4)))
    return Counterexample(
        "Simulation section: alpha_v is above beta = 0.06 by choice",
        load_scenario("paper-a-dynamic").trigger.decay,
        max(certifiable_rate(4, tree, 0.4 * math.pi) for tree in trees),
        is_lower=True,
        unit="1/s",
    )
