#!/usr/bin/env bash
# NetworkX's laplacian_spectrum takes one half of a directed graph's Laplacian, which one depends on the node order.
#
# laplacian_matrix makes the Laplacian of a directed graph from its out-degrees, and laplacian_spectrum is to give the
# eigenvalues of the Laplacian; its notes speak of directed multigraphs too. A good engineer expects those of that
# matrix: they say how fast agents that hear each other in one direction agree, and whether they swing. The function
# calls a solver for symmetric matrices, which reads the lower triangle and takes the rest for its mirror image. A ring
# of four in which each hears the next has 0, 1 + i, 1 - i and 2; the answer is 0, 1, 1, 2, or -0.62, 0.38, 1.62, 2.62
# if the nodes were added the other way round: no swing, or a negative one, which no Laplacian with positive weights
# has. normalized_laplacian_spectrum does the same. Who is hurt: everybody who reads rates of consensus, spanning trees
# (a single 0) or limits of step sizes off the spectrum of a network with directed links.
#
# Needs python3 with venv. Ends with status 0 if NetworkX still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'networkx==3.6.1' 'scipy==1.17.1' 'numpy==2.4.6'

"$work/env/bin/python" - <<'PYTHON'
import sys

import networkx as nx
import numpy as np

AGENTS = 4
exact = {
    "ring": 1 - np.exp(2j * np.pi * np.arange(AGENTS) / AGENTS),
    "chain": np.array([0.0, *(AGENTS - 1) * [1.0]], dtype=complex),
}


def graph(shape, nodes):
    """Each agent hears the next one; the last of a chain hears nobody. nodes: the order in which they are added."""
    made = nx.DiGraph()
    made.add_nodes_from(nodes)
    made.add_edges_from((k, (k + 1) % AGENTS) for k in range(AGENTS if shape == "ring" else AGENTS - 1))
    return made


def shown(values):
    return ", ".join(f"{value:.4g}" for value in np.sort_complex(np.round(values, 6) + 0.0))


def differs(values, other):
    return bool(np.max(np.abs(np.poly(values) - np.poly(other))) > 1e-6)


print(f"NetworkX {nx.__version__}: eigenvalues of Laplacians of {AGENTS} agents")
wrong = {}
for shape, values in exact.items():
    print(f"  {shape}, exactly: {shown(values)}")
    for name, nodes in (("as they are linked", range(AGENTS)), ("the other way round", reversed(range(AGENTS)))):
        links = graph(shape, nodes)
        matrix = nx.laplacian_matrix(links).toarray()
        # Polynomials are compared, since multiple eigenvalues have only a root of the precision.
        assert not differs(np.linalg.eigvals(matrix), values)
        answer = nx.laplacian_spectrum(links)
        wrong[shape, name] = differs(answer, values)
        print(f"    laplacian_spectrum, nodes added {name}: {shown(answer)}")
lowest = min(nx.laplacian_spectrum(graph("ring", reversed(range(AGENTS)))))
sys.exit(not (all(wrong[k] for k in wrong if k != ("chain", "as they are linked")) and lowest < -0.6))
PYTHON
