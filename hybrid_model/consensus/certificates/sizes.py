"""What would take too long: estimates of time and memory from sizes alone, before anything is begun.

Most of `certify` grows like the cube of the number of agents at worst. The exact worst case, the exact contraction and
the bounds along all spanning trees grow faster. In networks of `LARGE` agents or more they are computed where the
estimate says that they take no longer than the caller's patience; in any network only where they fit into the memory.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

import numpy as np

from hybrid_model.consensus.exact.transition_grid import dose_between
from hybrid_model.consensus.graphs.undirected import weighted_laplacian
from hybrid_model.consensus.scenario.definition import Scenario

__all__ = [
    "LARGE",
    "Cost",
    "contraction_cost",
    "mean_speed",
    "memory_limit",
    "overshoot_cost",
    "trees_cost",
    "worst_case_cost",
]

LARGE = 16
"""Agents from which on time counts."""

# As the modules have them that do the work.
_MOST_CELLS, _MOST_BLOCKS, _COARSE = 20_000, 256, 0.05
_FLOAT = 8
# In s, of one core; measured on rings of 8 to 30 agents, right to a factor of two there.
_PER_SUPPORT = 5.5e-6
_PER_NORM, _PER_NORM_OF_CUBE, _DOUBLINGS = 2e-5, 8e-10, 8
_PER_TREE, _PER_CUBE = 0.02, 8e-8


@dataclass(frozen=True)
class Cost:
    """What something takes.

    Attributes
    ----------
    seconds : float
        Of CPU time.
    memory : float
        In bytes.
    """

    seconds: float
    memory: float

    def __str__(self) -> str:
        """As a sentence says it."""
        seconds = self.seconds
        for unit, length in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
            if seconds >= 2 * length:
                return f"about {seconds / length:.0f} {unit} and {self.memory / 2**30:.1g} GiB"
        return f"about {seconds:.0f} s and {self.memory / 2**30:.1g} GiB"


def memory_limit() -> float:
    """Half of the memory of the machine, in bytes; infinity where it does not say."""
    try:
        return 0.5 * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return math.inf


def worst_case_cost(scenario: Scenario, cycle: float, decay: float, resolution: float, speed: float) -> Cost:
    """Of `hybrid_model.consensus.exact.worst_case.worst_case`.

    Parameters
    ----------
    scenario : Scenario
        Whose worst case.
    cycle : float
        Length [s] of its period.
    decay, resolution : float
        beta [1/s], and the resolution of the grid.
    speed : float
        ``k ||N||`` [1/s], its mean over the cycle.
    """
    # Of constant weights a time is taken in which the fastest mode is seen.
    constant = scenario.edge_weights.period == 0.0
    length = min(cycle, 1 / speed) if constant and speed > 0 else cycle
    cells = min(_MOST_CELLS, length * max(speed, decay) / resolution + len(scenario.edge_weights.pieces(0.0, length)))
    n, edges = scenario.network.agents, len(scenario.network.edges)
    rows = cells * n
    return Cost(_PER_SUPPORT * rows * n * edges, _FLOAT * (3 * cells * n**2 + 6 * rows * n))


def contraction_cost(scenario: Scenario, cycle: float, resolution: float, speed: float) -> Cost:
    """Of the exact contraction over periods, and some powers of two of them; parameters as `worst_case_cost`."""
    cells = min(_MOST_CELLS, cycle * speed / resolution + len(scenario.edge_weights.pieces(0.0, cycle)))
    return Cost(_DOUBLINGS * cells * _norm(scenario), 6 * _FLOAT * cells * scenario.network.agents**2)


def overshoot_cost(scenario: Scenario, cycle: float, speed: float) -> Cost:
    """Of the factor of the Floquet rate; parameters as `worst_case_cost`."""
    cells = cycle * speed / _COARSE + len(scenario.edge_weights.pieces(0.0, cycle))
    blocks = min(_MOST_BLOCKS, cells)
    memory = 4 * _FLOAT * min(_MOST_CELLS, cells) * scenario.network.agents**2
    return Cost(2 * blocks**2 * _norm(scenario), memory)


def _norm(scenario: Scenario) -> float:
    """Time [s] of the spectral norm of a matrix of that many agents."""
    return _PER_NORM + _PER_NORM_OF_CUBE * scenario.network.agents**3


def trees_cost(scenario: Scenario, most: int) -> Cost:
    """Of bounds along so many spanning trees of the listed edges, or all if there are fewer."""
    network = scenario.network
    matrix = weighted_laplacian(network.agents, network.edges, np.ones(len(network.edges)))[1:, 1:]
    # The number itself leaves the range of floats.
    sign, logarithm = np.linalg.slogdet(matrix)
    count = min(float(most), math.exp(min(float(logarithm), 700.0))) if sign > 0 else 0.0
    return Cost(count * (_PER_TREE + _PER_CUBE * network.agents**3), 10 * _FLOAT * network.agents**2)


def mean_speed(scenario: Scenario, cycle: float) -> float:
    """``k ||N||`` [1/s], its mean over the cycle."""
    return dose_between(scenario, 0.0, cycle) / cycle
