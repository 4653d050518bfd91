/* The importer by the functions of FMI 2.0. */
#include <math.h>
#include <stdarg.h>
#include <string.h>

#include "fmi2Functions.h"
#include "harness.h"

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

void importer_free(void *instance)
{
    fmi2FreeInstance(instance);
}

int importer_plain(void *instance, const char *what)
{
    static const struct {
        const char *what;
        fmi2Status (*function)(fmi2Component);
    } PLAIN[] = {{"end", fmi2ExitInitializationMode},           {"event", fmi2EnterEventMode},
                 {"continuous", fmi2EnterContinuousTimeMode}, {"terminate", fmi2Terminate},
                 {"reset", fmi2Reset},                        {"cancel", fmi2CancelStep}};
    for (size_t i = 0; i < sizeof PLAIN / sizeof *PLAIN; i++)
        if (strcmp(PLAIN[i].what, what) == 0)
            return (int)PLAIN[i].function(instance);
    return NO_SUCH_FUNCTION;
}

int importer_begin(void *instance, double start, double stop, double tolerance)
{
    fmi2Status status = fmi2SetupExperiment(instance, !isnan(tolerance), isnan(tolerance) ? 0.0 : tolerance, start,
                                            !isnan(stop), isnan(stop) ? 0.0 : stop);
    return (int)(status == fmi2OK ? fmi2EnterInitializationMode(instance) : status);
}

#define ACCESS(TYPE)                                                                                                   \
    {                                                                                                                  \
        fmi2##TYPE *copy = own_memory(n * sizeof *copy);                                                               \
        for (size_t i = 0; i < n; i++)                                                                                 \
            copy[i] = (fmi2##TYPE)values[i];                                                                           \
        fmi2Status status = set ? fmi2Set##TYPE(instance, references, n, copy)                                         \
                                : fmi2Get##TYPE(instance, references, n, copy);                                        \
        for (size_t i = 0; i < n; i++)                                                                                 \
            values[i] = (double)copy[i];                                                                               \
        own_free(copy);                                                                                                \
        return (int)status;                                                                                            \
    }

int importer_access(void *instance, bool set, Type type, const uint32_t *references, size_t n, double *values,
                    size_t n_values)
{
    (void)n_values;
    switch (type) {
    case TYPE_FLOAT64: ACCESS(Real)
    case TYPE_INT32: ACCESS(Integer)
    case TYPE_BOOLEAN: ACCESS(Boolean)
    default: return NO_SUCH_FUNCTION;
    }
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

int importer_set_time(void *instance, double t)
{
    return (int)fmi2SetTime(instance, t);
}

int importer_set_states(void *instance, const double *x, size_t n)
{
    return (int)fmi2SetContinuousStates(instance, x, n);
}

int importer_vector(void *instance, const char *what, double *values, size_t n)
{
    return (int)(*what == 'd'   ? fmi2GetDerivatives(instance, values, n)
                 : *what == 's' ? fmi2GetContinuousStates(instance, values, n)
                 : *what == 'i' ? fmi2GetEventIndicators(instance, values, n)
                                : fmi2GetNominalsOfContinuousStates(instance, values, n));
}

int importer_completed(void *instance, bool *event, bool *terminate)
{
    fmi2Boolean enter = fmi2False, end = fmi2False;
    fmi2Status status = fmi2CompletedIntegratorStep(instance, fmi2True, &enter, &end);
    *event = enter != fmi2False;
    *terminate = end != fmi2False;
    return (int)status;
}

int importer_save(void *instance, void **state)
{
    return (int)fmi2GetFMUstate(instance, state);
}

int importer_restore(void *instance, void *state)
{
    return (int)fmi2SetFMUstate(instance, state);
}

int importer_drop(void *instance, void **state)
{
    return (int)fmi2FreeFMUstate(instance, state);
}

int importer_size(void *instance, void *state, size_t *size)
{
    return (int)fmi2SerializedFMUstateSize(instance, state, size);
}

int importer_bytes(void *instance, void *state, unsigned char *bytes, size_t size)
{
    return (int)fmi2SerializeFMUstate(instance, state, (fmi2Byte *)bytes, size);
}

int importer_parse(void *instance, const unsigned char *bytes, size_t size, void **state)
{
    return (int)fmi2DeSerializeFMUstate(instance, (const fmi2Byte *)bytes, size, state);
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

int importer_debug(void *instance, bool on, size_t n, const char *const *categories)
{
    return (int)fmi2SetDebugLogging(instance, on, n, (const fmi2String *)categories);
}

void importer_nulls(void *instance, char *letters, size_t size)
{
    const fmi2Status found[] = {
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
        fmi2SetDebugLogging(instance, fmi2True, 1, NULL)};
    size_t n = 0;
    for (; n < sizeof found / sizeof *found && n + 1 < size; n++)
        letters[n] = found[n] == fmi2OK ? 'O' : found[n] == fmi2Error ? 'E' : 'D';
    letters[n] = '\0';
}
