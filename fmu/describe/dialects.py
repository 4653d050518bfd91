"""What the versions of the standard call things in a model description: the one table of their differences.

What our FMUs can do, and how each version calls that, is in `fmu.standard.capabilities`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fmu.describe.variables import Fmi, FmiType


@dataclass(frozen=True)
class Dialect:
    """What a version of the standard calls things, and how it refers to variables.

    Attributes
    ----------
    token : str
        Attribute of the instantiation token.
    tags : mapping of FmiType to str
        Elements of variables.
    type_definition : tuple of str
        Elements of the definition of a floating point type, one within the other.
    scalar : str
        Element around that of a variable's type; empty where the latter has all attributes.
    index : str
        Attribute by which an unknown refers to its variable.
    first : int
        What the first variable is called in references: FMI 2.0 counts from 1, FMI 3.0 has value references.
    unknowns : mapping of str to (tuple of str)
        Elements of each list of the model structure, one within the other.
    tunable_knowns : bool
        Whether tunable parameters are among the knowns of a running FMU.
    """

    token: str
    tags: Mapping[FmiType, str]
    type_definition: tuple[str, ...]
    scalar: str
    index: str
    first: int
    unknowns: Mapping[str, tuple[str, ...]]
    tunable_knowns: bool


DIALECTS = {
    Fmi.V2_0: Dialect(
        token="guid",
        tags={FmiType.FLOAT64: "Real", FmiType.INT32: "Integer", FmiType.BOOLEAN: "Boolean"},
        type_definition=("SimpleType", "Real"),
        scalar="ScalarVariable",
        index="index",
        first=1,
        unknowns={
            "outputs": ("Outputs", "Unknown"),
            "derivatives": ("Derivatives", "Unknown"),
            "initial": ("InitialUnknowns", "Unknown"),
        },
        tunable_knowns=False,
    ),
    Fmi.V3_0: Dialect(
        token="instantiationToken",
        tags={
            FmiType.FLOAT64: "Float64",
            FmiType.INT32: "Int32",
            FmiType.UINT64: "UInt64",
            FmiType.BOOLEAN: "Boolean",
            FmiType.CLOCK: "Clock",
        },
        type_definition=("Float64Type",),
        scalar="",
        index="valueReference",
        first=0,
        unknowns={
            "outputs": ("Output",),
            "derivatives": ("ContinuousStateDerivative",),
            "initial": ("InitialUnknown",),
            "indicators": ("EventIndicator",),
        },
        tunable_knowns=True,
    ),
}
