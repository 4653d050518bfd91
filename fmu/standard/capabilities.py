"""The capabilities of FMI 2.0 and 3.0: their names in both versions, what they promise, and which our FMUs have."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass

from fmu.standard.functions import spelled


@dataclass(frozen=True)
class Facts:
    """What the versions say of a capability.

    Attributes
    ----------
    fmi2, fmi3 : str
        Names of the attribute; empty where the version has none.
    functions : tuple of str
        What an FMU that claims it must export beyond what its interface type asks for, in the spelling of FMI 3.0.
    ours : tuple of str
        Kinds, ``cs`` and ``me``, of our FMUs that have it.
    value : tuple of str
        What the attribute says of an FMU that has it, in FMI 2.0 and in FMI 3.0.
    """

    fmi2: str
    fmi3: str
    functions: tuple[str, ...] = ()
    ours: tuple[str, ...] = ()
    value: tuple[str, str] = ("true", "true")


_BOTH = ("cs", "me")


class Capability(enum.Enum):
    """What an FMU may be able to do; the value tells how the versions of the standard say it."""

    COMPLETED_STEP = Facts(
        "completedIntegratorStepNotNeeded", "needsCompletedIntegratorStep", ours=("me",), value=("false", "true")
    )
    # Instances are made by the C library's calloc: the importer's functions for memory are not called.
    OWN_MEMORY = Facts("canNotUseMemoryManagementFunctions", "", ours=_BOTH)
    STATE = Facts(
        "canGetAndSetFMUstate",
        "canGetAndSetFMUState",
        ("GetFMUState", "SetFMUState", "FreeFMUState"),
        ours=_BOTH,
    )
    SERIALIZATION = Facts(
        "canSerializeFMUstate",
        "canSerializeFMUState",
        ("SerializedFMUStateSize", "SerializeFMUState", "DeserializeFMUState"),
        ours=_BOTH,
    )
    DIRECTIONAL_DERIVATIVES = Facts(
        "providesDirectionalDerivative", "providesDirectionalDerivatives", ("GetDirectionalDerivative",), ours=_BOTH
    )
    ADJOINT_DERIVATIVES = Facts("", "providesAdjointDerivatives", ("GetAdjointDerivative",), ours=_BOTH)
    ELEMENT_DEPENDENCIES = Facts(
        "", "providesPerElementDependencies", ("GetNumberOfVariableDependencies", "GetVariableDependencies")
    )
    EVALUATION = Facts("", "providesEvaluateDiscreteStates", ("EvaluateDiscreteStates",))
    VARIABLE_STEP = Facts(
        "canHandleVariableCommunicationStepSize", "canHandleVariableCommunicationStepSize", ours=("cs",)
    )
    OUTPUT_DERIVATIVES = Facts(
        "maxOutputDerivativeOrder",
        "maxOutputDerivativeOrder",
        ("GetOutputDerivatives",),
        ours=("cs",),
        value=("1", "1"),
    )
    INPUT_DERIVATIVES = Facts("canInterpolateInputs", "")
    INTERMEDIATE_UPDATE = Facts("", "providesIntermediateUpdate", ours=("cs",))
    EARLY_RETURN = Facts("", "mightReturnEarlyFromDoStep", ours=("cs",))
    RETURN_AFTER_UPDATE = Facts("", "canReturnEarlyAfterIntermediateUpdate", ours=("cs",))
    EVENT_MODE = Facts("", "hasEventMode", ("EnterEventMode", "EnterStepMode", "UpdateDiscreteStates"), ours=("cs",))
    ONCE_PER_PROCESS = Facts("canBeInstantiatedOnlyOncePerProcess", "canBeInstantiatedOnlyOncePerProcess")
    EXECUTION_TOOL = Facts("needsExecutionTool", "needsExecutionTool")

    def attribute(self, major: int) -> str:
        """Return its name in a version of the standard; empty if it has none."""
        return self.value.fmi2 if major == 2 else self.value.fmi3

    def claimed(self, attributes: Mapping[str, str], major: int) -> bool:
        """Return whether the attributes of an interface type claim it, in the way of their version."""
        name, says = self.attribute(major), self.value.value[major - 2]
        if not says.isalpha():
            return bool(name) and attributes.get(name, "0") != "0"
        return bool(name) and true(attributes, name) is (says == "true")


DERIVATIVES = (
    Capability.DIRECTIONAL_DERIVATIVES,
    Capability.ADJOINT_DERIVATIVES,
    Capability.OUTPUT_DERIVATIVES,
)
"""Those by which an FMU tells derivatives."""


def declared(major: int, kind: str) -> dict[str, str]:
    """Return the attributes by which an FMU of ours says what it can.

    Parameters
    ----------
    major : int
        Version of the standard.
    kind : {"cs", "me"}
        Co-Simulation or Model Exchange.
    """
    return {
        name: capability.value.value[major - 2]
        for capability in Capability
        if kind in capability.value.ours and (name := capability.attribute(major))
    }


def promised(major: int, attributes: Mapping[str, str]) -> dict[str, str]:
    """Return the functions that the capabilities of an interface type promise, each with the attribute that does."""
    return {
        spelled(major, name): capability.attribute(major)
        for capability in Capability
        if capability.claimed(attributes, major)
        for name in capability.value.functions
    }


def true(attributes: Mapping[str, str], name: str) -> bool:
    """Return a Boolean attribute, which is false where it is absent."""
    return attributes.get(name, "false") in ("true", "1")
