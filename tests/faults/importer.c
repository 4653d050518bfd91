/* The importer by the functions of FMI 2.0 or 3.0.  What both have stands once. */
#include <math.h>
#include <stdarg.h>
#include <string.h>

#include "harness.h"
#if FMI_VERSION == 2
#include "fmi2Functions.h"
#define BOTH(NAME) fmi2##NAME
#define NAMED(NAME2, NAME3) fmi2##NAME2
#else
#include "fmi3Functions.h"
#define BOTH(NAME) fmi3##NAME
#define NAMED(NAME2, NAME3) fmi3##NAME3
#endif

#if FMI_VERSION == 2
/* Messages are formats here: only "%s" keeps names with a percent sign from being formats themselves. */
static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                        fmi2String format, ...)
{
    va_list arguments;
    if (!name || strcmp(format, "%s") != 0)
        broken("a message of FMI 2 is sent with the format %s and a name");
    va_start(arguments, format);
    heard(environment, (int)status, category, va_arg(arguments, const char *));
    va_end(arguments);
}

static void *unused_memory(size_t n, size_t size)
{
    (void)n, (void)size;
    broken("the importer's memory functions are not used");
    return NULL;
}

static void unused_free(void *memory)
{
    (void)memory;
    broken("the importer's memory functions are not used");
}

void *importer_new(const Wish *wish, void *environment)
{
    /* The instance may keep no pointer to this: it is gone when the function returns. */
    fmi2CallbackFunctions functions = {wish->listening ? log_message : NULL, unused_memory, unused_free, NULL,
                                       environment};
    void *made = fmi2Instantiate(wish->name, strcmp(wish->kind, "me") == 0 ? fmi2ModelExchange : fmi2CoSimulation,
                                 wish->token, "file:///nowhere", &functions, fmi2False, wish->logging);
    memset(&functions, 0xAB, sizeof functions);
    return made;
}

int importer_begin(void *instance, double start, double stop, double tolerance)
{
    fmi2Status status = fmi2SetupExperiment(instance, !isnan(tolerance), isnan(tolerance) ? 0.0 : tolerance, start,
                                            !isnan(stop), isnan(stop) ? 0.0 : stop);
    return (int)(status == fmi2OK ? fmi2EnterInitializationMode(instance) : status);
}

int importer_step(void *instance, double t, double h, Stepped *seen)
{
    fmi2Boolean terminated = fmi2False;
    seen->status = (int)fmi2DoStep(instance, t, h, fmi2True);
    seen->time = t + h;
    if (seen->status == fmi2Discard) {
        if (fmi2GetRealStatus(instance, fmi2LastSuccessfulTime, &seen->time) != fmi2OK ||
            fmi2GetBooleanStatus(instance, fmi2Terminated, &terminated) != fmi2OK)
            broken("a step that was discarded says how far it got");
        seen->early = seen->event = terminated == fmi2False;
        seen->terminate = terminated != fmi2False;
        seen->status = fmi2OK;
    }
    return seen->status;
}

int importer_update(void *instance, Updated *seen)
{
    fmi2EventInfo info = {0};
    seen->status = (int)fmi2NewDiscreteStates(instance, &info);
    seen->again = info.newDiscreteStatesNeeded != fmi2False;
    seen->terminate = info.terminateSimulation != fmi2False;
    seen->changed = info.valuesOfContinuousStatesChanged != fmi2False;
    seen->has_next = info.nextEventTimeDefined != fmi2False;
    seen->next = info.nextEventTime;
    return seen->status;
}

int importer_completed(void *instance, bool *event, bool *terminate)
{
    fmi2Boolean enter = fmi2False, end = fmi2False;
    fmi2Status status = fmi2CompletedIntegratorStep(instance, fmi2True, &enter, &end);
    *event = enter != fmi2False;
    *terminate = end != fmi2False;
    return (int)status;
}

int importer_partial(void *instance, bool forward, uint32_t unknown, uint32_t known, const double *seeds,
                     size_t n_seeds, double *results, size_t n_results)
{
    (void)n_seeds, (void)n_results;
    if (!forward)
        return NO_SUCH_FUNCTION;
    return (int)fmi2GetDirectionalDerivative(instance, &unknown, 1, &known, 1, seeds, results);
}

int importer_rates(void *instance, const uint32_t *references, size_t n, double *values, size_t n_values)
{
    fmi2Integer orders[64];
    (void)n_values;
    for (size_t i = 0; i < 64; i++)
        orders[i] = 1;
    return (int)fmi2GetRealOutputDerivatives(instance, references, n, orders, values);
}

int importer_interval(void *instance, uint32_t clock, double *interval, int *qualifier)
{
    (void)instance, (void)clock, (void)interval, (void)qualifier;
    return NO_SUCH_FUNCTION;
}

#else
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

int importer_begin(void *instance, double start, double stop, double tolerance)
{
    return (int)fmi3EnterInitializationMode(instance, !isnan(tolerance), isnan(tolerance) ? 0.0 : tolerance, start,
                                            !isnan(stop), isnan(stop) ? 0.0 : stop);
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

int importer_completed(void *instance, bool *event, bool *terminate)
{
    return (int)fmi3CompletedIntegratorStep(instance, true, event, terminate);
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

#endif

void importer_free(void *instance)
{
    BOTH(FreeInstance)(instance);
}

int importer_plain(void *instance, const char *what)
{
    static const struct {
        const char *what;
        BOTH(Status) (*function)(NAMED(Component, Instance));
    } PLAIN[] = {{"end", BOTH(ExitInitializationMode)},
                 {"event", BOTH(EnterEventMode)},
                 {"continuous", BOTH(EnterContinuousTimeMode)},
                 {"terminate", BOTH(Terminate)},
                 {"reset", BOTH(Reset)},
#if FMI_VERSION == 2
                 {"cancel", fmi2CancelStep},
#else
                 {"configure", fmi3EnterConfigurationMode},
                 {"configured", fmi3ExitConfigurationMode},
                 {"step", fmi3EnterStepMode},
                 {"evaluate", fmi3EvaluateDiscreteStates},
#endif
    };
    for (size_t i = 0; i < sizeof PLAIN / sizeof *PLAIN; i++)
        if (strcmp(PLAIN[i].what, what) == 0)
            return (int)PLAIN[i].function(instance);
    return NO_SUCH_FUNCTION;
}

/* FMI 3.0 is also told the number of values. */
#define ACCESS(TYPE, ...)                                                                                              \
    {                                                                                                                  \
        BOTH(TYPE) *copy = own_memory(count * sizeof *copy);                                                           \
        for (size_t i = 0; i < count; i++)                                                                             \
            copy[i] = (BOTH(TYPE))values[i];                                                                           \
        BOTH(Status) status = set ? BOTH(Set##TYPE)(instance, references, n, copy __VA_ARGS__)                         \
                                  : BOTH(Get##TYPE)(instance, references, n, copy __VA_ARGS__);                        \
        for (size_t i = 0; i < count; i++)                                                                             \
            values[i] = (double)copy[i];                                                                               \
        own_free(copy);                                                                                                \
        return (int)status;                                                                                            \
    }

int importer_access(void *instance, bool set, Type type, const uint32_t *references, size_t n, double *values,
                    size_t n_values)
{
    size_t count = FMI_VERSION == 2 ? n : n_values;
    switch (type) {
#if FMI_VERSION == 2
    case TYPE_FLOAT64: ACCESS(Real)
    case TYPE_INT32: ACCESS(Integer)
    case TYPE_BOOLEAN: ACCESS(Boolean)
    default: return NO_SUCH_FUNCTION;
#else
    case TYPE_FLOAT64: ACCESS(Float64, , n_values)
    case TYPE_INT32: ACCESS(Int32, , n_values)
    case TYPE_UINT64: ACCESS(UInt64, , n_values)
    case TYPE_BOOLEAN: ACCESS(Boolean, , n_values)
    default: ACCESS(Clock)
#endif
    }
}

int importer_set_time(void *instance, double t)
{
    return (int)BOTH(SetTime)(instance, t);
}

int importer_set_states(void *instance, const double *x, size_t n)
{
    return (int)BOTH(SetContinuousStates)(instance, x, n);
}

int importer_vector(void *instance, const char *what, double *values, size_t n)
{
    return (int)(*what == 'd'   ? NAMED(GetDerivatives, GetContinuousStateDerivatives)(instance, values, n)
                 : *what == 's' ? BOTH(GetContinuousStates)(instance, values, n)
                 : *what == 'i' ? BOTH(GetEventIndicators)(instance, values, n)
                                : BOTH(GetNominalsOfContinuousStates)(instance, values, n));
}

int importer_save(void *instance, void **state)
{
    return (int)NAMED(GetFMUstate, GetFMUState)(instance, state);
}

int importer_restore(void *instance, void *state)
{
    return (int)NAMED(SetFMUstate, SetFMUState)(instance, state);
}

int importer_drop(void *instance, void **state)
{
    return (int)NAMED(FreeFMUstate, FreeFMUState)(instance, state);
}

int importer_size(void *instance, void *state, size_t *size)
{
    return (int)NAMED(SerializedFMUstateSize, SerializedFMUStateSize)(instance, state, size);
}

int importer_bytes(void *instance, void *state, unsigned char *bytes, size_t size)
{
    return (int)NAMED(SerializeFMUstate, SerializeFMUState)(instance, state, (BOTH(Byte) *)bytes, size);
}

int importer_parse(void *instance, const unsigned char *bytes, size_t size, void **state)
{
    return (int)NAMED(DeSerializeFMUstate, DeserializeFMUState)(instance, (const BOTH(Byte) *)bytes, size, state);
}

int importer_debug(void *instance, bool on, size_t n, const char *const *categories)
{
    return (int)BOTH(SetDebugLogging)(instance, on, n, (const BOTH(String) *)categories);
}

void importer_nulls(void *instance, char *letters, size_t size)
{
    const BOTH(Status) found[] = {
#if FMI_VERSION == 2
        fmi2GetReal(instance, NULL, 0, NULL), fmi2GetReal(instance, NULL, 3, NULL),
        fmi2SetReal(instance, NULL, 3, NULL), fmi2GetInteger(instance, NULL, 1, NULL),
        fmi2SetInteger(instance, NULL, 1, NULL), fmi2GetBoolean(instance, NULL, 1, NULL),
        fmi2SetBoolean(instance, NULL, 1, NULL), fmi2GetString(instance, NULL, 0, NULL),
        fmi2GetString(instance, NULL, 1, NULL), fmi2SetString(instance, NULL, 1, NULL),
        fmi2GetFMUstate(instance, NULL), fmi2SetFMUstate(instance, NULL), fmi2FreeFMUstate(instance, NULL),
        fmi2SerializedFMUstateSize(instance, NULL, NULL), fmi2SerializeFMUstate(instance, NULL, NULL, 8),
        fmi2DeSerializeFMUstate(instance, NULL, 8, NULL),
        fmi2GetDirectionalDerivative(instance, NULL, 1, NULL, 1, NULL, NULL),
        fmi2GetRealOutputDerivatives(instance, NULL, 1, NULL, NULL),
        fmi2SetRealInputDerivatives(instance, NULL, 1, NULL, NULL), fmi2NewDiscreteStates(instance, NULL),
        fmi2CompletedIntegratorStep(instance, fmi2True, NULL, NULL), fmi2SetContinuousStates(instance, NULL, 1),
        fmi2GetDerivatives(instance, NULL, 1), fmi2GetEventIndicators(instance, NULL, 1),
        fmi2GetNominalsOfContinuousStates(instance, NULL, 1), fmi2GetContinuousStates(instance, NULL, 1),
        fmi2GetRealStatus(instance, fmi2LastSuccessfulTime, NULL),
        fmi2GetBooleanStatus(instance, fmi2Terminated, NULL), fmi2GetStringStatus(instance, fmi2PendingStatus, NULL),
        fmi2GetIntegerStatus(instance, fmi2DoStepStatus, NULL), fmi2GetStatus(instance, fmi2DoStepStatus, NULL),
        fmi2SetDebugLogging(instance, fmi2True, 1, NULL)
#else
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
        fmi3SetDebugLogging(instance, true, 1, NULL)
#endif
    };
    size_t n = 0;
    for (; n < sizeof found / sizeof *found && n + 1 < size; n++)
        letters[n] = found[n] == BOTH(OK) ? 'O' : found[n] == BOTH(Error) ? 'E' : 'D';
    letters[n] = '\0';
}
