"""What goes wrong, by kind; each message names the thing, the value, the rule and the remedy."""


class HybridModelError(Exception):
    """Base of the errors that this package raises."""


class DeclarationError(HybridModelError, AttributeError, ValueError):
    """An automaton is declared, instantiated or used in a way that its declaration does not allow."""


class WiringError(HybridModelError, ValueError):
    """Parts of a composition do not fit together."""


class AlgebraicLoopError(HybridModelError, ValueError):
    """Outputs of a composition depend on each other without a state in between."""


class SimulationError(HybridModelError, RuntimeError):
    """A run cannot start or go on: bad arguments, or a value that is not finite."""


class TraceError(HybridModelError, TypeError):
    """A map cannot be traced with symbols: it does with a value what only a number allows."""


class DataError(HybridModelError, ValueError):
    """Data from outside, in a table or a file, are not what they must be."""


class MissingFileError(DataError, FileNotFoundError):
    """A file that is to be read is not there."""


class SchedulingError(HybridModelError, RuntimeError):
    """Blocks that meet at events contradict what they announced, or iterate without end."""


class BuildError(HybridModelError, RuntimeError):
    """Generated or kept C could not be compiled: there is no compiler, or it fails."""


class NamingError(HybridModelError, LookupError):
    """A module, a file or a name in it that a user named cannot be found."""


class ImportFailedError(HybridModelError, ImportError):
    """A module or a file that a user named fails when it is imported."""
