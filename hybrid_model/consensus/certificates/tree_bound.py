"""Theorems 1 and 2 along a spanning tree: alpha_v, m_v, rho, C, kappa_1 and kappa_2, as printed and as valid.

The printed bound has steps that do not hold (audit, sections 3 to 5); both forms are computed so that a report can show
them side by side. Time starts at t0 = 0. What rho is made of is in `TreePartition`, with the tree's other matrices.
"""

import enum
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_model.consensus.certificates.rates import rate_of_contraction, tree_contraction
from hybrid_model.consensus.excitation.persistence import ExcitationConstants, Signal, scenario_excitation
from hybrid_model.consensus.excitation.trees import tree_excitations
from hybrid_model.consensus.graphs.spanning_trees import TreePartition
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.trigger import Trigger, TriggerKind

__all__ = [
    "MOST_TREES",
    "BoundForm",
    "ConvergenceBound",
    "TreeRadius",
    "convergence_bound",
    "default_window",
    "tree_radii",
]

MOST_TREES = 200

_SHORT = 0.01
"""``k sqrt(p) ||Lambda|| mu2`` over the window that is chosen for constant weights: short windows lose least."""


class BoundForm(enum.Enum):
    """Which statement of the theorem a bound follows."""

    PRINTED = "printed"
    VALID = "valid"


@dataclass(frozen=True)
class ConvergenceBound:
    """A bound on ``||x_e(t)||`` over the edges of the underlying graph.

    Parameters
    ----------
    form : BoundForm
        PRINTED or VALID.
    window : float
        T [s], the length of the excitation window.
    rate : float
        alpha_v [1/s]; 0.0 if the excitation is not persistent.
    overshoot : float
        ``m_v = sqrt(lambda_max/lambda_min)/sqrt(1 - gamma)``; the paper leaves it open (audit, section 3).
    decay : float
        beta [1/s] of the trigger.
    rho : float
        The factor in ``||x_e|| <= rho ||Upsilon||``, `TreePartition.rho`.
    error_bound : float
        ``C = 2 c sqrt(p)`` in ``||psi e|| <= C exp(-beta t)``.
    transient : float
        ``m_v ||Upsilon(0)||``.
    disturbance : float
        ``k ||Lambda|| m_v C mu2``, with the integrated norm (mu2_bar of M) for mu2 in the valid form.
    kappa1, kappa2 : float or None
        ``||Upsilon|| <= kappa1*exp(-alpha t) + kappa2*exp(-beta t)``; if alpha and beta are equal,
        ``(kappa1 + kappa2*(t/T + 1))*exp(-alpha t)``. None where the form says nothing.
    notes : tuple of str
        Why a form says nothing, in sentences.
    """

    form: BoundForm
    window: float
    rate: float
    overshoot: float
    decay: float
    rho: float
    error_bound: float
    transient: float
    disturbance: float
    kappa1: float | None
    kappa2: float | None
    notes: tuple[str, ...] = ()

    @property
    def rho_kappa2(self) -> float | None:
        """``rho*kappa2``: what ``exp(beta t) ||x_e(t)||`` tends to at most, if beta is below alpha_v; None if none."""
        return None if self.kappa2 is None else self.rho * self.kappa2

    @property
    def radius(self) -> float | None:
        """Bound on ``||x_e(t)||`` for t to infinity: `rho_kappa2` with the static trigger, else 0; None if none."""
        return self.rho_kappa2 if self.decay == 0 or self.kappa2 is None else 0.0

    def at(self, t: ArrayLike) -> NDArray[np.float64]:
        """The bound at times `t` >= 0 [s], in the shape of `t`.

        Raises
        ------
        ValueError
            If the form says nothing about this scenario; the message is that of the notes.
        """
        if self.kappa1 is None or self.kappa2 is None:
            raise ValueError(" ".join(self.notes))
        time = np.asarray(t, dtype=float)
        if self.form is BoundForm.PRINTED:
            state = self.kappa1 * np.exp(-self.rate * time) + self.kappa2 * np.exp(-self.decay * time)
        else:
            # The sum of the geometric series, not kappa1 and kappa2: those cancel when alpha is close to beta.
            slower = min(self.rate, self.decay)
            series = _geometric(abs(self.rate - self.decay), time, self.window)
            state = self.transient * np.exp(-self.rate * time) + self.disturbance * np.exp(-slower * time) * series
        return np.asarray(self.rho * state)


def convergence_bound(
    scenario: Scenario,
    form: BoundForm,
    partition: TreePartition | None = None,
    window: float | None = None,
    constants: ExcitationConstants | None = None,
) -> ConvergenceBound:
    """The rate and the bound of theorems 1 and 2 for one spanning tree.

    Parameters
    ----------
    scenario : Scenario
        Periodic or constant weights.
    form : BoundForm
        PRINTED uses the constants of W_tau throughout, as the theorems say, and needs ``beta < alpha_v``.
        VALID uses those of M and holds for every beta >= 0 (audit, sections 3 and 5.2).
    partition : TreePartition, optional
        The tree, in the underlying graph; by default its first one in edge order.
    window : float, optional
        T [s]; by default `default_window`.
    constants : ExcitationConstants, optional
        Those of W_tau (PRINTED) or M (VALID) for this tree and window, if they are known already.

    Raises
    ------
    ValueError
        If the underlying graph is not connected or the weights are not periodic.
    """
    network, trigger = scenario.network, scenario.trigger
    tree = partition if partition is not None else TreePartition(network.agents, network.underlying_edges)
    length = window if window is not None else default_window(scenario, tree)
    signal = Signal.TREE_WEIGHTS if form is BoundForm.PRINTED else Signal.TREE_COORDINATES
    constants = constants if constants is not None else scenario_excitation(scenario, signal, tree, length)

    smallest, largest = float(tree.Lambda[0]), float(tree.Lambda[-1])
    p = network.agents - 1
    gamma = tree_contraction(constants, network.gain, smallest, largest, p)
    overshoot = math.sqrt(largest / smallest / (1 - gamma))
    error_bound = 2 * trigger.threshold * math.sqrt(p)
    mu2 = constants.mu2 if form is BoundForm.PRINTED else constants.mu2_bar
    rate = rate_of_contraction(gamma, length)
    transient = overshoot * float(np.linalg.norm(tree.psi @ np.asarray(network.initial)))
    disturbance = network.gain * largest * overshoot * error_bound * mu2
    notes = _notes(form, signal, rate, trigger.decay, length)
    kappa1, kappa2 = (None, None) if notes else _kappas(form, rate, trigger.decay, length, transient, disturbance)
    return ConvergenceBound(
        form=form,
        window=length,
        rate=rate,
        overshoot=overshoot,
        decay=trigger.decay,
        rho=tree.rho,
        error_bound=error_bound,
        transient=transient,
        disturbance=disturbance,
        kappa1=kappa1,
        kappa2=kappa2,
        notes=notes,
    )


def default_window(scenario: Scenario, partition: TreePartition) -> float:
    """The window T [s] used unless another is given: the period, or for constant weights a short time."""
    period = scenario.edge_weights.period
    if period is None:
        raise ValueError("the weights have no common period; give the length of the excitation window.")
    if period > 0:
        return period
    per_second = scenario_excitation(scenario, Signal.TREE_COORDINATES, partition, window=1.0).mu2
    speed = scenario.network.gain * math.sqrt(scenario.network.agents - 1) * float(partition.Lambda[-1]) * per_second
    return _SHORT / speed if speed > 0 else 1.0


def _notes(form: BoundForm, signal: Signal, rate: float, decay: float, window: float) -> tuple[str, ...]:
    if rate == 0.0:
        return (
            f"The {form.value} bound needs persistent excitation, but the integral of {signal.value} over a window of "
            f"{window:.6g} s can be singular; choose a longer window or another spanning tree.",
        )
    if form is BoundForm.PRINTED and decay >= rate:
        return (
            f"The printed bound needs beta < alpha_v, but beta is {decay:.6g} and alpha_v is {rate:.6g}; "
            "the valid form covers this case.",
        )
    return ()


def _kappas(
    form: BoundForm, rate: float, decay: float, window: float, transient: float, disturbance: float
) -> tuple[float, float]:
    """kappa1 and kappa2 with t0 = 0: paper, proof of theorem 2, or audit section 5.2 (all three cases of beta)."""
    difference = rate - decay
    if difference == 0.0:
        return transient, disturbance
    total = disturbance / -math.expm1(-abs(difference) * window)
    if form is BoundForm.PRINTED:
        # kappa3 = k ||Lambda|| m C mu2 e^{(alpha-beta)T}/(e^{(alpha-beta)T} - 1), which is `total`.
        return transient - total, math.exp((rate + decay) * window) * total
    rest = math.exp(-abs(difference) * window) * total
    return (transient - rest, total) if difference > 0 else (transient + total, -rest)


def _geometric(difference: float, t: NDArray[np.float64], window: float) -> NDArray[np.float64]:
    """``(1 - e^{-d(t+T)})/(1 - e^{-dT})``, which is ``t/T + 1`` at d = 0."""
    if difference == 0.0:
        return np.asarray(t / window + 1)
    return np.asarray(np.expm1(-difference * (t + window)) / np.expm1(-difference * window))


@dataclass(frozen=True)
class TreeRadius:
    """The bound of theorem 2 along one spanning tree, for the threshold held at c.

    Parameters
    ----------
    tree : tuple of int
        Edges, from 1.
    rate : float
        alpha_v [1/s].
    kappa2 : float
        Bound on ``||Upsilon||`` for t to infinity; depends on the coordinates that the tree gives.
    radius : float
        ``rho kappa2``, a bound on ``||x_e||``, which does not depend on the tree.
    """

    tree: tuple[int, ...]
    rate: float
    kappa2: float
    radius: float


def tree_radii(
    scenario: Scenario, window: float, form: BoundForm = BoundForm.VALID, most: int = MOST_TREES
) -> list[TreeRadius]:
    """The bound of theorem 2 along each exciting spanning tree, for beta = 0: the paper's kappa_2^m and kappa_2^M.

    See audit, sections 5.4 and 8.

    Parameters
    ----------
    scenario : Scenario
        Network, weights, threshold.
    window : float
        T [s], the same for all trees.
    form : BoundForm
        PRINTED (constants of W_tau) or VALID (constants of M).
    most : int
        Trees beyond this number are left out; a complete graph on n agents has ``n**(n - 2)``.
    """
    held = replace(scenario, trigger=Trigger(TriggerKind.STATIC, scenario.trigger.threshold or 1.0))
    found = []
    for excitation in tree_excitations(held, window, most):
        tree = excitation.partition
        bound = convergence_bound(held, form, tree, window)
        if bound.kappa2 is not None:
            found.append(TreeRadius(tree.tree, bound.rate, bound.kappa2, bound.rho * bound.kappa2))
    return found
