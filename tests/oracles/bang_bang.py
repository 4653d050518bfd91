"""Worst errors by brute force: an adjoint equation for their signs, then the closed loop with those errors.

Independent of the package's sums over cells: weights are evaluated, and differential equations solved step by step.
"""

import numpy as np
from scipy.linalg import expm

from hybrid_model.consensus.graphs.undirected import disagreement_basis, weighted_laplacian


def reached(scenario, direction, t_end, span, decay=0.0, steps_per_piece=60):
    """States xi(t_end) after errors ``|e_i| <= exp(-decay t)`` that push along `direction` (p,) for the time `span`."""
    network, weights = scenario.network, scenario.edge_weights
    U = disagreement_basis(network.agents)
    start = t_end - span
    shift = 0.0
    period = weights.period or 1.0
    while start + shift < 0:
        shift += period
    times = [start + shift]
    for piece in weights.pieces(start + shift, t_end + shift):
        count = 1 if piece.is_idle else steps_per_piece
        times += np.linspace(piece.start, piece.end, count + 1)[1:].tolist()
    times = np.array(times)
    middles, lengths = (times[1:] + times[:-1]) / 2, np.diff(times)
    laplacians = [
        network.gain * weighted_laplacian(network.agents, network.edges, weights.value(float(t))) for t in middles
    ]
    # Backward: z' = k N z, z(t_end) = direction; the worst error opposes L z.
    flows = [expm(-U.T @ L @ U * h) for L, h in zip(laplacians, lengths, strict=True)]
    z, signs = direction.copy(), []
    for L, flow in zip(reversed(laplacians), reversed(flows), strict=True):
        half = z + flow.T @ z
        signs.append(-np.sign(L @ U @ half))
        z = flow.T @ z
    # Forward with these errors, relative to exp(-decay t_end).
    xi = np.zeros(U.shape[1])
    ages = t_end + shift - middles
    for L, flow, sign, age in zip(laplacians, flows, reversed(signs), ages, strict=True):
        N = U.T @ L @ U
        error = sign * np.exp(decay * age)
        # Constant error on the step: xi' = -N xi - U^T L e; N and U^T L U agree, so the fixed point is -U^T e.
        fixed = -(U.T @ error)
        xi = fixed + flow @ (xi - fixed) if N.any() else xi
    return xi
