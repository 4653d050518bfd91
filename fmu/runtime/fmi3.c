/* FMI 3.0 for Co-Simulation: a thin layer over the engine.

   It holds the calling rules of the standard, checks what comes from outside, and translates.
   What evolves here (Run) lies in the engine's block, so that saving a run saves it as well. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3_instance.h"

/* A saved state: a mark to recognise it by, and the engine's block. */
typedef struct {
    const Model *model;
    size_t size;
    unsigned char block[];
} SavedState;

/* ---- logging and calling rules ---- */

fmi3Status refuse(const Instance *instance, const char *format, ...)
{
    char message[1024];
    va_list arguments;
    if (!instance || !instance->log)
        return fmi3Error;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    end_text_cleanly(message);
    instance->log(instance->environment, fmi3Error, "logStatusError", message);
    return fmi3Error;
}

const char *mode_name(int mode)
{
    switch (mode) {
    case MODE_INSTANTIATED: return "Instantiated";
    case MODE_INITIALIZATION: return "Initialization Mode";
    case MODE_EVENT: return "Event Mode";
    case MODE_STEP: return "Step Mode";
    default: return "Terminated";
    }
}

Instance *enter(fmi3Instance handle, const char *function, int modes)
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

fmi3Status null_argument(const Instance *instance, const char *function)
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

/* ---- saved states ---- */

static bool is_own(const Instance *instance, const SavedState *saved)
{
    return saved->model == &model && saved->size == engine_block_size(instance->engine);
}

static fmi3Status foreign_state(const Instance *instance, const char *function)
{
    return refuse(instance, "%s: %s: this is not a state of this FMU.", instance->name, function);
}

fmi3Status fmi3GetFMUState(fmi3Instance handle, fmi3FMUState *FMUState)
{
    Instance *instance = enter(handle, "fmi3GetFMUState", MODE_ANY);
    if (!instance)
        return fmi3Error;
    if (!FMUState)
        return null_argument(instance, "fmi3GetFMUState");
    size_t size = engine_block_size(instance->engine);
    SavedState *saved = *FMUState;
    if (saved && !is_own(instance, saved))
        return foreign_state(instance, "fmi3GetFMUState");
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
    if (!is_own(instance, saved))
        return foreign_state(instance, "fmi3SetFMUState");
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
    *nextEventTimeDefined =
        !*terminateSimulation && !*discreteStatesNeedUpdate && next_event(instance, nextEventTime);
    if (!*nextEventTimeDefined)
        *nextEventTime = 0.0;
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
