# %% [markdown]
# # The edge domain, with python-control
#
# What event triggering does to a network is an *error*: agents act on values that were broadcast some time ago. From these errors to
# the differences between agents there is a linear system, and for linear systems control engineers have tools.
#
# **What this teaches:** to get that system as a `control.StateSpace`; to read its poles, its gain over frequency and its peak gain, and
# what each says about the network; what takes their place when weights change periodically; how exact numbers and certified bounds
# compare; to linearise any automaton.

# %%
from dataclasses import replace

import control
import matplotlib.pyplot as plt
import numpy as np

import hybrid_model as hm
from hybrid_model.consensus import (
    closed_loop,
    compare_edge_domain,
    edge_domain_gains,
    edge_domain_system,
    floquet_spectrum,
    load_scenario,
    period_map,
    periodic_gains,
    read_scenario,
)
from hybrid_model.linear import linearise
from hybrid_model.plots import COLORS, JOURNAL

plt.rcParams.update(JOURNAL)
plt.rcParams.update({"figure.figsize": (6.8, 2.5), "figure.dpi": 110})

# %% [markdown]
# ## 1. The system
#
# With $e = \hat x - x$ the agents obey $\dot x = -k L (x + e)$. The edge states $x_e = D^\top x$ do not see the mean. Along a spanning
# tree they are a minimal state,
#
# $$ \dot x_\tau = -k D_\tau^\top L D_\tau (D_\tau^\top D_\tau)^{-1} x_\tau - k D_\tau^\top L\, e , \qquad x_e = R^\top x_\tau . $$

# %%
ring = read_scenario(
    {
        "name": "ring",
        "stop_time": 40.0,
        "network": {"agents": 5, "graph": "ring", "initial": [1.0, 0.2, -0.4, 0.7, -1.0]},
        "weights": {"kind": "constant", "value": [1.0, 0.6, 0.4, 0.8, 0.5]},
        "trigger": {"kind": "static", "threshold": 0.1},
    }
)
system = edge_domain_system(ring)
print(f"{system.ninputs} errors, {system.nstates} states, {system.noutputs} edges")
print("inputs ", *system.input_labels)
print("outputs", *system.output_labels)
print("poles  ", np.round(np.sort(system.poles().real)[::-1], 4))

# %% [markdown]
# The poles are minus the eigenvalues of $kL$ without the zero one: the network converges at the slowest.

# %%
n = ring.network.agents
laplacian = np.zeros((n, n))
for (i, j), weight in zip(ring.network.edges, (1.0, 0.6, 0.4, 0.8, 0.5), strict=True):
    d = np.zeros(n)
    d[i - 1], d[j - 1] = 1.0, -1.0
    laplacian += weight * np.outer(d, d)
print("eigenvalues of L", np.round(np.linalg.eigvalsh(laplacian), 4))

# %% [markdown]
# ## 2. Gains
#
# Over frequency the largest singular value falls from its value at zero: constant errors are the worst sinusoidal ones. But errors
# are bounded by the threshold at every time, and jump; for that the *peak gain* counts, the largest edge states over all errors
# with $|e_i| \le 1$.

# %%
gains = edge_domain_gains(ring)
omega = np.logspace(-2, 2, 200)
largest = [np.linalg.svd(system(1j * w), compute_uv=False)[0] for w in omega]
figure, (left, right) = plt.subplots(1, 2)
left.loglog(omega, largest)
left.axhline(gains.h_infinity, color="0.6", ls="--", lw=0.8)
left.set(xlabel=r"frequency $\omega$ (rad/s)", ylabel="largest singular value")
response = control.step_response(system)
for k in range(system.noutputs):
    right.plot(response.time, response.outputs[k, 0], color=COLORS[k], label=f"edge {k + 1}")
right.set(xlabel="time $t$ (s)", ylabel="$x_e$ for $e_1 = 1$")
right.legend(fontsize=7)
incidence = np.zeros((n, len(ring.network.edges)))
for k, (i, j) in enumerate(ring.network.edges):
    incidence[i - 1, k], incidence[j - 1, k] = -1.0, 1.0
print(f"H-infinity norm {gains.h_infinity:.5f}, norm of the incidence matrix {np.linalg.norm(incidence, 2):.5f}")
print(f"peak gains of the edges {np.round(gains.peaks, 4)}")
print(f"exact radius for |e_i| <= 1: {gains.radius:.6f}")

# %% [markdown]
# ## 3. Does a run keep to it?
#
# With the threshold $c = 0.1$ no edge state may in the end be larger than $c$ times its peak gain.

# %%
arc = hm.simulate(closed_loop(ring), ring.stop_time)
times = np.linspace(20.0, 40.0, 4000)
x = np.stack([arc.at(f"agent{i}.x", times) for i in range(1, n + 1)])
edges = np.stack([x[i - 1] - x[j - 1] for i, j in ring.network.underlying_edges])
for k, (seen, bound) in enumerate(zip(np.abs(edges).max(axis=1), 0.1 * gains.peaks, strict=True), start=1):
    print(f"edge {k}: at most {seen:.4f} in the run, {bound:.4f} by the peak gain")
print(f"norm: {np.linalg.norm(edges, axis=0).max():.4f} in the run, {0.1 * gains.radius:.4f} exact")

# %% [markdown]
# The peak gain is reached by the worst errors that the threshold allows. A trigger does not play against its own network, so a run
# stays below.
#
# ## 4. Weights that change: Floquet
#
# For periodic weights there are no poles. Their place is taken by the eigenvalues of the *monodromy matrix*, what one period does to
# the disagreement; the map over one period is a discrete system of python-control.

# %%
paper = load_scenario("paper-a")
spectrum = floquet_spectrum(paper)
once = period_map(paper)
print(f"period {spectrum.period:.6f} s, multipliers {np.round(np.abs(spectrum.multipliers), 6)}")
print(f"exact rate {spectrum.rate:.6f} 1/s")
print(f"poles of the period map {np.round(np.sort(np.abs(once.poles()))[::-1], 6)}, dt = {once.dt:.6f} s")
exact = periodic_gains(paper)
print(f"peak radius {exact.radius:.4f}, L2 gain {exact.l2:.4f}")

# %% [markdown]
# How fast it converges depends on how long each graph stays:

# %%
rates = []
for number in range(1, 17):
    # The weights have the period pi: with such dwells they have a common one with the switching.
    dwell = number * np.pi / 8
    switched = replace(paper, switching=replace(paper.switching, dwell=dwell))
    rates.append((dwell, floquet_spectrum(switched).rate))
figure, ax = plt.subplots(figsize=(4.6, 2.4))
ax.plot(*zip(*rates, strict=True), "o-", ms=3)
_ = ax.set(xlabel="dwell time of each graph (s)", ylabel="exact rate (1/s)", ylim=(0.0, None))
# %% [markdown]
# ## 5. Exact numbers beside bounds
#
# The paper bounds the same things by constants of excitation along a tree: the rate from below, the radius from above.

# %%
compared = compare_edge_domain(load_scenario("paper-a-static"))
print(f"rate   exact {compared.rate:.4f} 1/s, " + ", ".join(f"{f.value} {a:.2e}" for f, a in compared.alpha.items()))
print(
    f"radius exact {compared.radius:.4f}, "
    + ", ".join(f"{f.value} {r:.3g}" for f, r in compared.rho_kappa2.items() if r is not None)
)

# %% [markdown]
# ## 6. Any automaton
#
# The flow of any automaton between two jumps is a system of python-control too; its derivatives are exact.


# %%
class Pendulum(hm.HybridAutomaton):
    """A pendulum with a motor."""

    torque = hm.Input(0.0)
    angle = hm.State(0.0, output=True)
    speed = hm.State(0.0)

    def flow_map(self, s):
        return {"angle": s.speed, "speed": -9.81 * np.sin(s.angle) - 0.4 * s.speed + s.torque}


hanging, upright = linearise(Pendulum()), linearise(Pendulum(), {"angle": np.pi})
print("hanging: poles", np.round(hanging.poles(), 4))
print("upright: poles", np.round(upright.poles(), 4))
gain, _, closed = control.lqr(upright, np.diag([10.0, 1.0]), np.eye(1))
print("LQR gain", np.round(gain, 4), "closed-loop poles", np.round(closed, 4))

# %% [markdown]
# ## Exercises
#
# 1. Remove an edge of the ring. Which of poles, H-infinity norm and peak gain change, and in which direction? Explain the one that does
#    not.
# 2. Find errors that reach the peak gain of an edge (they switch sign with the impulse response). Simulate them with
#    `control.forced_response`.
# 3. In section 4, why is the rate not monotone in the dwell time?
# 4. Close the loop of `Pendulum` with the LQR gain as a *sampled* controller (`docs/automata.md`, known times). From which sampling
#    period on does it fall?
