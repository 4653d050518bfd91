/* FMI 3.0: values of variables, clocks, saved states and derivatives. */
#include "fmi3_parts.h"

/* A getter and a setter of one type over the elements' common form. */
#define DEFINE_ACCESS(TYPE, MODEL_TYPE)                                                                                \
    static void store##TYPE(void *values, size_t i, double value)                                                      \
    {                                                                                                                  \
        ((fmi3##TYPE *)values)[i] = (fmi3##TYPE)value;                                                                 \
    }                                                                                                                  \
    static double load##TYPE(const void *values, size_t i)                                                             \
    {                                                                                                                  \
        return (double)((const fmi3##TYPE *)values)[i];                                                                \
    }                                                                                                                  \
    fmi3Status fmi3Get##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[],                        \
                             size_t nValueReferences, fmi3##TYPE values[], size_t nValues)                             \
    {                                                                                                                  \
        return status_of(instance_get(instance, __func__, MODEL_TYPE, valueReferences, nValueReferences, values,       \
                                      nValues, store##TYPE));                                                          \
    }                                                                                                                  \
    fmi3Status fmi3Set##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[],                        \
                             size_t nValueReferences, const fmi3##TYPE values[], size_t nValues)                       \
    {                                                                                                                  \
        return status_of(instance_set(instance, __func__, MODEL_TYPE, valueReferences, nValueReferences, values,       \
                                      nValues, load##TYPE));                                                           \
    }

DEFINE_ACCESS(Float64, TYPE_FLOAT64)
DEFINE_ACCESS(Int32, TYPE_INT32)
DEFINE_ACCESS(UInt64, TYPE_UINT64)
DEFINE_ACCESS(Boolean, TYPE_BOOLEAN)

/* Types that no variable has. */
#define DEFINE_MISSING(TYPE)                                                                                           \
    fmi3Status fmi3Get##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[],                        \
                             size_t nValueReferences, fmi3##TYPE values[], size_t nValues)                             \
    {                                                                                                                  \
        (void)valueReferences, (void)values, (void)nValues;                                                            \
        return status_of(instance_no_type(instance, __func__, nValueReferences, false));                               \
    }                                                                                                                  \
    fmi3Status fmi3Set##TYPE(fmi3Instance instance, const fmi3ValueReference valueReferences[],                        \
                             size_t nValueReferences, const fmi3##TYPE values[], size_t nValues)                       \
    {                                                                                                                  \
        (void)valueReferences, (void)values, (void)nValues;                                                            \
        return status_of(instance_no_type(instance, __func__, nValueReferences, true));                                \
    }

DEFINE_MISSING(Float32)
DEFINE_MISSING(Int8)
DEFINE_MISSING(UInt8)
DEFINE_MISSING(Int16)
DEFINE_MISSING(UInt16)
DEFINE_MISSING(UInt32)
DEFINE_MISSING(Int64)
DEFINE_MISSING(String)

fmi3Status fmi3GetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    return status_of(instance_no_type(instance, __func__, nValueReferences, false));
}

fmi3Status fmi3SetBinary(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                         const size_t valueSizes[], const fmi3Binary values[], size_t nValues)
{
    (void)valueReferences, (void)valueSizes, (void)values, (void)nValues;
    return status_of(instance_no_type(instance, __func__, nValueReferences, true));
}

/* ---- clocks ---- */

fmi3Status fmi3GetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Clock values[])
{
    return status_of(instance_get_clocks(instance, __func__, valueReferences, nValueReferences, values));
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        const fmi3Clock values[])
{
    return status_of(instance_set_clocks(instance, __func__, valueReferences, nValueReferences, values));
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                  size_t nValueReferences, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[])
{
    double interval = 0.0;
    Qualifier qualifier = INTERVAL_NOT_YET_KNOWN;
    Answer answer = instance_get_interval(instance, __func__, valueReferences, nValueReferences,
                                          qualifiers ? intervals : NULL, &interval, &qualifier);
    for (size_t i = 0; answer == ANSWER_OK && qualifiers && i < nValueReferences; i++) {
        intervals[i] = interval;
        qualifiers[i] = (fmi3IntervalQualifier)qualifier;
    }
    return status_of(answer);
}

/* ---- saved states ---- */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    return status_of(instance_save(instance, __func__, FMUState));
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    return status_of(instance_restore(instance, __func__, FMUState));
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    return status_of(instance_forget(instance, __func__, FMUState));
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    return status_of(instance_serialized_size(instance, __func__, FMUState, size));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t size)
{
    return status_of(instance_serialize(instance, __func__, FMUState, serializedState, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size,
                                   fmi3FMUState *FMUState)
{
    return status_of(instance_deserialize(instance, __func__, serializedState, size, FMUState));
}

/* ---- derivatives ---- */

fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                        size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    const Direction from = {.references = knowns, .n = nKnowns, .seeds = seed, .n_values = nSeed};
    const Direction to = {.references = unknowns, .n = nUnknowns, .results = sensitivity, .n_values = nSensitivity};
    return status_of(instance_derivatives(instance, __func__, &to, &from, true));
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                    size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
{
    const Direction from = {.references = unknowns, .n = nUnknowns, .seeds = seed, .n_values = nSeed};
    const Direction to = {.references = knowns, .n = nKnowns, .results = sensitivity, .n_values = nSensitivity};
    return status_of(instance_derivatives(instance, __func__, &from, &to, false));
}

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                    size_t nValueReferences, const fmi3Int32 orders[], fmi3Float64 values[],
                                    size_t nValues)
{
    return status_of(
        instance_output_rates(instance, __func__, valueReferences, nValueReferences, orders, values, nValues));
}
