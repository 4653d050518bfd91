"""A scenario of three agents on a path, as people write it."""

_TEXT = """
name = "small"
stop_time = {stop_time}
[network]
agents = 3
edges = [[1, 2], [2, 3]]
initial = [1.0, 0.0, -0.4]
[weights]
kind = "constant"
value = {value}
[trigger]
kind = "{kind}"
{threshold}
{more}
"""


def small_scenario(stop_time=5.0, value="1.0", kind="static", threshold="threshold = 0.2", more=""):
    """Return the TOML of the scenario, with some entries changed."""
    return _TEXT.format(stop_time=stop_time, value=value, kind=kind, threshold=threshold, more=more)
