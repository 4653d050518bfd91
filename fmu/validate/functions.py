"""Functions of the C interfaces, by version and interface type."""

from __future__ import annotations

from collections.abc import Mapping

from fmu.validate.description import true

_COMMON2 = """\
GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment EnterInitializationMode
ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean GetString SetReal SetInteger SetBoolean
SetString GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate
GetDirectionalDerivative"""
_ME2 = """EnterEventMode NewDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep SetTime SetContinuousStates
GetDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates"""
_CS2 = """SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus GetRealStatus GetIntegerStatus
GetBooleanStatus GetStringStatus"""
_VALUES = "Float32 Float64 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Boolean String Binary Clock"
_COMMON3 = f"""GetVersion SetDebugLogging FreeInstance EnterInitializationMode ExitInitializationMode EnterEventMode
Terminate Reset {" ".join(f"Get{t} Set{t}" for t in _VALUES.split())} GetNumberOfVariableDependencies
GetVariableDependencies GetFMUState SetFMUState FreeFMUState SerializedFMUStateSize SerializeFMUState
DeserializeFMUState GetDirectionalDerivative GetAdjointDerivative EnterConfigurationMode ExitConfigurationMode
GetIntervalDecimal GetIntervalFraction GetShiftDecimal GetShiftFraction SetIntervalDecimal SetIntervalFraction
SetShiftDecimal SetShiftFraction EvaluateDiscreteStates UpdateDiscreteStates"""
_ME3 = """InstantiateModelExchange EnterContinuousTimeMode CompletedIntegratorStep SetTime SetContinuousStates
GetContinuousStateDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates
GetNumberOfEventIndicators GetNumberOfContinuousStates"""
_CS3 = "InstantiateCoSimulation EnterStepMode GetOutputDerivatives DoStep"
_SE3 = "InstantiateScheduledExecution ActivateModelPartition"

_OF_KIND = {
    2: {"ModelExchange": f"{_COMMON2} {_ME2}", "CoSimulation": f"{_COMMON2} {_CS2}"},
    3: {
        "ModelExchange": f"{_COMMON3} {_ME3}",
        "CoSimulation": f"{_COMMON3} {_CS3}",
        "ScheduledExecution": f"{_COMMON3} {_SE3}",
    },
}
_OF_FLAG = {
    "canGetAndSetFMUstate": "GetFMUstate SetFMUstate FreeFMUstate",
    "canSerializeFMUstate": "SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate",
    "canGetAndSetFMUState": "GetFMUState SetFMUState FreeFMUState",
    "canSerializeFMUState": "SerializedFMUStateSize SerializeFMUState DeserializeFMUState",
    "providesDirectionalDerivative": "GetDirectionalDerivative",
    "providesDirectionalDerivatives": "GetDirectionalDerivative",
    "providesAdjointDerivatives": "GetAdjointDerivative",
    "providesEvaluateDiscreteStates": "EvaluateDiscreteStates",
    "providesPerElementDependencies": "GetNumberOfVariableDependencies GetVariableDependencies",
    "hasEventMode": "EnterEventMode EnterStepMode UpdateDiscreteStates",
}


def required(major: int, kind: str) -> list[str]:
    """Return the functions that an FMU of an interface type exports, whatever its capabilities."""
    return [f"fmi{major}{name}" for name in _OF_KIND[major].get(kind, "").split()]


def of_flags(major: int, attributes: Mapping[str, str]) -> dict[str, str]:
    """Return the functions that the capability flags promise, each with its flag."""
    promised = {
        f"fmi{major}{name}": flag
        for flag, names in _OF_FLAG.items()
        if true(attributes, flag)
        for name in names.split()
    }
    if attributes.get("maxOutputDerivativeOrder", "0") != "0":
        promised[f"fmi{major}Get{'Real' if major == 2 else ''}OutputDerivatives"] = "maxOutputDerivativeOrder"
    return promised
