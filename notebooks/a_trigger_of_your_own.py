# %% [markdown]
# # A trigger of your own
#
# A trigger law says when an agent broadcasts. This notebook designs one, runs it in the paper's network, promises something about
# it and has the promise certified, and takes it out as an FMU.
#
# **What this teaches:** how a law is written (a class with one margin); what a run of it is measured by, and what a fair comparison
# with another law is; which promises give which bounds; what goes wrong with a law whose margin is not negative after a broadcast.

# %%
import tempfile
from dataclasses import replace
from pathlib import Path

import fmpy
import matplotlib.pyplot as plt
import numpy as np

import hybrid_model as hm
from fmu.export import export_fmu
from hybrid_model.consensus import (
    EventGenerator,
    OwnTrigger,
    Threshold,
    certify,
    closed_loop,
    load_scenario,
    run_metrics,
    run_report,
    scenario_agents,
)
from hybrid_model.plots import COLORS, JOURNAL

plt.rcParams.update(JOURNAL)
plt.rcParams.update({"figure.figsize": (6.8, 2.5), "figure.dpi": 110})
scenario = load_scenario("paper-a")

# %% [markdown]
# ## 1. The law
#
# The paper's dynamic trigger broadcasts when $|\hat x - x| \ge c\,e^{-\beta t}$. An exponential soon asks for very small errors. Here
# is a slower one, $c/(1 + rt)$. `EventGenerator` brings the agent's state `x`, its last broadcast value and the jump map `send`;
# what is left is a margin: zero or above when it is time.


# %%
class Hyperbolic(EventGenerator):
    """Broadcasts when |e| >= c/(1 + rate t)."""

    c = hm.Parameter(0.5)
    rate = hm.Parameter(0.1, unit="1/s")

    def error_too_large(self, s):
        return np.abs(s.broadcast - s.x) - s.c / (1 + s.rate * s.t)

    transitions = (hm.Jump("broadcast", error_too_large, EventGenerator.send),)

    def error_bound(self, s):
        return Threshold(s.c)  # the promise: |e| <= c at all times


own = closed_loop(scenario, trigger=Hyperbolic)
arc = hm.simulate(own, scenario.stop_time)
print(arc.engine)
print(arc.stop.name)

# %% [markdown]
# It is compiled like the laws that come with the package, and its events are located likewise. Beside the paper's own:

# %%
laws = {
    "static": load_scenario("paper-a-static"),
    "dynamic": scenario,
    "hyperbolic": closed_loop(scenario, trigger=Hyperbolic),
}
runs = {}
for name, law in laws.items():
    loop = law if name == "hyperbolic" else closed_loop(law)
    run = hm.simulate(loop, scenario.stop_time)
    runs[name] = run
    report = run_report(scenario, run)
    measures = run_metrics(scenario, run)
    print(
        f"{name:10} {sum(report.events_per_agent):3d} events {report.events_per_agent}, shortest gap {report.min_gap:.4f} s, "
        f"integral of d^2 {measures['integral']:.3f}, largest d late {measures['ultimate']:.4f}"
    )

# %%
figure, (left, right) = plt.subplots(1, 2)
t = np.linspace(0.0, scenario.stop_time, 500)
for color, name, level in (
    (COLORS[1], "dynamic", 0.5 * np.exp(-0.06 * t)),
    (COLORS[2], "hyperbolic", 0.5 / (1 + 0.1 * t)),
):
    left.plot(t, level, color=color, label=name)
    x = np.stack([runs[name].at(f"agent{i}.x", t) for i in range(1, 5)])
    right.semilogy(t, np.linalg.norm(x - x.mean(axis=0), axis=0), color=color, label=name)
left.set(xlabel="time $t$ (s)", ylabel="threshold")
right.set(xlabel="time $t$ (s)", ylabel="disagreement $d$")
_ = left.legend()
# %% [markdown]
# ## 2. A fair comparison
#
# One law with other numbers is another law. So vary its numbers, and plot what it costs against what it gives: each point is a run.
# Lower and further left is better.

# %%
numbers = {
    "dynamic": [(c, beta) for c in (0.2, 0.35, 0.5) for beta in (0.02, 0.06, 0.1)],
    "hyperbolic": [(c, rate) for c in (0.2, 0.35, 0.5) for rate in (0.05, 0.1, 0.3)],
}
names = {"dynamic": ("threshold", "decay"), "hyperbolic": ("c", "rate")}
loops = {"dynamic": closed_loop(scenario), "hyperbolic": own}
figure, ax = plt.subplots(figsize=(4.2, 2.8))
for color, marker, (law, values) in zip(COLORS[1:], "os", numbers.items(), strict=False):
    points = []
    for pair in values:
        # One automaton serves all runs: its parameters are given anew, and nothing is compiled again.
        starts = {f"agent{i}.{key}": value for i in range(1, 5) for key, value in zip(names[law], pair, strict=True)}
        run = hm.simulate(loops[law], scenario.stop_time, starts=starts)
        points.append((sum(run_report(scenario, run).events_per_agent), run_metrics(scenario, run)["ultimate"]))
    ax.plot(*zip(*points, strict=True), marker, color=color, markersize=4, label=law)
    print(law, [(count, round(float(far), 4)) for count, far in points])
ax.set(xlabel="broadcasts", ylabel="largest $d$ in the last quarter", yscale="log")
_ = ax.legend()
# %% [markdown]
# Neither law is better at all numbers of broadcasts. That is how such comparisons usually end.
#
# ## 3. Promises and what follows from them
#
# `error_bound` promises that $|\hat x - x|$ never exceeds a function $c_0 + c\,e^{-\beta t}$, here a constant. `certify` takes that at
# its word and gives radii. Is the promise kept? Look at the run.

# %%
promised = OwnTrigger(law=Hyperbolic, values={"c": 0.3})
mine = load_scenario("paper-a")
loop = closed_loop(mine, trigger=promised)
run = hm.simulate(loop, mine.stop_time)
errors = [np.abs(run[f"agent{i}.broadcast"] - run[f"agent{i}.x"]).max() for i in range(1, 5)]
print(f"largest errors {np.round(errors, 6)}, promised 0.3")

# %%
certificates = certify(replace(mine, trigger=promised), run)
for form in ("valid", "improved", "energy", "exact", "observed"):
    value = certificates.value("radius", form)
    print(f"radius of ||x_e||, {form:9} {'-' if value is None else format(value, '.4g')}")

# %% [markdown]
# ## 4. A law that does not work
#
# After a broadcast the error is zero. If the margin is not negative then, the law broadcasts again at the same instant, and again.


# %%
class TooEager(EventGenerator):
    """Broadcasts when |e| >= share |x|, as relative laws do for a plant; at x = 0 there is no error small enough."""

    share = hm.Parameter(0.3)
    transitions = (
        hm.Jump(
            "broadcast", lambda self, s: np.abs(s.broadcast - s.x) - s.share * np.abs(s.x - 1.0), EventGenerator.send
        ),
    )


eager = hm.simulate(closed_loop(scenario, trigger=TooEager), scenario.stop_time)
print(eager.stop.name)
print(eager.message)

# %% [markdown]
# Agent 1 starts at 1, where this margin is zero without any error. A floor mends that: $|\hat x - x| \ge 0.3\,|x - 1| + 0.05$.
#
# ## 5. The agent as an FMU
#
# The law goes along when an agent is exported; no Python is needed to run it.

# %%
with tempfile.TemporaryDirectory() as folder:
    agent = scenario_agents(replace(mine, trigger=promised))["agent1"]
    file = export_fmu(agent, Path(folder) / "agent1.fmu", stop_time=10.0)
    outputs = fmpy.simulate_fmu(str(file), output=["x", "broadcast", "events"], output_interval=0.1)
    alone = hm.simulate(agent, 10.0)
    print(
        f"{file.name}: events {int(outputs['events'][-1])} in the FMU, {len(alone.event_times('trigger.broadcast'))} in Python"
    )
    print(f"x differs by at most {np.max(np.abs(outputs['x'] - alone.at('x', outputs['time']))):.0e}")

# %% [markdown]
# ## Exercises
#
# 1. Give `Hyperbolic` a `least_error`, what the error has reached at every broadcast, as a `Threshold`. It must be a lower bound of
#    $c/(1 + rt)$ over the whole run. Which bounds does `certify` then give?
# 2. Put the floor into `TooEager`. How many events has the run, and where do the agents end?
# 3. Write a law that uses what it hears: an input `neighbours` of the length `degree`, and a threshold that is larger while the
#    neighbours' broadcasts are far away.
# 4. In section 2, find numbers with which the hyperbolic law beats the dynamic one at 40 broadcasts, or convince yourself that there
#    are none.
