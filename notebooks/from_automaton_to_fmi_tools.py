# %% [markdown]
# # From an automaton to FMI tools
#
# An FMU is a file that simulation tools run. Here an automaton becomes one, and three tools of other people run it, live: fmpy,
# libcosim (the engine of the Open Simulation Platform) and Ecos. Then two FMUs are coupled.
#
# **What this teaches:** what is in an FMU; what event mode, early return and Model Exchange mean for a model that jumps; which
# answers depend on the communication step, and which do not; why a loop of several FMUs wants a master that stops at events.
#
# fmpy comes with this project, the others with `pip install 'hybrid-fmu[interop]'`.

# %%
import ctypes
import sys
import tempfile
import zipfile
from contextlib import closing
from pathlib import Path

import fmpy
import matplotlib.pyplot as plt
import numpy as np
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

import hybrid_model as hm
from cosim.fmu_slave import FmuSlave
from cosim.masters import run_event_exact, run_fixed_step
from cosim.system import System
from fmu.export import export_fmu
from fmu.validate.check import check_fmu
from hybrid_model.plots import JOURNAL

# The wheel of Ecos needs oneTBB, which the package tbb puts where nobody looks.
for library in Path(sys.prefix, "lib").glob("libtbb.so.*"):
    ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    break
import ecospy  # noqa: E402

log_output_level(CosimLogLevel.FATAL)
ecospy.EcosLib.set_log_level("off")
plt.rcParams.update(JOURNAL)
plt.rcParams.update({"figure.figsize": (6.8, 2.5), "figure.dpi": 110})
folder = tempfile.TemporaryDirectory()
work = Path(folder.name)

# %% [markdown]
# ## 1. The automaton, and its FMU


# %%
class Ball(hm.HybridAutomaton):
    """A ball on a floor; impacts lose energy."""

    h = hm.State(1.0, unit="m", output=True)
    v = hm.State(0.0, unit="m/s", output=True)
    e = hm.Parameter(0.7)

    def flow_map(self, s):
        return {"h": s.v, "v": -9.81}

    def flow_set(self, s):
        return s.h

    def jump_set(self, s):
        return hm.least(-s.h, -s.v)

    def jump_map(self, s):
        return {"h": 0.0, "v": -s.e * s.v}


arc = hm.simulate(Ball(), 2.0)
three = export_fmu(Ball(), work / "Ball.fmu", stop_time=2.0)
two = export_fmu(Ball(), work / "Ball2.fmu", fmi="2.0", stop_time=2.0)
plain = export_fmu(Ball(), work / "BallPlain.fmu", stop_time=2.0, clocks=False)
with zipfile.ZipFile(three) as archive:
    print(*sorted({name.split("/")[0] for name in archive.namelist()}), sep=", ")
    print([name for name in archive.namelist() if name.startswith("binaries")])
print(f"{three.stat().st_size / 1000:.0f} kB, no Python inside")

# %%
for variable in fmpy.read_model_description(str(three)).modelVariables:
    print(f"{variable.name:12} {variable.causality:12} {variable.variability:11} {variable.unit or ''}")

# %% [markdown]
# ## 2. fmpy
#
# In Co-Simulation the FMU brings its solver. Without event mode the impacts happen inside the steps; with it the FMU stops at each,
# and the table has both sides. In Model Exchange fmpy's solver, CVode, integrates, and looks for the zeros of the margins.

# %%
runs = {
    "Co-Simulation": fmpy.simulate_fmu(str(three), output_interval=0.05),
    "with event mode": fmpy.simulate_fmu(
        str(three), output_interval=0.05, use_event_mode=True, early_return_allowed=True
    ),
    "Model Exchange": fmpy.simulate_fmu(
        str(three), fmi_type="ModelExchange", output_interval=0.05, relative_tolerance=1e-10
    ),
}
for name, run in runs.items():
    print(f"{name:16} {len(run)} rows, h off by at most {np.max(np.abs(run['h'] - arc.at('h', run['time']))):.0e} m")

# %%
figure, row = plt.subplots(1, 3, sharey=True, figsize=(6.8, 2.3))
grid = np.linspace(0.3, 0.6, 400)
for ax, (name, run) in zip(row, runs.items(), strict=True):
    ax.plot(grid, arc.at("v", grid), color="0.7", lw=2.5, label="Python")
    ax.plot(run["time"], run["v"], ".-", ms=4, lw=0.7, label="fmpy")
    ax.set(xlim=(0.3, 0.6), xlabel=f"time $t$ (s)\n{name}")
row[0].set_ylabel("velocity $v$ (m/s)")
_ = row[0].legend(loc="upper left")
# %% [markdown]
# ## 3. libcosim
#
# It runs FMI 2.0 at fixed steps, here of 0.1 s: a grid of twenty points, with four impacts between them.

# %%
execution = CosimExecution.from_step_size(100_000_000)  # in ns
ball = execution.add_local_slave(CosimLocalSlave(str(two), "ball"))
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
place = {v.name.decode(): v.reference for v in execution.slave_variables(ball)}
times, heights = [], []
for k in range(1, 21):
    execution.simulate_until(k * 100_000_000)
    times.append(k / 10)
    heights.append(observer.last_real_values(ball, [place["h"]])[0])
print(f"libcosim: h off by at most {np.max(np.abs(heights - arc.at('h', times))):.0e} m")

# %% [markdown]
# ## 4. Ecos
#
# It runs FMI 3.0, and takes every variable for a number, so the FMU is the one exported without clocks.

# %%
structure = ecospy.EcosSimulationStructure()
structure.add_model("ball", str(plain))
simulation = ecospy.EcosSimulation(0.1, structure=structure)
simulation.init()
times, heights = [], []
for k in range(1, 21):
    simulation.step()
    times.append(k / 10)
    heights.append(simulation.get_real("ball::h"))
simulation.terminate()
simulation.free()
print(f"Ecos: h off by at most {np.max(np.abs(heights - arc.at('h', times))):.0e} m")

# %% [markdown]
# All three give the ball of the Python run, whatever the step is, since the FMU takes its jumps by itself.
#
# ## 5. Two FMUs that hear each other
#
# That is not so for several FMUs in a loop. Two lamps charge; one that is full flashes and begins anew, and the other one loses a
# fifth of its charge by that. A flash that is heard late changes when the other one flashes.


# %%
class Lamp(hm.HybridAutomaton):
    """Charges; when it is full it flashes and begins anew, and a flash of the other one takes from it."""

    rate = hm.Parameter(1.0, unit="1/s")
    heard = hm.Input(0.0, discrete=True)
    charge = hm.State(0.0, output=True)
    seen = hm.DiscreteState(0.0)
    flashes = hm.DiscreteState(0.0, output=True)
    flash = hm.Clock("full")

    def flow_map(self, s):
        return {"charge": s.rate * (1.2 - s.charge)}

    transitions = (
        hm.Jump("full", lambda self, s: s.charge - 1.0, lambda self, s: {"charge": 0.0, "flashes": s.flashes + 1}),
        hm.Jump(
            "dimmed",
            lambda self, s: s.heard - s.seen - 0.5,
            lambda self, s: {"seen": s.seen + 1, "charge": 0.8 * s.charge},
        ),
    )


files = {
    name: export_fmu(Lamp(name, rate=rate), work / f"{name}.fmu") for name, rate in {"left": 1.0, "right": 1.3}.items()
}
wires = {"left.heard": "right.flashes", "right.heard": "left.flashes"}


def system():
    return System([FmuSlave(name, path) for name, path in files.items()], wires)


with closing(system()) as lamps:  # which frees the FMUs
    exact = run_event_exact(lamps, 40.0)
whole = hm.simulate(
    hm.Composition("lamps", {name: Lamp(name, rate=rate) for name, rate in {"left": 1.0, "right": 1.3}.items()}, wires),
    40.0,
)
for name in files:
    far = np.max(np.abs(exact.tick_times(name, "flash") - whole.event_times(f"{name}.full")))
    print(f"event-exact: {name:5} flashes {len(exact.tick_times(name, 'flash'))} times, off by {far:.0e} s")
for step in (0.1, 0.01, 0.001):
    with closing(system()) as lamps:
        charges = ["left.charge", "right.charge"]
        late = run_fixed_step(lamps, 40.0, step, record=["left.flashes", *charges], output_interval=1.0)
    grid = np.array(late.times)
    far = max(np.max(np.abs(late.signals[f"{n}.charge"] - whole.at(f"{n}.charge", grid))) for n in files)
    print(f"step {step:5} s: left flashes {int(late.final['left.flashes'])} times, a charge is off by {far:.1e}")

# %%
figure, ax = plt.subplots(figsize=(6.8, 2.0))
grid = np.linspace(0.0, 12.0, 3000)
for name in files:
    ax.plot(grid, whole.at(f"{name}.charge", grid), label=name)
ax.set(xlabel="time $t$ (s)", ylabel="charge", xlim=(0.0, 12.0))
_ = ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
# %% [markdown]
# ## 6. Is it a good FMU?
#
# `hybrid-fmu validate` checks anybody's FMU against the standard, and by short runs in processes of their own.

# %%
report = check_fmu(three)
print(f"{report.fmi_version}, run as {' and '.join(report.executed)}: {len(report.findings)} findings")

# %%
folder.cleanup()

# %% [markdown]
# ## Exercises
#
# 1. Run the ball in fmpy to 4 s. What happens at the Zeno time, and what does fmpy say of it?
# 2. Export `Ball` with `e = hm.Parameter(0.7, tunable=True)` and change it during a run with fmpy's `input`.
# 3. In section 5 give both lamps the same rate. They are symmetric: which of them does the event-exact master let flash first, and
#    which the fixed-step one?
# 4. Take an FMU of somebody else and hold it against `hybrid-fmu validate`. Do you agree with the findings?
