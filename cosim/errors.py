"""What goes wrong in co-simulation; each message names the thing, the value, the rule and the remedy."""


class CosimError(RuntimeError):
    """A slave or the system cannot go on."""


class MisfitError(CosimError, ValueError):
    """Signals do not fit together, or a master cannot treat them exactly."""


class UsageError(ValueError):
    """A command was given something that it does not know."""
