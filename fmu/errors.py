"""What goes wrong in exporting, by kind; each message names the thing, the value, the rule and the remedy."""


class ExportError(RuntimeError):
    """An automaton cannot become an FMU as it is."""


class BuildError(RuntimeError):
    """An FMU could not be compiled or packaged; the message says why and what to do."""
