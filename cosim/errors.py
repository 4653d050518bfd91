"""What goes wrong in co-simulation; each message names the thing, the value, the rule and the remedy."""


class CosimError(RuntimeError):
    """A slave or the system cannot go on."""


class MisfitError(CosimError, ValueError):
    """Signals do not fit together, or a master cannot treat them exactly."""


class GivenValueError(MisfitError):
    """A value that a run is given from outside does not fit the variable that it is for."""


class TimesError(MisfitError):
    """The times of a run make no sense, or do not fit a slave.

    Attributes
    ----------
    of : tuple of str
        Which of them are, as `cosim.systems.definition.Experiment` calls them.
    """

    def __init__(self, message: str, *of: str) -> None:
        super().__init__(message)
        self.of = of


class UsageError(ValueError):
    """A command was given something that it does not know."""
