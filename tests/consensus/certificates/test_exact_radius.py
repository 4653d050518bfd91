"""The exact radius near its edge: admissible errors drive networks up to it and never beyond, and known cases agree.

The runs here share nothing with the sums over cells: fine steps from the exact integrals of the weights, an adjoint
equation for the signs of the errors, then the network under these errors. Every such run is admissible, so no reported
supremum may lie below what it reaches; and a search from many directions and times must come close to the supremum.
"""

import math

import numpy as np
import pytest
from certificate_networks import WEIGHTS, drawn_scenario
from certified import network
from scipy.integrate import quad
from scipy.linalg import expm

from hybrid_model.consensus.certificates.analysis import analyse
from hybrid_model.consensus.certificates.bounds import Bounds
from hybrid_model.consensus.certificates.certify import certify
from hybrid_model.consensus.excitation.persistence import Signal, signal_factor
from hybrid_model.consensus.graphs.undirected import disagreement_basis, incidence

# What a sum over cells of k int ||N|| <= 0.01 lacks, and the steps of the runs here, second order both.
SHORT = 2e-4
# Power iteration from a few directions at the worst time finds the largest distance up to this.
FOUND = 0.02


class Driven:
    """One period of a network, or its run, in fine steps; errors ``|e_i| <= exp(-decay t)`` constant on each."""

    def __init__(self, scenario, decay, steps=300):
        network, weights = scenario.network, scenario.edge_weights
        period = weights.period
        self.periodic, self.decay = period is not None, decay
        self.length = scenario.stop_time if period is None else period or 1.0
        cuts = np.concatenate(([0.0], weights.breakpoints(0.0, self.length), [self.length]))
        counts = np.maximum(np.ceil(steps * np.diff(cuts) / self.length), 4).astype(int)
        inner = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(cuts[:-1], cuts[1:], counts, strict=True)]
        self.times = np.append(np.concatenate(inner), self.length)
        factor = signal_factor(scenario, Signal.DISAGREEMENT)
        doses = weights.integral(self.times[:-1], self.times[1:])
        self.flows = expm(-network.gain * (factor * doses[:, None, :]) @ factor.T)
        self.U = disagreement_basis(network.agents)
        D = self.U.T @ incidence(network.agents, network.underlying_edges)
        self.form = D @ D.T
        product = np.eye(len(factor))
        for flow in self.flows:
            product = flow @ product
        contraction = float(np.max(np.abs(np.linalg.eigvals(product))))
        forgotten = math.log(1e-4) / (math.log(max(contraction, 1e-12)) + decay * self.length)
        self.cycles = math.ceil(forgotten) if self.periodic else 1

    def reach(self, place, directions):
        """``||x_e||`` and xi at ``times[place]``, times ``exp(decay t)``, after errors that push along directions.

        Each column is a direction, and a run.
        """
        count, signs, z = len(self.flows), [], directions
        total = self.cycles * count if self.periodic else place
        order = [(place - 1 - k) % count for k in range(total)]
        for j in order:
            earlier = self.flows[j].T @ z
            # -int phi k N U' e ds = -(z - earlier) . U' e
            signs.append(-np.sign(self.U @ (z - earlier)))
            z = earlier
        xi, lengths = np.zeros_like(z), np.diff(self.times)
        age = sum(lengths[j] for j in order)
        for j, sign in zip(reversed(order), reversed(signs), strict=True):
            # Over the step the threshold falls; the errors keep to its least value.
            age -= lengths[j]
            fixed = -(self.U.T @ (sign * math.exp(self.decay * age)))
            xi = fixed + self.flows[j] @ (xi - fixed)
        return np.sqrt(np.sum(xi * (self.form @ xi), axis=0)), xi

    def largest(self, random, places, starts, rounds=3):
        """The farthest point that the search finds."""
        best = 0.0
        for place in places:
            directions = random.standard_normal((starts, len(self.form))).T
            for _ in range(rounds):
                values, xi = self.reach(int(place), directions)
                best, directions = max(best, values.max()), self.form @ xi
        return best


def search(seed, weights, agents, *, times, starts):
    random = np.random.default_rng(seed)
    scenario = drawn_scenario(random, agents, weights=weights, stop_time=5.0)
    analysis = analyse(scenario, window=None if scenario.edge_weights.period is not None else 2.0)
    rate = Bounds(analysis).floquet_rate
    decay = float(random.choice([0.0, 0.5])) * (rate or 0.3)
    worst = analysis.worst(decay)
    driven = Driven(scenario, decay)
    if driven.cycles > 40:
        return None
    here = int(np.argmin(np.abs(driven.times - worst.time))) if driven.periodic else len(driven.times) - 1
    places = [here, *random.integers(len(driven.flows) // 2, len(driven.flows), times)]
    reached = driven.largest(random, places, starts)
    assert reached <= worst.radius * (1 + SHORT)
    edges = list(scenario.network.edges)
    along = np.stack([driven.U[i - 1] - driven.U[j - 1] for i, j in edges], axis=1)
    apart = np.abs(np.sum(along * driven.reach(here, along)[1], axis=0))
    assert np.all(apart <= [worst.pairs[pair] * (1 + SHORT) for pair in edges])
    return reached / worst.radius


@pytest.mark.parametrize(
    "weights", [w if w in ("gated-sine", "sampled") else pytest.param(w, marks=pytest.mark.long) for w in WEIGHTS]
)
def test_errors_reach_the_exact_radius_and_no_more(weights):
    """Quickly for weights that wave, and for those that are given by values; below each kind has its closed form."""
    share = search(31, weights, 4, times=0, starts=8)
    assert share is not None
    assert share > 1 - FOUND


@pytest.mark.parametrize(("weights", "seed"), [pytest.param("sine", 104, marks=pytest.mark.long), ("piecewise", 101)])
def test_the_farthest_of_many_local_maxima_is_found(weights, seed):
    """Six agents: some forty maxima over directions; and widths of pairs that are largest at several times."""
    share = search(seed, weights, 6, times=4, starts=20)
    assert share is not None
    assert share > 1 - FOUND


@pytest.mark.long
@pytest.mark.parametrize("weights", WEIGHTS)
def test_no_search_finds_errors_beyond_the_exact_radius(weights):
    found = [search(seed, weights, 6, times=2, starts=8) for seed in range(100, 112)]
    near = [share for share in found if share is not None]
    print(weights, len(near), min(near), max(near))
    assert len(near) >= 7
    # With up to six agents a few directions may all lead to lesser maxima: most of the searches come near.
    assert np.median(near) > 1 - FOUND
    assert min(near) > 1 - 5 * FOUND


def driven(edges, weights, decay=0.0, gain=1.0):
    """A threshold of 0.3 that may decay."""
    return network(edges, weights, trigger={"kind": "dynamic", "threshold": 0.3, "decay": decay}, gain=gain)


TWO = {
    "constant": {"kind": "constant", "value": 0.7},
    "gated-sine": {"kind": "gated-sine", "gate_rate": 4.0, "sine_rate": 5.0, "duty_percent": 40.0},
    "sine": {"kind": "sine", "mean": 0.6, "depth": 1.0, "rate": 3.0},
    "square": {"kind": "square", "high": 2.0, "gate_rate": 3.0, "duty_percent": 30.0},
    "piecewise": {"kind": "piecewise", "starts": [0.0, 0.4, 1.1], "values": [[1.0, 0.0, 2.0]], "cycle": 1.7},
    "sampled": {"kind": "sampled", "times": [0.0, 0.4, 1.1], "values": [[1.0, 0.0, 1.0]], "repeat": True},
}


class TestTwoAgents:
    """One edge: the largest difference is ``2c`` times the total variation of ``exp(-2k int w)``, weighted."""

    @pytest.mark.parametrize("kind", TWO)
    def test_without_decay_it_is_twice_the_threshold(self, kind):
        assert certify(driven([[1, 2]], TWO[kind])).value("radius", "exact") == pytest.approx(0.6, rel=1e-9)

    @pytest.mark.parametrize("kind", TWO)
    def test_with_decay_by_quadrature(self, kind):
        scenario = driven([[1, 2]], TWO[kind], gain=0.8)
        period = scenario.edge_weights.period or 1.0
        mean = float(scenario.edge_weights.integral(0.0, period)[0]) / period
        rate = 2 * 0.8 * mean
        decay = 0.5 * rate
        found = certify(driven([[1, 2]], TWO[kind], decay, gain=0.8)).value("radius", "exact")
        weights = scenario.edge_weights

        def reached(t):
            def integrand(s):
                dose = float(weights.integral(t - s, t)[0])
                return 1.6 * float(weights.value(t - s)[0]) * math.exp(decay * s - 1.6 * dose)

            cuts = np.sort(t - weights.breakpoints(t - period, t))
            one = sum(
                quad(integrand, a, b, epsabs=1e-10)[0] for a, b in zip([0.0, *cuts], [*cuts, period], strict=True)
            )
            return 0.6 * one / (1 - math.exp(-(rate - decay) * period))

        # The supremum lies where weight ends, or inside for smooth weights.
        times = np.concatenate((np.linspace(0, period, 41), weights.breakpoints(0.0, period)))
        values = [reached(t) for t in times]
        assert max(values) <= found * (1 + SHORT)
        # 41 times miss a smooth maximum by a share of less than (pi/40)^2/2.
        assert max(values) == pytest.approx(found, rel=4e-3)


class TestCompleteGraphs:
    """Equal weights w on a complete graph: N is ``n w I``, so the set is the box's image times ``nkw/(nkw - beta)``."""

    @pytest.mark.parametrize("n", [3, 4, 5, 8])
    @pytest.mark.parametrize("share", [0.0, 0.6])
    def test_constant(self, n, share):
        edges = [[i, j] for i in range(1, n + 1) for j in range(i + 1, n + 1)]
        rate = n * 0.5
        scenario = driven(edges, {"kind": "constant", "value": 0.5}, share * rate)
        box = math.sqrt(4 * (n // 2) * ((n + 1) // 2) / n)
        expected = 0.3 * math.sqrt(n) * box / (1 - share)
        # The cells follow the decay, too: second order in 0.01.
        assert certify(scenario).value("radius", "exact") == pytest.approx(expected, rel=1e-4)


def test_a_path_of_three_by_its_modes():
    """Constant weights on a path: the support function from two exponentials, its maximum over a circle."""
    scenario = driven([[1, 2], [2, 3]], {"kind": "constant", "value": 1.0})
    U = disagreement_basis(3)
    D = incidence(3, scenario.network.edges)
    N = U.T @ D @ D.T @ U
    t = np.concatenate((np.linspace(0, 3, 6001), np.linspace(3, 30, 6001)[1:]))
    rates, modes = np.linalg.eigh(N)
    flows = modes @ (np.exp(-rates * t[:, None])[:, :, None] * modes.T)

    def support(direction):
        return float(np.abs(np.diff(flows @ direction @ U.T, axis=0)).sum())

    angles = np.linspace(0, np.pi, 721)
    best = max(support(U.T @ D @ np.array([math.cos(a), math.sin(a)])) for a in angles)
    # 721 angles miss the maximum by (pi/1440)^2/2 of it.
    assert certify(scenario).value("radius", "exact") == pytest.approx(0.3 * best, rel=1e-5)
