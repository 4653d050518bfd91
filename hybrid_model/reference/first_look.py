"""A first look at a run before its maps are traced."""

from hybrid_model.reference.execution import Execution


def checked(start: Execution) -> None:
    """Call the maps at the start with numbers, those of the flow where a run would flow from there."""
    if start.due() is None and start.x.size and start.in_flow_set() and start.t_stop > start.t:
        start.rates_at(start.t, start.x)
