/* FMI 3.0: life cycle, events, steps and Model Exchange, a thin layer over instance.h. */
#include "fmi3_parts.h"

typedef struct {
    Instance base;             /* first, so that one is the other */
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    fmi3IntermediateUpdateCallback update;
} Fmi3;

static void log_line(const Instance *instance, Answer level, const char *category, const char *message)
{
    const Fmi3 *own = (const Fmi3 *)instance;
    own->log(own->environment, status_of(level), category, message);
}

static Fmi3 prototype(Interface interface, fmi3String name, fmi3Boolean logging, fmi3InstanceEnvironment environment,
                      fmi3LogMessageCallback log)
{
    const Fmi3 made = {.base = {.name = name, .interface = interface, .logging = logging,
                                .log_line = log ? log_line : NULL},
                       .environment = environment, .log = log};
    return made;
}

/* Shows the importer the state on the way of a step; it may ask for the step to end there or soon after. */
static double show_intermediate(void *context, double time, double target)
{
    Fmi3 *own = context;
    Run *run = own->base.run;
    bool may_end = own->base.early_return_allowed, asked = false;
    fmi3Float64 end = target;
    run->mode = MODE_INTERMEDIATE;
    own->update(own->environment, time, true, true, true, may_end, &asked, &end);
    run->mode = MODE_STEP;
    if (!may_end || !asked || !(end < target))
        return target;
    return end > time ? end : time;
}

/* ---- life cycle ---- */

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[])
{
    return status_of(instance_log(instance, __func__, loggingOn, nCategories, categories));
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment,
                                          fmi3LogMessageCallback logMessage)
{
    const Fmi3 made = prototype(MODEL_EXCHANGE, instanceName, loggingOn, instanceEnvironment, logMessage);
    (void)resourcePath, (void)visible;
    return instance_new(&made.base, sizeof made, __func__, instantiationToken);
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
    Fmi3 made = prototype(CO_SIMULATION, instanceName, loggingOn, instanceEnvironment, logMessage);
    (void)resourcePath, (void)visible;
    if (nRequiredIntermediateVariables > 0 && !requiredIntermediateVariables) {
        instance_refuse(&made.base, "%s: there are %zu intermediate variables, but no place where they are.", __func__,
                        nRequiredIntermediateVariables);
        return NULL;
    }
    for (size_t i = 0; i < nRequiredIntermediateVariables; i++)
        if (requiredIntermediateVariables[i] >= description.n_variables) {
            instance_refuse(&made.base, "%s: there is no variable with the value reference %lu.", __func__,
                            (unsigned long)requiredIntermediateVariables[i]);
            return NULL;
        }
    made.base.event_mode_used = eventModeUsed;
    made.base.early_return_allowed = earlyReturnAllowed;
    made.update = intermediateUpdate;
    Instance *instance = instance_new(&made.base, sizeof made, __func__, instantiationToken);
    if (instance && intermediateUpdate)
        engine_set_hook(instance->engine, show_intermediate, instance);
    if (instance && intermediateUpdate && instance->parts)
        assembled_set_hook(instance->parts, show_intermediate, instance);
    return instance;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                               fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption)
{
    const Fmi3 nobody = prototype(CO_SIMULATION, instanceName, loggingOn, instanceEnvironment, logMessage);
    (void)instantiationToken, (void)resourcePath, (void)visible;
    (void)clockUpdate, (void)lockPreemption, (void)unlockPreemption;
    instance_refuse(&nobody.base, "%s: this FMU is not for Scheduled Execution.", __func__);
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    instance_free(instance, __func__);
}

/* Functions of an instance alone. */
#define DEFINE_PLAIN(NAME, ANSWER)                                                                                     \
    fmi3Status NAME(fmi3Instance instance)                                                                             \
    {                                                                                                                  \
        return status_of(ANSWER);                                                                                      \
    }

DEFINE_PLAIN(fmi3Reset, instance_reset(instance, __func__))
DEFINE_PLAIN(fmi3Terminate, instance_terminate(instance, __func__))
DEFINE_PLAIN(fmi3EnterConfigurationMode, instance_configure(instance, __func__, true))
DEFINE_PLAIN(fmi3ExitConfigurationMode, instance_configure(instance, __func__, false))
DEFINE_PLAIN(fmi3ExitInitializationMode, instance_exit_initialization(instance, __func__))
DEFINE_PLAIN(fmi3EnterEventMode, instance_enter_event_mode(instance, __func__, MODE_STEP | MODE_CONTINUOUS))
DEFINE_PLAIN(fmi3EnterStepMode, instance_leave_event_mode(instance, __func__, MODE_STEP))
DEFINE_PLAIN(fmi3EnterContinuousTimeMode, instance_leave_event_mode(instance, __func__, MODE_CONTINUOUS))

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    const Experiment experiment = {toleranceDefined, stopTimeDefined, tolerance, startTime, stopTime};
    Answer answer = instance_set_up(instance, __func__, &experiment);
    return status_of(answer == ANSWER_OK ? instance_enter_initialization(instance, __func__) : answer);
}

/* ---- events ---- */

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime)
{
    EventUpdate update;
    Instance *own = instance_enter(instance, __func__, MODE_EVENT);
    if (!own)
        return fmi3Error;
    if (!discreteStatesNeedUpdate || !terminateSimulation || !nominalsOfContinuousStatesChanged ||
        !valuesOfContinuousStatesChanged || !nextEventTimeDefined || !nextEventTime)
        return status_of(instance_null_argument(own, __func__));
    Answer answer = instance_update(own, __func__, &update);
    *discreteStatesNeedUpdate = update.again;
    *terminateSimulation = update.terminate;
    *nominalsOfContinuousStatesChanged = update.nominals_changed;
    *valuesOfContinuousStatesChanged = update.states_changed;
    *nextEventTimeDefined = update.has_next;
    *nextEventTime = update.next;
    return status_of(answer);
}

/* ---- Co-Simulation ---- */

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded,
                      fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    StepReport report;
    Fmi3 *own = (Fmi3 *)instance_enter(instance, __func__, MODE_STEP);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!own)
        return fmi3Error;
    if (!eventHandlingNeeded || !terminateSimulation || !earlyReturn || !lastSuccessfulTime)
        return status_of(instance_null_argument(&own->base, __func__));
    if (instance_step_quietly(&own->base, currentCommunicationPoint, communicationStepSize)) {
        *eventHandlingNeeded = *terminateSimulation = *earlyReturn = false;
        *lastSuccessfulTime = own->base.run->time;
        return fmi3OK;
    }
    bool events = own->base.event_mode_used;
    EventPolicy policy = !events                          ? EVENTS_INSIDE
                         : own->base.early_return_allowed ? EVENTS_STOP
                                                          : EVENTS_INSIDE_BEFORE_END;
    Answer answer =
        instance_step(&own->base, __func__, currentCommunicationPoint, communicationStepSize, policy, &report);
    *eventHandlingNeeded = events && report.event;
    *terminateSimulation = report.terminate;
    *earlyReturn = own->base.early_return_allowed && report.early;
    *lastSuccessfulTime = report.reached;
    return status_of(answer);
}

/* ---- Model Exchange ---- */

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    return status_of(instance_set_time(instance, __func__, time));
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[],
                                   size_t nContinuousStates)
{
    return status_of(instance_set_states(instance, __func__, continuousStates, nContinuousStates));
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    return status_of(instance_completed_step(instance, __func__, enterEventMode, terminateSimulation));
}

#define DEFINE_VECTOR(NAME, ANSWER)                                                                                    \
    fmi3Status NAME(fmi3Instance instance, fmi3Float64 values[], size_t n)                                             \
    {                                                                                                                  \
        return status_of(ANSWER);                                                                                      \
    }

DEFINE_VECTOR(fmi3GetContinuousStates, instance_get_vector(instance, __func__, BANK_STATE, values, n))
DEFINE_VECTOR(fmi3GetContinuousStateDerivatives, instance_get_vector(instance, __func__, BANK_DERIVATIVE, values, n))
DEFINE_VECTOR(fmi3GetEventIndicators, instance_get_vector(instance, __func__, BANK_INDICATOR, values, n))
DEFINE_VECTOR(fmi3GetNominalsOfContinuousStates, instance_nominals(instance, __func__, values, n))

#define DEFINE_COUNT(NAME, COUNT)                                                                                      \
    fmi3Status NAME(fmi3Instance instance, size_t *count)                                                              \
    {                                                                                                                  \
        const Instance *own = instance_enter(instance, __func__, MODE_ANY);                                            \
        if (!own)                                                                                                      \
            return fmi3Error;                                                                                          \
        if (!count)                                                                                                    \
            return status_of(instance_null_argument(own, __func__));                                                   \
        *count = COUNT;                                                                                                \
        return fmi3OK;                                                                                                 \
    }

DEFINE_COUNT(fmi3GetNumberOfContinuousStates, model.n_states)
DEFINE_COUNT(fmi3GetNumberOfEventIndicators, engine_indicators(own->engine))
