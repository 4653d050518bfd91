/* FMI 3.0: what this FMU does not have.  Every function of the standard exists and says so. */
#include "fmi3_parts.h"

#define UNSUPPORTED(FUNCTION, ...)                                                                                     \
    fmi3Status FUNCTION(fmi3Instance instance, __VA_ARGS__)                                                            \
    {                                                                                                                  \
        return status_of(instance_unsupported(instance, __func__));                                                    \
    }

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

UNSUPPORTED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference valueReference, size_t *nDependencies)
UNSUPPORTED(fmi3GetVariableDependencies, fmi3ValueReference dependent, size_t elementIndicesOfDependent[],
            fmi3ValueReference independents[], size_t elementIndicesOfIndependents[],
            fmi3DependencyKind dependencyKinds[], size_t nDependencies)
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
UNSUPPORTED(fmi3ActivateModelPartition, fmi3ValueReference clockReference, fmi3Float64 activationTime)

fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance)
{
    return status_of(instance_unsupported(instance, __func__));
}
