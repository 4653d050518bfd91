"""Masters: event-exact, error-controlled for continuous signals, and fixed-step for comparison and for all others.

They import systems of slaves, and the scheduler of `hybrid_model.schedule`.
"""

from cosim.masters.error_controlled import run_error_controlled
from cosim.masters.event_exact import run_event_exact
from cosim.masters.fixed_step import run_fixed_step

__all__ = ["run_error_controlled", "run_event_exact", "run_fixed_step"]
