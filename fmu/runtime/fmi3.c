/* FMI 3.0 for Co-Simulation: a thin layer over the engine.

   It holds the calling rules of the standard, checks what comes from outside, and translates.
   What evolves here (Run) lies in the engine's block, so that saving a run saves it as well. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "engine.h"
#include "fmi3Functions.h"

enum {
    MODE_INSTANTIATED = 1,
    MODE_INITIALIZATION = 2,
    MODE_EVENT = 4,
    MODE_STEP = 8,
    MODE_TERMINATED = 16,
    MODE_ANY = 31
};

typedef struct {
    double time;               /* the communication point */
    double stop_time;          /* infinite if there is none */
    int32_t mode;
    int32_t end_reported;      /* fmi3DoStep has said that the run is over */
} Run;

typedef struct {
    Engine *engine;
    Run *run;
    char *name;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    bool event_mode_used, early_return_allowed;
} Instance;

/* A saved state: a mark to recognise it by, and the engine's block. */
typedef struct {
    const Model *model;
    size_t size;
    unsigned char block[];
} SavedState;

#if defined(__GNUC__)
#define LIKE_PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define LIKE_PRINTF(text, first)
#endif

/* ---- logging and calling rules ---- */

/* Errors are always logged when there is a logger; always fmi3Error, so that callers can return it. */
static fmi3Status refuse(const Instance *instance, const char *format, ...) LIKE_PRINTF(2, 3);

static fmi3Status refuse(const Instance *instance, const char *format, ...)
{
    char message[1024];
    va_list arguments;
    if (!instance || !instance->log)
        return fmi3Error;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    instance->log(instance->environment, fmi3Error, "logStatusError", message);
    return fmi3Error;
}

static const char *mode_name(int mode)
{
    switch (mode) {
    case MODE_INSTANTIATED: return "Instantiated";
    case MODE_INITIALIZATION: return "Initialization Mode";
    case MODE_EVENT: return "Event Mode";
    case MODE_STEP: return "Step Mode";
    default: return "Terminated";
    }
}

/* The instance, if the function may be called now; NULL (and one log line) otherwise. */
static Instance *enter(fmi3Instance handle, const char *function, int modes)
{
    Instance *instance = handle;
    if (!instance)
        return NULL;
    if (instance->run->mode & modes)
        return instance;
    refuse(instance, "%s: %s must not be called in the state '%s'.", instance->name, function,
           mode_name(instance->run->mode));
    return NULL;
}

static fmi3Status unsupported(fmi3Instance handle, const char *function)
{
    Instance *instance = handle;
    return refuse(instance, "%s: %s is not supported by this FMU.", instance ? instance->name : "", function);
}

static fmi3Status null_argument(const Instance *instance, const char *function)
{
    return refuse(instance, "%s: %s was called with a null pointer; every argument needs a place to point to.",
                  instance->name, function);
}

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance handle, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[])
{
    /* There is nothing but errors to log, and those are not switched off. */
    (void)loggingOn;
    Instance *instance = enter(handle, "fmi3SetDebugLogging", MODE_ANY);
    if (!instance)
        return fmi3Error;
    return nCategories > 0 && !categories ? null_argument(instance, "fmi3SetDebugLogging") : fmi3OK;
}

/* ---- life cycle ---- */

static void set_up(Instance *instance)
{
    engine_reset(instance->engine);
    instance->run->mode = MODE_INSTANTIATED;
    instance->run->time = 0.0;
    instance->run->stop_time = INFINITY;
    instance->run->end_reported = false;
}

static bool is_blank(const char *text)
{
    return !text || text[strspn(text, " \t\r\n")] == '\0';
}

static Instance *create(const char *name)
{
    size_t size = strlen(name) + 1;
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance)
        return NULL;
    instance->name = malloc(size);
    instance->engine = engine_create(&model, sizeof(Run));
    if (!instance->name || !instance->engine) {
        engine_free(instance->engine);
        free(instance->name);
        free(instance);
        return NULL;
    }
    memcpy(instance->name, name, size);
    instance->run = engine_wrapper(instance->engine);
    return instance;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken,
                                         fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                         fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                         const fmi3ValueReference requiredIntermediateVariables[],
                                         size_t nRequiredIntermediateVariables,
                                         fmi3InstanceEnvironment instanceEnvironment,
                                         fmi3LogMessageCallback logMessage,
                                         fmi3IntermediateUpdateCallback intermediateUpdate)
{
    const Instance nobody = {.environment = instanceEnvironment, .log = logMessage};
    const char *function = "fmi3InstantiateCoSimulation";
    (void)resourcePath, (void)visible, (void)loggingOn, (void)requiredIntermediateVariables, (void)intermediateUpdate;
    if (is_blank(instanceName)) {
        refuse(&nobody, "%s: the instance name is missing; it needs at least one visible character.", function);
        return NULL;
    }
    if (!instantiationToken || strcmp(instantiationToken, model.token) != 0) {
        refuse(&nobody, "%s: %s: the instantiation token '%s' is not this FMU's '%s'. Remedy: use the "
               "modelDescription.xml of the same FMU.",
               instanceName, function, instantiationToken ? instantiationToken : "(null)", model.token);
        return NULL;
    }
    if (nRequiredIntermediateVariables > 0) {
        refuse(&nobody, "%s: %s: this FMU has no intermediate update, so no intermediate variables can be required.",
               instanceName, function);
        return NULL;
    }
    Instance *instance = create(instanceName);
    if (!instance) {
        refuse(&nobody, "%s: %s: out of memory.", instanceName, function);
        return NULL;
    }
    instance->environment = instanceEnvironment;
    instance->log = logMessage;
    instance->event_mode_used = eventModeUsed;
    instance->early_return_allowed = earlyReturnAllowed;
    set_up(instance);
    return instance;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage)
{
    const Instance nobody = {.environment = instanceEnvironment, .log = logMessage};
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
    refuse(&nobody, "fmi3InstantiateModelExchange is not supported: this FMU is for Co-Simulation.");
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                               fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption)
{
    const Instance nobody = {.environment = instanceEnvironment, .log = logMessage};
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
    (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
    refuse(&nobody, "fmi3InstantiateScheduledExecution is not supported: this FMU is for Co-Simulation.");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance handle)
{
    Instance *instance = handle;
    if (!instance)
        return;
    engine_free(instance->engine);
    free(instance->name);
    free(instance);
}

fmi3Status fmi3Reset(fmi3Instance handle)
{
    Instance *instance = enter(handle, "fmi3Reset", MODE_ANY);
    if (!instance)
        return fmi3Error;
    set_up(instance);
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance handle)
{
    Instance *instance = enter(handle, "fmi3Terminate", MODE_EVENT | MODE_STEP);
    if (!instance)
        return fmi3Error;
    instance->run->mode = MODE_TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance handle, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    Instance *instance = enter(handle, "fmi3EnterInitializationMode", MODE_INSTANTIATED);
    if (!instance)
        return fmi3Error;
    if (toleranceDefined && !(isfinite(tolerance) && tolerance > 0.0))
        return refuse(instance, "%s: the tolerance %g must be finite and above zero.", instance->name, tolerance);
    if (!isfinite(startTime))
        return refuse(instance, "%s: the start time %g must be finite.", instance->name, startTime);
    if (stopTimeDefined && !(isfinite(stopTime) && stopTime >= startTime))
        return refuse(instance, "%s: the stop time %.17g must be finite and not before the start time %.17g.",
                      instance->name, stopTime, startTime);
    if (toleranceDefined)
        engine_set_tolerance(instance->engine, tolerance);
    engine_set_time(instance->engine, startTime);
    instance->run->time = startTime;
    instance->run->stop_time = stopTimeDefined ? stopTime : INFINITY;
    instance->run->mode = MODE_INITIALIZATION;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance handle)
{
    Instance *instance = enter(handle, "fmi3ExitInitializationMode", MODE_INITIALIZATION);
    if (!instance)
        return fmi3Error;
    Engine *engine = instance->engine;
    if (!engine_start(engine))
        return refuse(instance, "%s: %s", instance->name, engine_problem(engine));
    if (!instance->event_mode_used && !engine_jump_all(engine))
        return refuse(instance, "%s: %s", instance->name, engine_message(engine));
    engine_clear_ticks(engine);
    instance->run->mode = instance->event_mode_used ? MODE_EVENT : MODE_STEP;
    return fmi3OK;
}

/* ---- values ---- */

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

/* The modes in which anything at all can be set. */
#define MODE_SETTABLE (MODE_INSTANTIATED | MODE_INITIALIZATION | MODE_EVENT | MODE_STEP)

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

/* ---- saved states ---- */

fmi3Status fmi3GetFMUState(fmi3Instance handle, fmi3FMUState *FMUState)
{
    Instance *instance = enter(handle, "fmi3GetFMUState", MODE_ANY);
    if (!instance)
        return fmi3Error;
    if (!FMUState)
        return null_argument(instance, "fmi3GetFMUState");
    size_t size = engine_block_size(instance->engine);
    SavedState *saved = *FMUState;
    if (!saved) {
        saved = malloc(sizeof *saved + size);
        if (!saved)
            return refuse(instance, "%s: fmi3GetFMUState: out of memory.", instance->name);
        saved->model = &model;
        saved->size = size;
    }
    engine_save(instance->engine, saved->block);
    *FMUState = saved;
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance handle, fmi3FMUState FMUState)
{
    Instance *instance = enter(handle, "fmi3SetFMUState", MODE_ANY);
    const SavedState *saved = FMUState;
    if (!instance)
        return fmi3Error;
    if (!saved)
        return null_argument(instance, "fmi3SetFMUState");
    if (saved->model != &model || saved->size != engine_block_size(instance->engine))
        return refuse(instance, "%s: fmi3SetFMUState: this is not a state of this FMU.", instance->name);
    engine_restore(instance->engine, saved->block);
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance handle, fmi3FMUState *FMUState)
{
    if (!enter(handle, "fmi3FreeFMUState", MODE_ANY))
        return fmi3Error;
    if (FMUState) {
        free(*FMUState);
        *FMUState = NULL;
    }
    return fmi3OK;
}

/* ---- Event Mode ---- */

fmi3Status fmi3EnterEventMode(fmi3Instance handle)
{
    Instance *instance = enter(handle, "fmi3EnterEventMode", MODE_STEP);
    if (!instance)
        return fmi3Error;
    if (!instance->event_mode_used)
        return refuse(instance, "%s: fmi3EnterEventMode: the FMU was instantiated with eventModeUsed = false.",
                      instance->name);
    instance->run->mode = MODE_EVENT;
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance handle)
{
    Instance *instance = enter(handle, "fmi3EnterStepMode", MODE_EVENT);
    if (!instance)
        return fmi3Error;
    engine_clear_ticks(instance->engine);
    instance->run->mode = MODE_STEP;
    return fmi3OK;
}

/* The time of the next event, if it can be known: predicted where all inputs are discrete, the next
   time event otherwise. */
static bool next_event(const Instance *instance, double *event_time)
{
    return model.predictable ? engine_predict(instance->engine, instance->run->stop_time, event_time)
                             : engine_next_time_event(instance->engine, event_time);
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance handle, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime)
{
    Instance *instance = enter(handle, "fmi3UpdateDiscreteStates", MODE_EVENT);
    if (!instance)
        return fmi3Error;
    if (!discreteStatesNeedUpdate || !terminateSimulation || !nominalsOfContinuousStatesChanged ||
        !valuesOfContinuousStatesChanged || !nextEventTimeDefined || !nextEventTime)
        return null_argument(instance, "fmi3UpdateDiscreteStates");
    Engine *engine = instance->engine;
    bool changed = false;
    *terminateSimulation = !engine_jump(engine, &changed);
    *discreteStatesNeedUpdate = !*terminateSimulation && engine_pending(engine) < model.n_jumps;
    *nominalsOfContinuousStatesChanged = false;
    *valuesOfContinuousStatesChanged = changed;
    /* This iteration's clocks are over; the next one's are those of the jump that comes next. */
    engine_clear_ticks(engine);
    *nextEventTime = 0.0;
    *nextEventTimeDefined =
        !*terminateSimulation && !*discreteStatesNeedUpdate && next_event(instance, nextEventTime);
    if (*terminateSimulation)
        refuse(instance, "%s: %s", instance->name, engine_message(engine));
    return fmi3OK;
}

/* ---- Step Mode ---- */

/* Rounding that an importer's own arithmetic may leave between two ways to write one time. */
static double time_rounding(double a, double b)
{
    return 32.0 * time_ulp(fmax(fabs(a), fabs(b)));
}

static fmi3Status check_step(const Instance *instance, double point, double size, double target)
{
    const Run *run = instance->run;
    const char *name = instance->name;
    if (run->end_reported)
        return refuse(instance, "%s: the run is over: %s", name, engine_message(instance->engine));
    if (!isfinite(size) || size <= 0.0)
        return refuse(instance, "%s: fmi3DoStep: the step size %g must be finite and above zero.", name, size);
    if (!isfinite(point) || !isfinite(target))
        return refuse(instance, "%s: fmi3DoStep: the step from %g to %g must begin and end at finite times.", name,
                      point, target);
    if (fabs(point - run->time) > time_rounding(point, fmax(fabs(run->time), size)))
        return refuse(instance, "%s: fmi3DoStep: the step begins at %.17g, but the FMU is at %.17g; steps must follow "
                      "each other without gap or repeat.",
                      name, point, run->time);
    if (target > run->stop_time + time_rounding(target, run->stop_time))
        return refuse(instance, "%s: fmi3DoStep: the step ends at %.17g, after the stop time %.17g.", name, target,
                      run->stop_time);
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance handle, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded,
                      fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    Instance *instance = enter(handle, "fmi3DoStep", MODE_STEP);
    if (!instance)
        return fmi3Error;
    if (!eventHandlingNeeded || !terminateSimulation || !earlyReturn || !lastSuccessfulTime)
        return null_argument(instance, "fmi3DoStep");
    Engine *engine = instance->engine;
    Run *run = instance->run;
    double target = currentCommunicationPoint + communicationStepSize;
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = false;
    *lastSuccessfulTime = run->time;
    if (check_step(instance, currentCommunicationPoint, communicationStepSize, target) != fmi3OK)
        return fmi3Error;
    bool may_stop = instance->event_mode_used && instance->early_return_allowed;
    Advance advance = engine_advance(engine, target,
                                     may_stop                    ? EVENTS_STOP
                                     : instance->event_mode_used ? EVENTS_INSIDE_BEFORE_END
                                                                 : EVENTS_INSIDE);
    bool reached = advance == ADVANCE_REACHED || advance == ADVANCE_EVENT_AT_TARGET;
    bool pending = advance == ADVANCE_EVENT_AT_TARGET || advance == ADVANCE_EVENT_BEFORE;
    run->time = reached ? target : fmin(engine_time(engine), target);
    *lastSuccessfulTime = run->time;
    *eventHandlingNeeded = pending || (instance->event_mode_used && engine_jumps_taken(engine) > 0);
    *terminateSimulation = advance == ADVANCE_ENDED;
    *earlyReturn = instance->early_return_allowed && run->time < target;
    if (advance == ADVANCE_ENDED) {
        *eventHandlingNeeded = false;
        run->end_reported = true;
        refuse(instance, "%s: %s", instance->name, engine_message(engine));
    }
    /* The call itself succeeded: it computed what there is, and says by its flags that it is the end. */
    return fmi3OK;
}

/* ---- what this FMU does not have ---- */

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
