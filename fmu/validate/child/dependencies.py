"""Dependencies: an unknown has no derivative with respect to a known that its dependencies leave out."""

from __future__ import annotations

import math
from typing import Any

from fmu.validate.child.calls import Recorder
from fmu.validate.child.interface_types import instantiate, run_of

STRUCTURE = "FMI 2.0.4 section 2.2.8; FMI 3.0.2 section 2.4.8: attribute dependencies"
_PAIRS = 60
"""Pairs of an unknown and a known that are looked at alone."""


def dependencies(fmu: Any, recorder: Recorder) -> None:
    """Ask for the directional derivatives with respect to all knowns that are left out; where there is one, name it."""
    instantiate(fmu, recorder)
    run = run_of(fmu, recorder)
    run.begin()
    run.advance(1)
    # The standard does not say that a zero, which nobody needs, can be asked for.
    fmu.lenient = True
    pairs = 0
    for unknown, reference, knowns in fmu.plan["left_out"] if not run.ended else ():
        # Seeds of different sizes do not cancel by chance.
        seed = [1.0 + 0.37 * math.sqrt(k) for k in range(len(knowns))]
        if fmu.directional([reference], [known for _, known in knowns], seed)[0] == 0.0:
            continue
        for name, known in knowns[: _PAIRS - pairs]:
            pairs += 1
            slope = _slope(fmu, reference, known)
            if slope:
                recorder.find(
                    "error",
                    "run.dependency",
                    f"The dependencies of {unknown!r} leave out {name!r}, but the directional derivative with respect "
                    f"to it is {slope!r} at t = {run.t!r}: list every known that an unknown depends on.",
                    STRUCTURE,
                )
    fmu.free()


def _slope(fmu: Any, unknown: int, known: int) -> float:
    """Return a derivative; zero for the noise of differences, which is not linear in the seed."""
    one, two, less = (fmu.directional([unknown], [known], [seed])[0] for seed in (1.0, 2.0, -0.5))
    linear = math.isclose(two, 2.0 * one, rel_tol=1e-4) and math.isclose(less, -0.5 * one, rel_tol=1e-4)
    return one if linear and math.isfinite(one) else 0.0
