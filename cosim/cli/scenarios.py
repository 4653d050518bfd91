"""The scenario that a command is given, told apart from the other things that users have."""

from __future__ import annotations

from pathlib import Path

from cosim.errors import UsageError
from hybrid_model.consensus.scenario.definition import Scenario
from hybrid_model.consensus.scenario.files import load_scenario
from hybrid_model.named_objects import is_target

__all__ = ["scenario_of"]


def scenario_of(given: str) -> Scenario:
    """Load the scenario that a command was given.

    Parameters
    ----------
    given : str
        Name of a preset or path of a TOML file.

    Raises
    ------
    UsageError
        If it is an FMU or an automaton; names the commands for these.
    ScenarioError
        If there is no such scenario, or it breaks a rule.
    """
    kind = Path(given).suffix.lower()
    if kind == ".fmu":
        raise UsageError(
            f"{given} is an FMU, and this command takes a scenario: 'hybrid-fmu cosim {given}' runs it, "
            f"'hybrid-fmu validate {given}' checks it."
        )
    if is_target(given) or kind == ".py":
        named = given if is_target(given) else f"{given}:ClassName"
        raise UsageError(
            f"{given} is code, and this command takes a scenario: 'hybrid-fmu export {named} --out DIR' makes an FMU "
            "of an automaton, and hybrid_model.simulate runs one."
        )
    return load_scenario(given)
