/* FMI 2.0 for Model Exchange and Co-Simulation, a thin layer over instance.h. */
#include "fmi2Functions.h"
#include "instance.h"

/* The memory functions and stepFinished of the importer are not used. */
typedef struct {
    Instance base;             /* first, so that one is the other */
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
} Fmi2;

/* An answer as a status of FMI 2.0: the numbers are the same. */
static fmi2Status status_of(Answer answer)
{
    return (fmi2Status)answer;
}

/* The message is an argument: the importer's logger takes it for a format otherwise. */
static void log_line(const Instance *instance, Answer level, const char *category, const char *message)
{
    const Fmi2 *own = (const Fmi2 *)instance;
    own->logger(own->environment, instance->name ? instance->name : "", status_of(level), category, "%s", message);
}

/* ---- life cycle ---- */

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    Fmi2 made = {.base = {.name = instanceName, .logging = loggingOn != fmi2False,
                          .interface = fmuType == fmi2ModelExchange ? MODEL_EXCHANGE : CO_SIMULATION}};
    (void)fmuResourceLocation, (void)visible;
    if (functions && functions->logger) {
        made.base.log_line = log_line;
        made.logger = functions->logger;
        made.environment = functions->componentEnvironment;
    }
    return instance_new(&made.base, sizeof made, __func__, fmuGUID);
}

void fmi2FreeInstance(fmi2Component c)
{
    instance_free(c, __func__);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    return status_of(instance_log(c, __func__, loggingOn != fmi2False, nCategories, categories));
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    const Experiment experiment = {.has_tolerance = toleranceDefined != fmi2False, .tolerance = tolerance,
                                   .has_stop = stopTimeDefined != fmi2False, .stop = stopTime, .start = startTime};
    return status_of(instance_set_up(c, __func__, &experiment));
}

#define SIMPLE(NAME, CALL)                                                                                             \
    fmi2Status NAME(fmi2Component c)                                                                                   \
    {                                                                                                                  \
        return status_of(CALL);                                                                                        \
    }

SIMPLE(fmi2EnterInitializationMode, instance_enter_initialization(c, __func__))
SIMPLE(fmi2ExitInitializationMode, instance_exit_initialization(c, __func__))
SIMPLE(fmi2Terminate, instance_terminate(c, __func__))
SIMPLE(fmi2Reset, instance_reset(c, __func__))

/* ---- values ---- */

#define ACCESS(NAME, NUMBER, MODEL_TYPE, FROM_NUMBER)                                                                  \
    static void put##NAME(void *to, size_t i, double number)                                                           \
    {                                                                                                                  \
        ((NUMBER *)to)[i] = FROM_NUMBER;                                                                               \
    }                                                                                                                  \
    static double take##NAME(const void *from, size_t i)                                                               \
    {                                                                                                                  \
        return (double)((const NUMBER *)from)[i];                                                                      \
    }                                                                                                                  \
    fmi2Status fmi2Get##NAME(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, NUMBER value[])               \
    {                                                                                                                  \
        return status_of(instance_get(c, __func__, MODEL_TYPE, vr, nvr, value, nvr, put##NAME));                       \
    }                                                                                                                  \
    fmi2Status fmi2Set##NAME(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const NUMBER value[])         \
    {                                                                                                                  \
        return status_of(instance_set(c, __func__, MODEL_TYPE, vr, nvr, value, nvr, take##NAME));                      \
    }

ACCESS(Real, fmi2Real, TYPE_FLOAT64, number)
ACCESS(Integer, fmi2Integer, TYPE_INT32, (fmi2Integer)number)
ACCESS(Boolean, fmi2Boolean, TYPE_BOOLEAN, number != 0.0)

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
{
    (void)vr, (void)value;
    return status_of(instance_no_type(c, __func__, nvr, false));
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
{
    (void)vr, (void)value;
    return status_of(instance_no_type(c, __func__, nvr, true));
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[])
{
    const Direction knowns = {vKnown_ref, nKnown, dvKnown, NULL, nKnown};
    const Direction unknowns = {vUnknown_ref, nUnknown, NULL, dvUnknown, nUnknown};
    return status_of(instance_derivatives(c, __func__, &unknowns, &knowns, true));
}

/* ---- saved states ---- */

#define STATE(NAME, PLACE, CALL)                                                                                       \
    fmi2Status NAME(fmi2Component c, PLACE)                                                                            \
    {                                                                                                                  \
        return status_of(CALL);                                                                                        \
    }

STATE(fmi2GetFMUstate, fmi2FMUstate *state, instance_save(c, __func__, state))
STATE(fmi2SetFMUstate, fmi2FMUstate state, instance_restore(c, __func__, state))
STATE(fmi2FreeFMUstate, fmi2FMUstate *state, instance_forget(c, __func__, state))

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    return status_of(instance_serialized_size(c, __func__, FMUstate, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size)
{
    return status_of(instance_serialize(c, __func__, FMUstate, (unsigned char *)serializedState, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate)
{
    return status_of(instance_deserialize(c, __func__, (const unsigned char *)serializedState, size, FMUstate));
}

/* ---- Model Exchange ---- */

SIMPLE(fmi2EnterEventMode, instance_enter_event_mode(c, __func__, MODE_EVENT | MODE_CONTINUOUS))
SIMPLE(fmi2EnterContinuousTimeMode, instance_leave_event_mode(c, __func__, MODE_CONTINUOUS))

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *eventInfo)
{
    EventUpdate found;
    Instance *instance = instance_enter(c, __func__, MODE_EVENT);
    if (!instance || !eventInfo)
        return status_of(instance ? instance_null_argument(instance, __func__) : ANSWER_ERROR);
    Answer answer = instance_update(c, __func__, &found);
    const fmi2EventInfo info = {found.again, found.terminate, found.nominals_changed, found.states_changed,
                                found.has_next, found.next};
    *eventInfo = info;
    return status_of(answer);
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
{
    bool event = false, end = false;
    (void)noSetFMUStatePriorToCurrentPoint;
    Answer answer = instance_completed_step(c, __func__, enterEventMode ? &event : NULL,
                                            terminateSimulation ? &end : NULL);
    if (answer == ANSWER_OK && enterEventMode && terminateSimulation) {
        *enterEventMode = event;
        *terminateSimulation = end;
    }
    return status_of(answer);
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time)
{
    return status_of(instance_set_time(c, __func__, time));
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx)
{
    return status_of(instance_set_states(c, __func__, x, nx));
}

#define VECTOR(NAME, CALL)                                                                                             \
    fmi2Status NAME(fmi2Component c, fmi2Real to[], size_t n)                                                          \
    {                                                                                                                  \
        return status_of(CALL);                                                                                        \
    }

VECTOR(fmi2GetDerivatives, instance_get_vector(c, __func__, BANK_DERIVATIVE, to, n))
VECTOR(fmi2GetEventIndicators, instance_get_vector(c, __func__, BANK_INDICATOR, to, n))
VECTOR(fmi2GetContinuousStates, instance_get_vector(c, __func__, BANK_STATE, to, n))
VECTOR(fmi2GetNominalsOfContinuousStates, instance_nominals(c, __func__, to, n))

/* ---- Co-Simulation ---- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    return status_of(instance_unsupported(c, __func__));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    return status_of(instance_output_rates(c, __func__, vr, nvr, order, value, nvr));
}

/* Jumps are taken inside the step, at their own times.  Where the importer has set the option, the step ends
   at the first of them instead, and so it does where the run ends: fmi2Discard, and fmi2GetStatus tells more. */
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    StepReport report;
    Instance *instance = instance_enter(c, __func__, MODE_STEP);
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!instance)
        return fmi2Error;
    if (instance_step_quietly(instance, currentCommunicationPoint, communicationStepSize))
        return fmi2OK;
    EventPolicy policy = instance->run->stop_at_events ? EVENTS_STOP_AFTER : EVENTS_INSIDE;
    Answer answer =
        instance_step(instance, __func__, currentCommunicationPoint, communicationStepSize, policy, &report);
    return answer == ANSWER_OK && (report.early || report.terminate) ? fmi2Discard : status_of(answer);
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    const Instance *instance = instance_enter(c, __func__, MODE_ANY);
    if (instance)
        instance_refuse(instance, "%s: %s: a step is never under way when it returns, so there is none to cancel.",
                        instance->name, __func__);
    return fmi2Error;
}

static fmi2Status no_such_status(fmi2Component c, const char *function, fmi2StatusKind s)
{
    const Instance *instance = instance_enter_kind(c, function, CO_SIMULATION, MODE_STEP | MODE_TERMINATED);
    if (!instance)
        return fmi2Error;
    instance_refuse(instance, "%s: %s: there is no status of kind %d of that type.", instance->name, function, (int)s);
    return fmi2Discard;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    (void)value;
    return no_such_status(c, __func__, s);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    const Instance *instance = instance_enter_kind(c, __func__, CO_SIMULATION, MODE_STEP | MODE_TERMINATED);
    if (!instance || !value)
        return status_of(instance ? instance_null_argument(instance, __func__) : ANSWER_ERROR);
    if (s != fmi2LastSuccessfulTime)
        return no_such_status(c, __func__, s);
    *value = instance->run->time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    (void)value;
    return no_such_status(c, __func__, s);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    const Instance *instance = instance_enter_kind(c, __func__, CO_SIMULATION, MODE_STEP | MODE_TERMINATED);
    if (!instance || !value)
        return status_of(instance ? instance_null_argument(instance, __func__) : ANSWER_ERROR);
    if (s != fmi2Terminated)
        return no_such_status(c, __func__, s);
    *value = instance->run->end_reported != 0;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    (void)value;
    return no_such_status(c, __func__, s);
}
