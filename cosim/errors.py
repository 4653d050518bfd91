"""What goes wrong in co-simulation; each message names the thing, the value, the rule and the remedy."""


class CosimError(RuntimeError):
    """A slave or the system cannot go on."""


class MisfitError(CosimError, ValueError):
    """Signals do not fit together, or a master cannot treat them exactly."""


class GivenValueError(MisfitError):
    """A value that a run is given from outside does not fit the variable that it is for."""


class UsageError(ValueError):
    """A command was given something that it does not know."""
