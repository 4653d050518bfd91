"""The window T of the excitation constants that gives the best rate; larger is not better (audit, sections 3 and 8)."""

import enum
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from hybrid_model.consensus.certificates.rates import rate_of_contraction, tree_contraction, tree_free_rate
from hybrid_model.consensus.excitation.persistence import Signal, excitation_horizon, signal_factor, window_extremes
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.scenario.definition import Scenario

__all__ = ["BestWindow", "RateForm", "best_window", "rate_over_window", "search_window"]

_GRID = 48
_REFINED = 3
_MULTIPLES = 12


class RateForm(enum.Enum):
    """Formulas for a rate of convergence that follow from excitation constants (audit, section 3)."""

    PRINTED = "printed"
    VALID = "valid"
    IMPROVED = "improved"


@dataclass(frozen=True)
class BestWindow:
    """The best window that a search found.

    Parameters
    ----------
    window : float
        T [s].
    rate : float
        The rate [1/s] that it gives; 0.0 if no window that was tried is exciting.
    """

    window: float
    rate: float


def rate_over_window(
    scenario: Scenario, form: RateForm, window: float, partition: TreePartition | None = None
) -> float:
    """The certified rate [1/s] with the excitation constants over windows of one length.

    Parameters
    ----------
    scenario : Scenario
        Network, weights, switching.
    form : RateForm
        PRINTED: alpha_v with the constants of W_tau; VALID: with those of M; IMPROVED: tree-free, from gamma*.
    window : float
        T [s].
    partition : TreePartition, optional
        The spanning tree of PRINTED and VALID; by default the first one of the underlying graph.
    """
    network = scenario.network
    horizon = excitation_horizon(scenario)
    if form is RateForm.IMPROVED:
        factor = signal_factor(scenario, Signal.DISAGREEMENT)
        extremes = window_extremes(factor, scenario.edge_weights, window, horizon)
        return tree_free_rate(extremes, network.gain)
    tree = partition if partition is not None else TreePartition(network.agents, network.underlying_edges)
    signal = Signal.TREE_WEIGHTS if form is RateForm.PRINTED else Signal.TREE_COORDINATES
    extremes = window_extremes(signal_factor(scenario, signal, tree), scenario.edge_weights, window, horizon)
    gamma = tree_contraction(extremes, network.gain, float(tree.Lambda[0]), float(tree.Lambda[-1]), network.agents - 1)
    return rate_of_contraction(gamma, window)


def best_window(
    scenario: Scenario,
    form: RateForm,
    partition: TreePartition | None = None,
    *,
    shortest: float | None = None,
    longest: float | None = None,
) -> BestWindow:
    """Search for the window that gives the largest rate.

    Parameters
    ----------
    scenario, form, partition
        As in `rate_over_window`.
    shortest, longest : float, optional
        Range of the search [s]; by default from a hundredth of the period to three periods, without a period up to half
        the run. For constant weights it must be given: there the rate grows as the window shrinks.

    Raises
    ------
    ValueError
        If no range is given for constant weights, or it is empty.
    """
    period = scenario.edge_weights.period
    if period == 0.0 and (shortest is None or longest is None):
        raise ValueError(
            "the weights are constant, so a shorter window always gives a better rate; give the range to search."
        )
    span = period if period else scenario.stop_time / 6
    low = shortest if shortest is not None else span / 100
    high = longest if longest is not None else 3 * span
    return search_window(
        lambda window: rate_over_window(scenario, form, window, partition), low, high, _natural_windows(scenario, high)
    )


def _natural_windows(scenario: Scenario, longest: float) -> list[float]:
    """Multiples of each part's own period and fractions of the common one: the rate often peaks there, with a kink."""
    weights = scenario.edge_weights
    own = {wave.period for wave in weights.waveforms} | {scenario.switching.period}
    multiples = [k * period for period in own if period for k in range(1, min(_MULTIPLES, int(longest / period)) + 1)]
    return multiples + [weights.period / k for k in range(1, _MULTIPLES + 1) if weights.period]


def search_window(
    rate: Callable[[float], float], shortest: float, longest: float, also: list[float] | None = None
) -> BestWindow:
    """Maximise any rate formula over the length of the window.

    Parameters
    ----------
    rate : callable
        ``rate(window)`` [1/s].
    shortest, longest : float
        Range [s].
    also : list of float, optional
        Windows to try in any case; those outside the range are left out.

    Notes
    -----
    A grid of 48 lengths, spaced evenly in their logarithm, and the windows `also` are tried, then the best three are
    refined between their neighbours. The rate has several maxima in general, so the result is the best one found; it is
    never worse than that of the windows in `also`.
    """
    if not 0 < shortest < longest < np.inf:
        raise ValueError(
            f"the range from {shortest} s to {longest} s is not one of windows; give 0 < shortest < longest."
        )
    extra = [window for window in also or [] if shortest <= window <= longest]
    lengths = np.unique(np.concatenate((np.geomspace(shortest, longest, _GRID), extra)))
    rates = np.array([rate(float(length)) for length in lengths])
    order = np.argsort(-rates, kind="stable")
    best = BestWindow(float(lengths[order[0]]), float(rates[order[0]]))
    if best.rate == 0.0:
        return best
    for place in order[:_REFINED].tolist():
        bounds = (lengths[max(place - 1, 0)], lengths[min(place + 1, len(lengths) - 1)])
        refined = minimize_scalar(lambda window: -rate(float(window)), bounds=bounds, method="bounded")
        if -float(refined.fun) > best.rate:
            best = BestWindow(float(refined.x), -float(refined.fun))
    return best
