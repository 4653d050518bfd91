#!/usr/bin/env bash
# Importing PathSim changes how matplotlib draws the figures of everything else in the process.
#
# A good engineer expects that `import pathsim` draws nothing and changes no setting of another library: styles are the
# user's, and matplotlib has contexts for those who want their own for a while. PathSim applies matplotlib's style
# "fast" when it is imported, for its plotter of running simulations, and leaves it applied. Lines are simplified to a
# whole pixel from then on, in place of a ninth: dashes move and curves shift a little. Who is hurt: who compares figures
# with kept ones, for they differ by what was imported before, and who draws steep or dense signals for print.
#
# Needs python3 with venv. Ends with status 0 if PathSim still does so, 1 if not.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/env"
"$work/env/bin/pip" install --quiet --disable-pip-version-check 'pathsim==0.27.1' 'matplotlib==3.11.2'

MPLBACKEND=agg MPLCONFIGDIR="$work" "$work/env/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

import matplotlib
import matplotlib.pyplot as plt
import numpy as np


def picture():
    """The pixels of a dashed wave."""
    figure, axes = plt.subplots(figsize=(3, 2), dpi=150)
    t = np.linspace(0.0, 1.0, 2000)
    axes.plot(t, np.sin(40.0 * t) * t, "--")
    figure.canvas.draw()
    pixels = np.array(figure.canvas.buffer_rgba())
    plt.close(figure)
    return pixels


NAMES = ("path.simplify_threshold", "agg.path.chunksize")
settings, before = [matplotlib.rcParams[name] for name in NAMES], picture()
import pathsim  # noqa: E402, F401

found, after = [matplotlib.rcParams[name] for name in NAMES], picture()
print(f"PathSim {version('pathsim')}, matplotlib {version('matplotlib')}")
for name, old, new in zip(NAMES, settings, found):
    print(f"{name}: {old:.4g} before the import, {new:.4g} after it")
print(f"pixels of one and the same figure that differ: {int(np.any(before != after, axis=2).sum())}")
sys.exit(0 if settings != found and np.any(before != after) else 1)
PYTHON
