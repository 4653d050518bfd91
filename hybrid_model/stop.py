"""Why runs end."""

import enum


class Stop(enum.Enum):
    """The reason a run ended; the value is the remedy, the run's message has the particulars."""

    HORIZON = "The end time was reached."
    ZENO = (
        "Jumps accumulate: end the run before the accumulation time, give the automaton a minimum dwell time "
        "(MinimumDwell), or model what happens after the accumulation as a mode of its own."
    )
    JUMPS = (
        "The budget of jumps is used up: raise ZenoGuard.max_jumps if so many are right; else look for events that "
        "grow ever denser, such as a threshold that decays faster than the states converge."
    )
    BLOCKED = (
        "The state is in neither set: enlarge the flow set or the jump set where the message says, "
        "or make the jump map land in one of them."
    )
