# %% [markdown]
# # Sweeps and trade-offs
#
# A threshold saves broadcasts and costs agreement. How much of each? One run says nothing about that; a *sweep* runs a scenario
# many times with other values under its keys.
#
# **What this teaches:** to run a sweep and to go on with one that was interrupted; to read a map of the results; to draw a trade-off
# that is fair; not to trust a single run of an event-triggered system.

# %%
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import hybrid_model as hm
from hybrid_model.consensus import closed_loop, load_scenario, run_savings
from hybrid_model.consensus.figures.study import plot_events_against_radius, plot_heat_map
from hybrid_model.consensus.sweeps.execute import run_sweep
from hybrid_model.consensus.sweeps.study import study
from hybrid_model.plots import COLORS, JOURNAL

plt.rcParams.update(JOURNAL)
plt.rcParams.update({"figure.figsize": (6.8, 2.6), "figure.dpi": 110})
folder = tempfile.TemporaryDirectory()
work = Path(folder.name)

# %% [markdown]
# ## 1. A grid
#
# The paper's example with 9 thresholds and 6 decays. Each run is a row of a table in one file; `run_sweep` uses a process a
# processor unless it is told otherwise, here a thread. The closed loop is compiled once and then run with other numbers.

# %%
wanted = study("paper-a", ["trigger.threshold=0.1:0.9:9", "trigger.decay=0:0.15:6"])
executor = ThreadPoolExecutor(1)
table = run_sweep(wanted, work / "grid.sqlite", executor=executor)
print(f"{len(table)} runs, {table.failures} failed")
for name in ("events", "gap_min", "ultimate", "settling"):
    values = table.column(name).astype(float)
    print(f"{name:10} from {np.nanmin(values):.4g} to {np.nanmax(values):.4g}")

# %%
figure, (left, right) = plt.subplots(1, 2)
plot_heat_map(table, "events", ax=left)
_ = plot_heat_map(table, "ultimate", ax=right)
# %% [markdown]
# Broadcasts do not simply fall with the threshold, nor rise with the decay: the map is rough. An event that comes a little earlier
# makes another run (that is why a fixed step is no substitute for locating events). So judge by many runs.
#
# A sweep that was interrupted is gone on with by the same call; what is there is not run again.

# %%
table.close()
again = run_sweep(wanted, work / "grid.sqlite", executor=executor)
print(f"{len(again)} runs, {len(again.missing())} missing")

# %% [markdown]
# ## 2. What a broadcast buys
#
# Each run is a point: broadcasts against the largest disagreement in the last quarter. Whoever wants less of both takes a run on the
# lower left border, the *Pareto front*.

# %%
events, late = again.column("events").astype(float), again.column("ultimate").astype(float)
decay = again.column("trigger.decay").astype(float)
order = np.lexsort((late, events))
front, best = [], np.inf
for k in order:
    if late[k] < best:
        front.append(k)
        best = late[k]
figure, ax = plt.subplots(figsize=(4.6, 2.9))
points = ax.scatter(events, late, c=decay, s=12, cmap="viridis")
ax.step(events[front], late[front], where="post", color="0.3", lw=0.8)
ax.set(xlabel="broadcasts", ylabel="largest $d$ in the last quarter", yscale="log")
figure.colorbar(points, label=r"decay $\beta$ (1/s)")
print(
    f"{len(front)} of {len(events)} runs are on the front; their decays: {sorted({float(round(d, 3)) for d in decay[front]})}"
)

# %% [markdown]
# ## 3. What a certificate costs
#
# A designer who needs a *guarantee* picks the threshold by a bound, not by a run. The distance between the two is what the proof costs.

# %%
again.close()
static = study("paper-a-static", ["trigger.threshold=0.05:1:6:log"], bounds=["radius.observed", "radius.energy"])
certified = run_sweep(static, work / "certified.sqlite", executor=executor)
figure, ax = plt.subplots(figsize=(4.6, 2.9))
plot_events_against_radius(certified, ax=ax)
ax.legend()
share = certified.column("radius.energy").astype(float) / certified.column("radius.observed").astype(float)
print(f"the energy bound is {share.min():.1f} to {share.max():.1f} times what the run shows")

# %% [markdown]
# ## 4. Against a clock
#
# The simplest rival broadcasts periodically. At equal rate, who agrees better? At equal agreement, who sends more? The periodic agents
# may choose their gain, else every trigger would look good (`docs/savings.md`).

# %%
certified.close()
for name in ("paper-a-static", "paper-a"):
    scenario = load_scenario(name)
    savings = run_savings(scenario, hm.simulate(closed_loop(scenario), scenario.stop_time))
    print(f"{name}: {savings.events} broadcasts")
    for measure, needed in savings.needed.items():
        print(f"    {measure.value:42} periodic agents need {needed if needed is not None else '-'}")

# %% [markdown]
# The static trigger loses by every measure that it has. The dynamic one wins where it reacts at once to the large disagreement at
# the start.
#
# ## 5. How rough is it?
#
# The same law, and start values that differ by little: how different are the runs?

# %%
scenario = load_scenario("paper-a")
loop = closed_loop(scenario)
random = np.random.default_rng(1)
counts = []
for _ in range(40):
    start = np.array(scenario.network.initial) * (1 + 0.01 * random.standard_normal(4))
    run = hm.simulate(loop, scenario.stop_time, starts={f"agent{i + 1}.x": x for i, x in enumerate(start)})
    counts.append(sum(len(run.event_times(f"agent{i}.trigger.broadcast")) for i in range(1, 5)))
figure, ax = plt.subplots(figsize=(4.6, 2.2))
ax.hist(counts, bins=np.arange(min(counts) - 0.5, max(counts) + 1.5), color=COLORS[0])
ax.axvline(35, color=COLORS[1], label="the run of the paper's start")
ax.set(xlabel="broadcasts of a run, start values changed by 1 %", ylabel="runs")
ax.legend()
print(f"mean {np.mean(counts):.1f}, standard deviation {np.std(counts):.1f}")

# %%
executor.shutdown()
folder.cleanup()

# %% [markdown]
# ## Exercises
#
# 1. Sweep `network.gain` and the threshold together. Does a larger gain need more broadcasts?
# 2. `--repeats` runs each point with seeds of its own. Write a scenario with drawn start values (`docs/scenarios.md`) and draw the front
#    of section 2 from means over 20 runs. Is it smoother?
# 3. Add `radius.exact` to section 3. What does it cost in time, and how far is it from the observed radius?
# 4. In section 5 use the static trigger. Which of the two is rougher?
