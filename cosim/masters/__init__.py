"""Masters: event-exact, and fixed-step for comparison and for slaves without event mode.

They import systems of slaves, and the scheduler of `hybrid_model.schedule`.
"""

from cosim.masters.event_exact import run_event_exact
from cosim.masters.fixed_step import run_fixed_step

__all__ = ["run_event_exact", "run_fixed_step"]
