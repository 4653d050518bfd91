"""Functions of the C interfaces, by version and interface type."""

from __future__ import annotations

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
_SPELLED2 = {
    "GetFMUState": "GetFMUstate",
    "SetFMUState": "SetFMUstate",
    "FreeFMUState": "FreeFMUstate",
    "SerializedFMUStateSize": "SerializedFMUstateSize",
    "SerializeFMUState": "SerializeFMUstate",
    "DeserializeFMUState": "DeSerializeFMUstate",
    "GetContinuousStateDerivatives": "GetDerivatives",
    "GetOutputDerivatives": "GetRealOutputDerivatives",
    "UpdateDiscreteStates": "NewDiscreteStates",
}
"""Functions that FMI 2.0 has under another name than FMI 3.0."""


def spelled(major: int, name: str) -> str:
    """Return the name that a function of FMI 3.0 has in a version, ``fmi2GetFMUstate`` for ``GetFMUState``."""
    return f"fmi{major}{_SPELLED2.get(name, name) if major == 2 else name}"


def required(major: int, kind: str) -> list[str]:
    """Return the functions that an FMU of an interface type exports, whatever its capabilities."""
    return [f"fmi{major}{name}" for name in _OF_KIND[major].get(kind, "").split()]
