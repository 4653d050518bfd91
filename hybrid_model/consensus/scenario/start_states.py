"""Initial states that are given in Python, checked before anything is made of them."""

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from hybrid_model.consensus.messages import ScenarioError, shown

__all__ = ["start_numbers", "start_vectors"]


def start_numbers(name: str, given: npt.ArrayLike, agents: int) -> NDArray[np.float64]:
    """One finite number for each agent.

    Parameters
    ----------
    name : str
        How messages call them.
    given : array_like, shape (agents,)
        The numbers.
    agents : int
        Number of agents n.

    Raises
    ------
    ScenarioError
        If they are no numbers, not finite or not one for each agent.
    """
    numbers = _as_numbers(name, given, "one number for each agent")
    if numbers.shape != (agents,):
        raise ScenarioError(f"the {name} have the shape {numbers.shape} for {agents} agents; give one for each agent.")
    return _finite(name, numbers)


def start_vectors(name: str, given: npt.ArrayLike, agents: int) -> NDArray[np.float64]:
    """One row of finite numbers for each agent, all of one length d >= 1; parameters and errors as `start_numbers`."""
    rows = _as_numbers(name, given, "one row of numbers for each agent, all of one length")
    if rows.ndim != 2 or len(rows) != agents or rows.shape[1] == 0:
        raise ScenarioError(
            f"the {name} have the shape {rows.shape} for {agents} agents; give an array of one row for each agent, "
            "with at least one number in it."
        )
    return _finite(name, rows)


def _as_numbers(name: str, given: npt.ArrayLike, rule: str) -> NDArray[np.float64]:
    try:
        array = np.asarray(given)
    except ValueError:
        raise ScenarioError(f"the {name} have rows of different lengths; give {rule}.") from None
    # An empty list has a kind by chance; other kinds are text, dates, complex numbers, truth values or a mixture.
    if array.size and array.dtype.kind not in "fiu":
        raise ScenarioError(f"the {name} are not all real numbers; give {rule}.")
    return array.astype(np.float64)


def _finite(name: str, array: NDArray[np.float64]) -> NDArray[np.float64]:
    for agent, value in enumerate(array, start=1):
        if not np.all(np.isfinite(value)):
            raise ScenarioError(f"the {name} of agent {agent} hold {shown(value.tolist())}; they must be finite.")
    return array
