#!/usr/bin/env bash
# NetworkX's algebraic_connectivity with method="lanczos" gives the third eigenvalue of a chain for the second.
#
# The algebraic connectivity is the second smallest eigenvalue of a graph's Laplacian; four methods are offered for it,
# with a tolerance of 1e-8. A good engineer expects that they differ in speed and in the last digits. On a chain of 60
# agents three of them agree with 2 - 2 cos(pi/60), and Lanczos gives the next eigenvalue, four times as large, whatever
# the seed: it takes two values of a search for the smallest ones, in which one was skipped, and nothing looks whether
# there is another between them. Chains of 80 and more give the one or the other from run to run, with the same seed. A
# tolerance of 1e-12 cures it. With the eigenvector go fiedler_vector, spectral_bisection, which cuts the chain in three
# pieces where two are asked for, and spectral_ordering, which leads from one end to the other in one hop. Who is hurt:
# all who read the speed of a consensus or the cut of a network off it; small and dense graphs, as in tests, are right.
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

AGENTS = 60
chain = nx.path_graph(AGENTS)
exact = 2 - 2 * np.cos(np.pi * np.arange(1, 3) / AGENTS)
print(f"NetworkX {nx.__version__}: a chain of {AGENTS} agents")
print(f"  second and third eigenvalue, exactly: {exact[0]:.9f}, {exact[1]:.9f}")

found, pieces, hops = {}, {}, {}
for method in ("tracemin_pcg", "tracemin_lu", "lobpcg", "lanczos"):
    values = [nx.algebraic_connectivity(chain, method=method, seed=seed) for seed in range(5)]
    found[method] = values
    print(f"  algebraic_connectivity, {method}, seeds 0 to 4: {', '.join(f'{value:.9f}' for value in values)}")
    halves = nx.spectral_bisection(chain, method=method, seed=0)
    pieces[method] = sum(nx.number_connected_components(chain.subgraph(half)) for half in halves)
    order = nx.spectral_ordering(chain, method=method, seed=0)
    hops[method] = max(abs(first - second) for first, second in zip(order, order[1:]))
    print(f"    spectral_bisection: {pieces[method]} pieces; spectral_ordering: longest hop {hops[method]}")
finer = nx.algebraic_connectivity(chain, method="lanczos", tol=1e-12)
print(f"  lanczos with tol=1e-12: {finer:.9f}")

longer = nx.path_graph(80)
again = [nx.algebraic_connectivity(longer, method="lanczos", seed=0) for _ in range(12)]
print(f"  a chain of 80, lanczos, twelve calls with seed 0: {', '.join(f'{value:.4f}' for value in again)}")

for method, values in found.items():
    right = method != "lanczos"
    if not np.allclose(values, exact[0 if right else 1], rtol=1e-6, atol=0.0):
        sys.exit(1)
    if (pieces[method], hops[method]) != ((2, 1) if right else (3, AGENTS - 1)):
        sys.exit(1)
sys.exit(not np.isclose(finer, exact[0], rtol=1e-6, atol=0.0))
PYTHON
