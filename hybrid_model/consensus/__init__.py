"""Event-triggered consensus of single integrators over time-varying graphs."""
