"""Rooted trees, one for each condition that a Runge-Kutta method of some order meets.

E. Hairer, S. P. Norsett, G. Wanner, "Solving Ordinary Differential Equations I", section II.2.
"""

import functools
import itertools

import numpy as np

__all__ = ["density", "size", "trees"]


@functools.cache
def trees(order):
    """Rooted trees of so many nodes, each as the sorted tuple of the trees at its root."""
    if order == 1:
        return [()]
    found = set()
    for first in range(1, order):
        for tree, rest in itertools.product(trees(first), trees(order - first)):
            found.add(tuple(sorted((tree, *rest))))
    return sorted(found)


def size(tree):
    """How many nodes a tree has."""
    return 1 + sum(map(size, tree))


def density(tree):
    """Its gamma: the weights of an exact step sum up to 1/gamma."""
    return size(tree) * int(np.prod([density(branch) for branch in tree]))
