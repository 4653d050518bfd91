/* The importer by the functions of FMI 3.0. */
#include <math.h>
#include <string.h>

#include "fmi3Functions.h"
#include "harness.h"

static void log_message(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                        fmi3String message)
{
    heard(environment, (int)status, category, message);
}

static void look_only(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set, fmi3Boolean get,
                      fmi3Boolean finished, fmi3Boolean may_return, fmi3Boolean *wanted, fmi3Float64 *end)
{
    (void)set, (void)finished, (void)may_return, (void)end;
    if (get)
        looked(environment, time);
    *wanted = false;
}

static void look_and_end(fmi3InstanceEnvironment environment, fmi3Float64 time, fmi3Boolean set, fmi3Boolean get,
                         fmi3Boolean finished, fmi3Boolean may_return, fmi3Boolean *wanted, fmi3Float64 *end)
{
    (void)set, (void)finished;
    *wanted = get && looked(environment, time) && may_return;
    *end = time;
}

void *importer_new(const Wish *wish, void *environment)
{
    fmi3LogMessageCallback log = wish->listening ? log_message : NULL;
    if (strcmp(wish->kind, "me") == 0)
        return fmi3InstantiateModelExchange(wish->name, wish->token, NULL, false, wish->logging, environment, log);
    if (strcmp(wish->kind, "se") == 0)
        return fmi3InstantiateScheduledExecution(wish->name, wish->token, NULL, false, wish->logging, environment, log,
                                                 NULL, NULL, NULL);
    return fmi3InstantiateCoSimulation(wish->name, wish->token, NULL, false, wish->logging, wish->events, wish->early,
                                       NULL, 0, environment, log,
                                       wish->update == 0   ? NULL
                                       : wish->update == 1 ? look_only
                                                           : look_and_end);
}

void importer_free(void *instance)
{
    fmi3FreeInstance(instance);
}

int importer_plain(void *instance, const char *what)
{
    static const struct {
        const char *what;
        fmi3Status (*function)(fmi3Instance);
    } PLAIN[] = {{"end", fmi3ExitInitializationMode},     {"configure", fmi3EnterConfigurationMode},
                 {"configured", fmi3ExitConfigurationMode}, {"event", fmi3EnterEventMode},
                 {"step", fmi3EnterStepMode},             {"continuous", fmi3EnterContinuousTimeMode},
                 {"terminate", fmi3Terminate},            {"reset", fmi3Reset},
                 {"evaluate", fmi3EvaluateDiscreteStates}};
    for (size_t i = 0; i < sizeof PLAIN / sizeof *PLAIN; i++)
        if (strcmp(PLAIN[i].what, what) == 0)
            return (int)PLAIN[i].function(instance);
    return NO_SUCH_FUNCTION;
}

int importer_begin(void *instance, double start, double stop, double tolerance)
{
    return (int)fmi3EnterInitializationMode(instance, !isnan(tolerance), isnan(tolerance) ? 0.0 : tolerance, start,
                                            !isnan(stop), isnan(stop) ? 0.0 : stop);
}

#define ACCESS(TYPE, ...)                                                                                              \
    {                                                                                                                  \
        fmi3##TYPE *copy = own_memory(n_values * sizeof *copy);                                                        \
        for (size_t i = 0; i < n_values; i++)                                                                          \
            copy[i] = (fmi3##TYPE)values[i];                                                                           \
        fmi3Status status = set ? fmi3Set##TYPE(instance, references, n, copy __VA_ARGS__)                             \
                                : fmi3Get##TYPE(instance, references, n, copy __VA_ARGS__);                            \
        for (size_t i = 0; i < n_values; i++)                                                                          \
            values[i] = (double)copy[i];                                                                               \
        own_free(copy);                                                                                                \
        return (int)status;                                                                                            \
    }

int importer_access(void *instance, bool set, Type type, const uint32_t *references, size_t n, double *values,
                    size_t n_values)
{
    switch (type) {
    case TYPE_FLOAT64: ACCESS(Float64, , n_values)
    case TYPE_INT32: ACCESS(Int32, , n_values)
    case TYPE_UINT64: ACCESS(UInt64, , n_values)
    case TYPE_BOOLEAN: ACCESS(Boolean, , n_values)
    default: ACCESS(Clock)
    }
}

int importer_step(void *instance, double t, double h, Stepped *seen)
{
    return seen->status = (int)fmi3DoStep(instance, t, h, true, &seen->event, &seen->terminate, &seen->early,
                                          &seen->time);
}

int importer_update(void *instance, Updated *seen)
{
    bool nominals = false;
    return seen->status = (int)fmi3UpdateDiscreteStates(instance, &seen->again, &seen->terminate, &nominals,
                                                        &seen->changed, &seen->has_next, &seen->next);
}

int importer_set_time(void *instance, double t)
{
    return (int)fmi3SetTime(instance, t);
}

int importer_set_states(void *instance, const double *x, size_t n)
{
    return (int)fmi3SetContinuousStates(instance, x, n);
}

int importer_vector(void *instance, const char *what, double *values, size_t n)
{
    return (int)(*what == 'd'   ? fmi3GetContinuousStateDerivatives(instance, values, n)
                 : *what == 's' ? fmi3GetContinuousStates(instance, values, n)
                 : *what == 'i' ? fmi3GetEventIndicators(instance, values, n)
                                : fmi3GetNominalsOfContinuousStates(instance, values, n));
}

int importer_completed(void *instance, bool *event, bool *terminate)
{
    return (int)fmi3CompletedIntegratorStep(instance, true, event, terminate);
}

int importer_save(void *instance, void **state)
{
    return (int)fmi3GetFMUState(instance, state);
}

int importer_restore(void *instance, void *state)
{
    return (int)fmi3SetFMUState(instance, state);
}

int importer_drop(void *instance, void **state)
{
    return (int)fmi3FreeFMUState(instance, state);
}

int importer_size(void *instance, void *state, size_t *size)
{
    return (int)fmi3SerializedFMUStateSize(instance, state, size);
}

int importer_bytes(void *instance, void *state, unsigned char *bytes, size_t size)
{
    return (int)fmi3SerializeFMUState(instance, state, bytes, size);
}

int importer_parse(void *instance, const unsigned char *bytes, size_t size, void **state)
{
    return (int)fmi3DeserializeFMUState(instance, bytes, size, state);
}

int importer_partial(void *instance, bool forward, uint32_t unknown, uint32_t known, const double *seeds,
                     size_t n_seeds, double *results, size_t n_results)
{
    if (forward)
        return (int)fmi3GetDirectionalDerivative(instance, &unknown, 1, &known, 1, seeds, n_seeds, results, n_results);
    return (int)fmi3GetAdjointDerivative(instance, &unknown, 1, &known, 1, seeds, n_seeds, results, n_results);
}

int importer_rates(void *instance, const uint32_t *references, size_t n, double *values, size_t n_values)
{
    fmi3Int32 orders[64];
    for (size_t i = 0; i < 64; i++)
        orders[i] = 1;
    return (int)fmi3GetOutputDerivatives(instance, references, n, orders, values, n_values);
}

int importer_interval(void *instance, uint32_t clock, double *interval, int *qualifier)
{
    fmi3IntervalQualifier found = fmi3IntervalNotYetKnown;
    fmi3Status status = fmi3GetIntervalDecimal(instance, &clock, 1, interval, &found);
    *qualifier = (int)found;
    return (int)status;
}

int importer_debug(void *instance, bool on, size_t n, const char *const *categories)
{
    return (int)fmi3SetDebugLogging(instance, on, n, categories);
}

void importer_nulls(void *instance, char *letters, size_t size)
{
    const fmi3Status found[] = {
        fmi3GetFloat64(instance, NULL, 0, NULL, 0), fmi3GetFloat64(instance, NULL, 3, NULL, 3),
        fmi3SetFloat64(instance, NULL, 3, NULL, 3), fmi3GetInt32(instance, NULL, 1, NULL, 1),
        fmi3SetInt32(instance, NULL, 1, NULL, 1), fmi3GetBoolean(instance, NULL, 1, NULL, 1),
        fmi3SetUInt64(instance, NULL, 1, NULL, 1), fmi3GetString(instance, NULL, 0, NULL, 0),
        fmi3GetString(instance, NULL, 1, NULL, 1), fmi3SetString(instance, NULL, 1, NULL, 1),
        fmi3GetBinary(instance, NULL, 1, NULL, NULL, 1), fmi3SetBinary(instance, NULL, 1, NULL, NULL, 1),
        fmi3GetClock(instance, NULL, 0, NULL), fmi3GetClock(instance, NULL, 1, NULL),
        fmi3SetClock(instance, NULL, 1, NULL), fmi3GetIntervalDecimal(instance, NULL, 1, NULL, NULL),
        fmi3GetIntervalFraction(instance, NULL, 1, NULL, NULL, NULL), fmi3GetShiftDecimal(instance, NULL, 1, NULL),
        fmi3SetIntervalDecimal(instance, NULL, 1, NULL), fmi3ActivateModelPartition(instance, 0, 0.0),
        fmi3GetNumberOfVariableDependencies(instance, 1, NULL),
        fmi3GetVariableDependencies(instance, 1, NULL, NULL, NULL, NULL, 0),
        fmi3GetFMUState(instance, NULL), fmi3SetFMUState(instance, NULL), fmi3FreeFMUState(instance, NULL),
        fmi3SerializedFMUStateSize(instance, NULL, NULL), fmi3SerializeFMUState(instance, NULL, NULL, 8),
        fmi3DeserializeFMUState(instance, NULL, 8, NULL),
        fmi3GetDirectionalDerivative(instance, NULL, 1, NULL, 1, NULL, 1, NULL, 1),
        fmi3GetAdjointDerivative(instance, NULL, 1, NULL, 1, NULL, 1, NULL, 1),
        fmi3GetOutputDerivatives(instance, NULL, 1, NULL, NULL, 1),
        fmi3UpdateDiscreteStates(instance, NULL, NULL, NULL, NULL, NULL, NULL),
        fmi3DoStep(instance, 0.0, 0.1, true, NULL, NULL, NULL, NULL),
        fmi3CompletedIntegratorStep(instance, true, NULL, NULL), fmi3SetContinuousStates(instance, NULL, 1),
        fmi3GetContinuousStateDerivatives(instance, NULL, 1), fmi3GetEventIndicators(instance, NULL, 1),
        fmi3GetNominalsOfContinuousStates(instance, NULL, 1), fmi3GetContinuousStates(instance, NULL, 1),
        fmi3GetNumberOfEventIndicators(instance, NULL), fmi3GetNumberOfContinuousStates(instance, NULL),
        fmi3SetDebugLogging(instance, true, 1, NULL)};
    size_t n = 0;
    for (; n < sizeof found / sizeof *found && n + 1 < size; n++)
        letters[n] = found[n] == fmi3OK ? 'O' : found[n] == fmi3Error ? 'E' : 'D';
    letters[n] = '\0';
}
