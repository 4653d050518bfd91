# %% [markdown]
# # Hybrid automata from scratch
#
# A hybrid automaton *flows* along a differential equation and *jumps* now and then. Its run is a **hybrid arc**: states over
# hybrid time $(t, j)$, where $t$ counts seconds and $j$ counts jumps.
#
# **What this teaches:** to write automata with one jump and with several, with known times and with modes; to say what happens
# where flow and jump are both allowed; to recognise Zeno behaviour and chattering, and what to do about each.

# %%
import matplotlib.pyplot as plt
import numpy as np

import hybrid_model as hm
from hybrid_model.plots import (
    JOURNAL,
    plot_hybrid_arc,
    plot_inter_event_times,
    plot_over_time,
    plot_phase,
    plot_time_domain,
)

plt.rcParams.update(JOURNAL)
plt.rcParams.update({"figure.figsize": (6.8, 2.4), "figure.dpi": 110})

# %% [markdown]
# ## 1. One jump
#
# A ball falls from 1 m and keeps 70 % of its speed at an impact:
#
# $$
# \dot h = v, \quad \dot v = -g,
# \qquad\qquad
# h^+ = 0, \quad v^+ = -e\,v \quad \text{when } h \le 0 \text{ and } v \le 0 .
# $$
#
# Where it jumps is told by a *margin*, a number that is $\ge 0$ inside the jump set. A number and not true or false, since the
# program looks for the instant at which it becomes zero. `hm.least` is "and".


# %%
class Ball(hm.HybridAutomaton):
    """A ball on a floor; impacts lose energy."""

    h = hm.State(1.0, unit="m")
    v = hm.State(0.0, unit="m/s")
    e = hm.Parameter(0.7)

    def flow_map(self, s):
        return {"h": s.v, "v": -9.81}

    def jump_set(self, s):
        return hm.least(-s.h, -s.v)

    def jump_map(self, s):
        return {"h": 0.0, "v": -s.e * s.v}


ball = hm.simulate(Ball(), t_end=2.0)
print("from (t, j)          to (t, j)            v before    v after")
for jump in ball.jumps:
    before, after = ball.before(jump).v, ball.after(jump).v
    print(f"({jump.t:.9f}, {jump.j})  ->  ({jump.t:.9f}, {jump.j + 1})  {before:9.5f}  {after:9.5f}")
print(f"first impact, error: {abs(ball.jumps[0].t - np.sqrt(2 / 9.81)):.0e} s")

# %% [markdown]
# At an impact the velocity has two values at the same $t$, which differ in $j$. So nothing is lost: a variable is a function of
# $(t, j)$ where it would not be one of $t$. In all plots an open marker is the value before a jump and a filled one the value
# after it.

# %%
figure = plt.figure(figsize=(6.8, 4.6))
plot_over_time(ball, "v", ax=figure.add_subplot(2, 2, 1))
plot_time_domain(ball, ax=figure.add_subplot(2, 2, 2))
plot_phase(ball, "h", "v", ax=figure.add_subplot(2, 2, 3))
_ = plot_hybrid_arc(ball, "h", ax=figure.add_subplot(2, 2, 4, projection="3d"))

# %% [markdown]
# ## 2. Several jumps, and known times
#
# A tank leaks. A pump goes on at a low level and off at a high one: two jumps on the state. Every 10 s somebody notes the level:
# a jump at a *known time*, which follows from a count. `transitions` holds them all; where several are due at one instant they
# are taken in this order, one after the other.


# %%
class Tank(hm.HybridAutomaton):
    """A tank with a pump and a log."""

    level = hm.State(0.5, unit="m")
    pump = hm.DiscreteState(0, integer=True)
    noted = hm.DiscreteState(0.5, unit="m")
    count = hm.DiscreteState(1, integer=True)

    def flow_map(self, s):
        return {"level": 0.12 * s.pump - 0.05}

    transitions = (
        hm.Jump("on", lambda self, s: hm.least(0.2 - s.level, 0.5 - s.pump), lambda self, s: {"pump": 1}),
        hm.Jump("off", lambda self, s: hm.least(s.level - 0.8, s.pump - 0.5), lambda self, s: {"pump": 0}),
        hm.TimeEvent("note", lambda self, s: 10.0 * s.count, lambda self, s: {"noted": s.level, "count": s.count + 1}),
    )


tank = hm.simulate(Tank(), t_end=60.0)
for name in ("on", "off", "note"):
    print(f"{name:5} {np.round(tank.event_times(name), 6)} s")
axes = plot_over_time(tank, "level", "noted", jumps=["on", "off", "note"])

# %% [markdown]
# By hand: the level falls by 0.3 m at 0.05 m/s, so the pump goes on at 6 s; then it rises by 0.6 m at 0.07 m/s and falls by as
# much at 0.05 m/s, over and over.

# %%
cycle = 0.6 / 0.07 + 0.6 / 0.05
print(f"a cycle is {cycle:.6f} s; the run is off by {np.max(np.abs(np.diff(tank.event_times('on')) - cycle)):.0e} s")

# %% [markdown]
# ## 3. Modes
#
# The same thing can be said with *modes* (locations): each has its flow and its invariant, and *switches* lead from one to
# another, each with a guard and perhaps a reset. Here is a ball that comes to rest: an impact that is slow enough leads to the
# mode `resting`.


# %%
class RestingBall(hm.ModalAutomaton):
    """Flies, bounces, and rests after an impact slower than 0.5 m/s."""

    h = hm.State(1.0, unit="m")
    v = hm.State(0.0, unit="m/s")

    modes = (
        hm.Mode("flying", lambda self, s: {"h": s.v, "v": -9.81}),
        hm.Mode("resting"),
    )
    switches = (
        hm.Switch(
            "rest",
            "flying",
            "resting",
            guard=lambda self, s: hm.least(-s.h, -s.v, s.v + 0.5),
            reset=lambda self, s: {"h": 0.0, "v": 0.0},
        ),
        hm.Switch(
            "bounce",
            "flying",
            "flying",
            guard=lambda self, s: hm.least(-s.h, -s.v - 0.5),
            reset=lambda self, s: {"h": 0.0, "v": -0.7 * s.v},
        ),
    )


rest = hm.simulate(RestingBall(), t_end=3.0)
print([jump.name for jump in rest.jumps])
print(f"rests from t = {rest.event_times('rest')[0]:.6f} s on; the run ends with {rest.stop.name} at {rest.t[-1]} s")
figure, (left, right) = plt.subplots(1, 2)
plot_over_time(rest, "h", ax=left)
_ = plot_over_time(rest, "mode", ax=right)

# %% [markdown]
# ## 4. Where flow and jump are both allowed
#
# The next automaton may flow while $x \le 2$ and may jump to 0 when $x \ge 1$. Between 1 and 2 it may do either: as a system it
# has many runs. A simulation picks one by its *priority*.


# %%
class Overlap(hm.HybridAutomaton):
    """Flows up to 2, may jump from 1 on."""

    x = hm.State(0.0)

    def flow_map(self, s):
        return {"x": 1.0}

    def flow_set(self, s):
        return 2.0 - s.x

    def jump_set(self, s):
        return s.x - 1.0

    def jump_map(self, s):
        return {"x": 0.0}


class Patient(Overlap):
    """The same system, flowing while it can."""

    priority = hm.Priority.FLOW


figure, row = plt.subplots(1, 2, sharey=True)
for ax, automaton in zip(row, (Overlap(), Patient()), strict=True):
    arc = hm.simulate(automaton, t_end=6.5)
    print(f"priority {automaton.priority.name:4}  jumps at {np.round(arc.event_times('jump'), 9)} s")
    plot_over_time(arc, "x", ax=ax)
    ax.set_title(f"priority {automaton.priority.name}", fontsize=9)

# %% [markdown]
# ## 5. Zeno: infinitely many jumps
#
# Each flight of the ball is $e$ times as long as the one before, so there are infinitely many impacts before the *Zeno time*
# $t^* = \sqrt{2h_0/g}\,(1+e)/(1-e)$. A simulation that goes on jumping never gets past it; one that misses an impact lets the
# ball fall through the floor. Here the run stops and says what it saw.

# %%
zeno = hm.simulate(Ball(), t_end=10.0)
print(zeno.stop.name)
print(zeno.message)
print(f"exact: t* = {np.sqrt(2 / 9.81) * 1.7 / 0.3:.9f} s")
figure, (left, right) = plt.subplots(1, 2)
plot_time_domain(zeno, ax=left)
_ = plot_inter_event_times(zeno, ax=right)
# %% [markdown]
# To go on past $t^*$, say what happens then: a mode, as `resting` above, or a *minimum dwell time* between jumps, which changes
# the model a little, and counts how often it did.

# %%
dwelling = hm.simulate(hm.MinimumDwell(Ball(), 0.02), t_end=3.0)
print(f"{dwelling.stop.name} after {len(dwelling.event_times('jump'))} impacts")

# %% [markdown]
# ## 6. Chattering: a flow that leads back
#
# Dry friction, written as a sign, is no jump of the state but one of its *rate*: at rest the flow from both sides leads back. A
# solver would make ever smaller steps there. The run is given up, with the place, the two rates and the remedy.


# %%
class Friction(hm.HybridAutomaton):
    """A mass braked by a force of constant size."""

    v = hm.State(1.0, unit="m/s")

    def flow_map(self, s):
        return {"v": -np.sign(s.v)}


try:
    hm.simulate(Friction(), t_end=3.0)
except hm.SimulationError as error:
    print(error)


# %% [markdown]
# The remedy, as it says, are modes, with one of their own for what stays. Here the mass is pulled with a force that grows: it
# stops, sticks, and slides again when the pull overcomes the friction at rest, which is the larger one. (Were both alike, it
# would stick and slide in turn, at one instant: try it.)


# %%
class Sticking(hm.ModalAutomaton):
    """Friction of size 1, and of 1.2 at rest, against a pull of 0.4 t."""

    v = hm.State(1.0, unit="m/s")

    modes = (
        hm.Mode("sliding", lambda self, s: {"v": 0.4 * s.t - 1.0}),
        hm.Mode("sticking"),
    )
    switches = (
        hm.Switch("stick", "sliding", "sticking", lambda self, s: hm.least(-s.v, 1.0 - 0.4 * s.t)),
        hm.Switch("slide", "sticking", "sliding", lambda self, s: 0.4 * s.t - 1.2),
    )


stick = hm.simulate(Sticking(v=0.8), t_end=5.0)
print(f"stands from {stick.event_times('stick')[0]:.6f} s to {stick.event_times('slide')[0]:.6f} s")
print(f"by hand: 0.2 t^2 - t + 0.8 = 0 at {(1 - np.sqrt(1 - 0.64)) / 0.4:.6f} s, and 0.4 t = 1.2 at 3 s")
axes = plot_over_time(stick, "v")

# %% [markdown]
# ## Exercises
#
# 1. Give `Tank` a third jump, `alarm`, when the level falls below 0.1 m, and let the pump fail after 40 s. Does the order of the
#    tuple matter?
# 2. Let the floor of `Ball` rise with 0.1 m/s (use `s.t`). What must the jump map do so that the ball stays above the floor?
# 3. The gaps of a Zeno run form a geometric series. Estimate $t^*$ from the last three impacts of `zeno.event_times("jump")`. How
#    many digits do you get?
# 4. `MinimumDwell` with 0.02 s: where does the ball go between two impacts that are held apart? Plot it.
# 5. Write `Sticking` with a pull of $1.5 \sin t$. When does it stick, and when does it slide again?
