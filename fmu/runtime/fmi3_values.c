/* FMI 3.0: getting and setting variables, and which clocks tick. */
#include <math.h>

#include "fmi3_instance.h"

static const char *type_name(Type type)
{
    static const char *const NAMES[] = {"Float64", "Int32", "Boolean", "Clock"};
    return NAMES[type];
}

static bool may_be_set(const ModelVariable *variable, int mode)
{
    bool before_start = (mode & (MODE_INSTANTIATED | MODE_INITIALIZATION)) != 0;
    switch (variable->bank) {
    case BANK_INPUT: return true;
    case BANK_PARAMETER: return before_start;
    case BANK_STATE:
    case BANK_DISCRETE: return before_start && !variable->calculated;
    default: return false;
    }
}

/* Checks the arguments of a getter or setter before anything is written. */
static fmi3Status check_access(const Instance *instance, const char *function, Type type, bool set,
                               const fmi3ValueReference references[], size_t n, const void *values, size_t n_values)
{
    if (n_values != n)
        return refuse(instance, "%s: %s: %zu values for %zu variables; all variables are scalars.", instance->name,
                      function, n_values, n);
    if (n > 0 && (!references || !values))
        return null_argument(instance, function);
    for (size_t i = 0; i < n; i++) {
        if (references[i] >= model.n_variables)
            return refuse(instance, "%s: %s: there is no variable with the value reference %lu.", instance->name,
                          function, (unsigned long)references[i]);
        const ModelVariable *variable = &model.variables[references[i]];
        if (variable->type != type)
            return refuse(instance, "%s: %s: '%s' is of type %s. Remedy: use the function of that type.",
                          instance->name, function, variable->name, type_name(variable->type));
        if (set && !may_be_set(variable, instance->run->mode))
            return refuse(instance, "%s: %s: '%s' cannot be set in the state '%s'.", instance->name, function,
                          variable->name, mode_name(instance->run->mode));
    }
    return fmi3OK;
}

static View view_of(int mode)
{
    if (mode & (MODE_INSTANTIATED | MODE_INITIALIZATION))
        return VIEW_START;
    return mode == MODE_EVENT ? VIEW_PENDING : VIEW_LIVE;
}

/* The value of a variable, if it is one that its type can hold. */
static bool read_value(const Instance *instance, const ModelVariable *variable, double *value)
{
    if (variable->bank == BANK_TIME) {
        *value = instance->run->time;
        return true;
    }
    const double *values = engine_values(instance->engine, view_of(instance->run->mode), variable->bank);
    if (!values) {
        refuse(instance, "%s: '%s' cannot be computed: %s", instance->name, variable->name,
               engine_problem(instance->engine));
        return false;
    }
    *value = values[variable->index];
    if (variable->type == TYPE_INT32)
        *value = floor(*value + 0.5);
    if (isfinite(*value) && (variable->type != TYPE_INT32 || fabs(*value + 0.5) <= 2147483647.5))
        return true;
    refuse(instance, "%s: '%s' is %g at t = %.17g, which a value of type %s must not be. Remedy: check its expression, "
           "the parameters and the inputs.",
           instance->name, variable->name, values[variable->index], instance->run->time, type_name(variable->type));
    return false;
}

/* Checks everything about a getter's call, down to each value: then nothing is written by halves. */
static fmi3Status check_get(const Instance *instance, const char *function, Type type,
                            const fmi3ValueReference references[], size_t n, const void *values, size_t n_values)
{
    double value;
    fmi3Status status = check_access(instance, function, type, false, references, n, values, n_values);
    for (size_t i = 0; i < n && status == fmi3OK; i++)
        if (!read_value(instance, &model.variables[references[i]], &value))
            status = fmi3Error;
    return status;
}

#define DEFINE_GET(TYPE, MODEL_TYPE, CONVERT)                                                                          \
    fmi3Status fmi3Get##TYPE(fmi3Instance handle, const fmi3ValueReference valueReferences[],                          \
                             size_t nValueReferences, fmi3##TYPE values[], size_t nValues)                             \
    {                                                                                                                  \
        const char *function = "fmi3Get" #TYPE;                                                                        \
        Instance *instance = enter(handle, function, MODE_ANY);                                                        \
        double value = 0.0;                                                                                            \
        if (!instance || check_get(instance, function, MODEL_TYPE, valueReferences, nValueReferences, values,          \
                                   nValues) != fmi3OK)                                                                 \
            return fmi3Error;                                                                                          \
        for (size_t i = 0; i < nValueReferences; i++) {                                                                \
            read_value(instance, &model.variables[valueReferences[i]], &value);                                        \
            values[i] = CONVERT;                                                                                       \
        }                                                                                                              \
        return fmi3OK;                                                                                                 \
    }

DEFINE_GET(Float64, TYPE_FLOAT64, value)
DEFINE_GET(Int32, TYPE_INT32, (fmi3Int32)value)
DEFINE_GET(Boolean, TYPE_BOOLEAN, value != 0.0)

static void write_value(const Instance *instance, fmi3ValueReference reference, double value)
{
    const ModelVariable *variable = &model.variables[reference];
    engine_set(instance->engine, variable->bank, variable->index, value);
}

fmi3Status fmi3SetFloat64(fmi3Instance handle, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          const fmi3Float64 values[], size_t nValues)
{
    const char *function = "fmi3SetFloat64";
    Instance *instance = enter(handle, function, MODE_SETTABLE);
    if (!instance || check_access(instance, function, TYPE_FLOAT64, true, valueReferences, nValueReferences, values,
                                  nValues) != fmi3OK)
        return fmi3Error;
    for (size_t i = 0; i < nValueReferences; i++)
        if (!isfinite(values[i]))
            return refuse(instance, "%s: %s: the value %g for '%s' must be finite.", instance->name, function,
                          values[i], model.variables[valueReferences[i]].name);
    for (size_t i = 0; i < nValueReferences; i++)
        write_value(instance, valueReferences[i], values[i]);
    return fmi3OK;
}

#define DEFINE_SET(TYPE, MODEL_TYPE, CONVERT)                                                                          \
    fmi3Status fmi3Set##TYPE(fmi3Instance handle, const fmi3ValueReference valueReferences[],                          \
                             size_t nValueReferences, const fmi3##TYPE values[], size_t nValues)                       \
    {                                                                                                                  \
        const char *function = "fmi3Set" #TYPE;                                                                        \
        Instance *instance = enter(handle, function, MODE_SETTABLE);                                                   \
        if (!instance || check_access(instance, function, MODEL_TYPE, true, valueReferences, nValueReferences,         \
                                      values, nValues) != fmi3OK)                                                      \
            return fmi3Error;                                                                                          \
        for (size_t i = 0; i < nValueReferences; i++)                                                                  \
            write_value(instance, valueReferences[i], CONVERT);                                                        \
        return fmi3OK;                                                                                                 \
    }

DEFINE_SET(Int32, TYPE_INT32, (double)values[i])
DEFINE_SET(Boolean, TYPE_BOOLEAN, values[i] ? 1.0 : 0.0)

/* Clocks tick in Event Mode only: the clock of the jump that comes next at this instant, and in the
   first iteration those whose jumps were taken inside the last fmi3DoStep. */
fmi3Status fmi3GetClock(fmi3Instance handle, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                        fmi3Clock values[])
{
    const char *function = "fmi3GetClock";
    Instance *instance = enter(handle, function, MODE_ANY);
    if (!instance || check_access(instance, function, TYPE_CLOCK, false, valueReferences, nValueReferences, values,
                                  nValueReferences) != fmi3OK)
        return fmi3Error;
    bool in_event_mode = instance->run->mode == MODE_EVENT;
    size_t pending = in_event_mode ? engine_pending(instance->engine) : model.n_jumps;
    for (size_t i = 0; i < nValueReferences; i++) {
        size_t clock = model.variables[valueReferences[i]].index;
        bool pends = pending < model.n_jumps && model.clock_jump[clock] == pending;
        values[i] = in_event_mode && (pends || engine_ticked(instance->engine, clock));
    }
    return fmi3OK;
}
