"""Generate model.c of an FMU: the model, and what the interface needs of its description."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from fmu.describe.variables import FmuVariable
from hybrid_model.native.assembly_code import assembly_code
from hybrid_model.native.c_text import array, boolean, definition, row, string
from hybrid_model.native.model_code import model_code
from hybrid_model.native.names import NameTable
from hybrid_model.native.networks.network import NetworkTrace
from hybrid_model.native.trace import Trace


def fmu_code(traced: Trace | NetworkTrace, variables: Sequence[FmuVariable], token: str, kinds: Collection[str]) -> str:
    """Return the C source of an FMU's model and of its description.

    Parameters
    ----------
    traced : Trace or NetworkTrace
        The automaton's maps.
    variables : sequence of FmuVariable
        In the order of their value references.
    token : str
        Instantiation token.
    kinds : collection of str
        ``"cs"``, ``"me"``: what the FMU offers.

    Returns
    -------
    str
        A C99 translation unit that defines ``const Model model`` and, after fmu/interface/description.h,
        ``const Description description``.
    """
    names = NameTable()
    table = array("Variable", "variables", (_variable(variable, names) for variable in variables))
    fields = {
        "token": string(token),
        "co_simulation": boolean("cs" in kinds),
        "model_exchange": boolean("me" in kinds),
        "n_variables": len(variables),
        "variables": "variables",
        "names": "variable_names",
    }
    parts = assembly_code(traced) if "cs" in kinds and isinstance(traced, NetworkTrace) else None
    fields["assembly"] = "NULL" if parts is None else "&assembly"
    described = [table, names.definition("variable_names"), definition("Description", "description", fields)]
    return "\n".join(
        [model_code(traced, by_parts=parts is not None), parts or "", '#include "description.h"', "", *described]
    )


def _variable(variable: FmuVariable, names: NameTable) -> str:
    kind = (variable.type.value, variable.bank.value)
    flags = map(boolean, (variable.discrete, variable.calculated, variable.tunable))
    return row(names.entry(variable.name), variable.index, variable.size, *kind, *flags)
