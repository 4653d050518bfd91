/* FMI 3.0: what this FMU does not have.  Every function of the standard exists and says so. */
#include "fmi3_instance.h"

static fmi3Status unsupported(fmi3Instance handle, const char *function)
{
    Instance *instance = handle;
    return refuse(instance, "%s: %s is not supported by this FMU.", instance ? instance->name : "", function);
}

/* Getters and setters of types that no variable has: nothing to do for no variables. */
static fmi3Status no_such_type(fmi3Instance handle, const char *function, size_t n, bool set)
{
    Instance *instance = enter(handle, function, set ? MODE_SETTABLE : MODE_ANY);
    if (!instance)
        return fmi3Error;
    if (n == 0)
        return fmi3OK;
    return refuse(instance, "%s: %s: no variable of this FMU has that type.", instance->name, function);
}

#define DEFINE_MISSING_TYPE(TYPE)                                                                                      \
    fmi3Status fmi3Get##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[],                        \
                             size_t nValueReferences, fmi3##TYPE values[], size_t nValues)                             \
    {                                                                                                                  \
        (void)valueReferences, (void)values, (void)nValues;                                                            \
        return no_such_type(instance, "fmi3Get" #TYPE, nValueReferences, false);                                       \
    }                                                                                                                  \
    fmi3Status fmi3Set##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[],                        \
                             size_t nValueReferences, const fmi3##TYPE values[], size_t nValues)                       \
    {                                                                                                                  \
        (void)valueReferences, (void)values, (void)nValues;                                                            \
        return no_such_type(instance, "fmi3Set" #TYPE, nValueReferences, true);                                        \
    }

DEFINE_MISSING_TYPE(Float32)
DEFINE_MISSING_TYPE(Int8)
DEFINE_MISSING_TYPE(UInt8)
DEFINE_MISSING_TYPE(Int16)
DEFINE_MISSING_TYPE(UInt16)
DEFINE_MISSING_TYPE(UInt32)
DEFINE_MISSING_TYPE(Int64)
DEFINE_MISSING_TYPE(UInt64)
DEFINE_MISSING_TYPE(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    return no_such_type(instance, "fmi3GetBinary", nValueReferences, false);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    return no_such_type(instance, "fmi3SetBinary", nValueReferences, true);
}

fmi3Status fmi3SetClock(fmi3Instance handle, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Clock values[])
{
    (void)valueReferences, (void)values;
    Instance *instance = enter(handle, "fmi3SetClock", MODE_EVENT);
    if (!instance)
        return fmi3Error;
    if (nValueReferences == 0)
        return fmi3OK;
    return refuse(instance, "%s: fmi3SetClock: this FMU has no input clocks.", instance->name);
}

/* One line for each function that does nothing but say so. */
#define UNSUPPORTED(FUNCTION, ...)                                                                                     \
    fmi3Status FUNCTION(fmi3Instance instance, __VA_ARGS__)                                                            \
    {                                                                                                                  \
        return unsupported(instance, #FUNCTION);                                                                       \
    }
#define UNSUPPORTED_PLAIN(FUNCTION)                                                                                    \
    fmi3Status FUNCTION(fmi3Instance instance)                                                                         \
    {                                                                                                                  \
        return unsupported(instance, #FUNCTION);                                                                       \
    }

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

UNSUPPORTED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference valueReference, size_t *nDependencies)
UNSUPPORTED(fmi3GetVariableDependencies, fmi3ValueReference dependent, size_t elementIndicesOfDependent[],
            fmi3ValueReference independents[], size_t elementIndicesOfIndependents[],
            fmi3DependencyKind dependencyKinds[], size_t nDependencies)
UNSUPPORTED(fmi3SerializedFMUStateSize, fmi3FMUState FMUState, size_t *size)
UNSUPPORTED(fmi3SerializeFMUState, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t size)
UNSUPPORTED(fmi3DeserializeFMUState, const fmi3Byte serializedState[], size_t size, fmi3FMUState *FMUState)
UNSUPPORTED(fmi3GetDirectionalDerivative, const fmi3ValueReference unknowns[], size_t nUnknowns,
            const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
            fmi3Float64 sensitivity[], size_t nSensitivity)
UNSUPPORTED(fmi3GetAdjointDerivative, const fmi3ValueReference unknowns[], size_t nUnknowns,
            const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
            fmi3Float64 sensitivity[], size_t nSensitivity)
UNSUPPORTED_PLAIN(fmi3EnterConfigurationMode)
UNSUPPORTED_PLAIN(fmi3ExitConfigurationMode)
UNSUPPORTED(fmi3GetIntervalDecimal, const fmi3ValueReference valueReferences[], size_t nValueReferences,
            fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
UNSUPPORTED(fmi3GetIntervalFraction, const fmi3ValueReference valueReferences[], size_t nValueReferences,
            fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
UNSUPPORTED(fmi3GetShiftDecimal, const fmi3ValueReference valueReferences[], size_t nValueReferences,
            fmi3Float64 shifts[])
UNSUPPORTED(fmi3GetShiftFraction, const fmi3ValueReference valueReferences[], size_t nValueReferences,
            fmi3UInt64 counters[], fmi3UInt64 resolutions[])
UNSUPPORTED(fmi3SetIntervalDecimal, const fmi3ValueReference valueReferences[], size_t nValueReferences,
            const fmi3Float64 intervals[])
UNSUPPORTED(fmi3SetIntervalFraction, const fmi3ValueReference valueReferences[], size_t nValueReferences,
            const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
UNSUPPORTED(fmi3SetShiftDecimal, const fmi3ValueReference valueReferences[], size_t nValueReferences,
            const fmi3Float64 shifts[])
UNSUPPORTED(fmi3SetShiftFraction, const fmi3ValueReference valueReferences[], size_t nValueReferences,
            const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
UNSUPPORTED_PLAIN(fmi3EvaluateDiscreteStates)
UNSUPPORTED_PLAIN(fmi3EnterContinuousTimeMode)
UNSUPPORTED(fmi3CompletedIntegratorStep, fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *enterEventMode,
            fmi3Boolean *terminateSimulation)
UNSUPPORTED(fmi3SetTime, fmi3Float64 time)
UNSUPPORTED(fmi3SetContinuousStates, const fmi3Float64 continuousStates[], size_t nContinuousStates)
UNSUPPORTED(fmi3GetContinuousStateDerivatives, fmi3Float64 derivatives[], size_t nContinuousStates)
UNSUPPORTED(fmi3GetEventIndicators, fmi3Float64 eventIndicators[], size_t nEventIndicators)
UNSUPPORTED(fmi3GetContinuousStates, fmi3Float64 continuousStates[], size_t nContinuousStates)
UNSUPPORTED(fmi3GetNominalsOfContinuousStates, fmi3Float64 nominals[], size_t nContinuousStates)
UNSUPPORTED(fmi3GetNumberOfEventIndicators, size_t *nEventIndicators)
UNSUPPORTED(fmi3GetNumberOfContinuousStates, size_t *nContinuousStates)
UNSUPPORTED(fmi3GetOutputDerivatives, const fmi3ValueReference valueReferences[], size_t nValueReferences,
            const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)
UNSUPPORTED(fmi3ActivateModelPartition, fmi3ValueReference clockReference, fmi3Float64 activationTime)
