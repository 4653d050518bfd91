/* A ball by forward Euler in steps of 1 ms behind the functions of FMI 3.0 that the driver calls: what
   an FMU in plain C costs that locates no impacts.  It stands in for the FMI Reference FMU where that
   is not at hand, and is no part of it: its own code, with the same work in each internal step.

   The solver knows the model by functions of another file there, and its vectors by pointers.  Without
   a compiler that sees through this, each internal step costs five calls; SEPARATE keeps it so here. */
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "fmi3Functions.h"

#define SEPARATE __attribute__((noinline, noclone))
#define SOLVER_STEP 1e-3
#define SLOWEST_REBOUND 0.1
#define N_STATES 2
#define N_INDICATORS 1

enum { REFERENCE_TIME, REFERENCE_H, REFERENCE_V };

typedef struct {
    double time, start_time, next_point;
    double h, v, g, e;
    unsigned long long n_steps;
    size_t n_states, n_indicators;
    double *x, *dx, *before, *after;
    bool event_mode_used, early_return_allowed;
} Ball;

/* ---- the model ---- */

SEPARATE static fmi3Status get_states(const Ball *ball, double *x, size_t n)
{
    (void)n;
    x[0] = ball->h;
    x[1] = ball->v;
    return fmi3OK;
}

SEPARATE static fmi3Status set_states(Ball *ball, const double *x, size_t n)
{
    (void)n;
    ball->h = x[0];
    ball->v = x[1];
    return fmi3OK;
}

SEPARATE static fmi3Status get_derivatives(const Ball *ball, double *dx, size_t n)
{
    (void)n;
    dx[0] = ball->v;
    dx[1] = -ball->g;
    return fmi3OK;
}

SEPARATE static fmi3Status get_indicators(const Ball *ball, double *z, size_t n)
{
    (void)n;
    z[0] = ball->h == 0.0 && ball->v == 0.0 ? 1.0 : ball->h;
    return fmi3OK;
}

SEPARATE static fmi3Status bounce(Ball *ball)
{
    if (ball->h > 0.0)
        return fmi3OK;
    ball->h = 0.0;
    ball->v = fabs(ball->v * ball->e);
    if (ball->v < SLOWEST_REBOUND)
        ball->v = ball->g = 0.0;
    return fmi3OK;
}

/* ---- the solver ---- */

SEPARATE static bool is_close(double a, double b)
{
    if (!isfinite(a) || !isfinite(b))
        return false;
    return fabs(a - b) <= 1e-5 || fabs(a - b) <= 1e-5 * fmax(fabs(a), fabs(b));
}

SEPARATE static fmi3Status solver_step(Ball *ball, bool *crossed)
{
    if (get_states(ball, ball->x, ball->n_states) != fmi3OK ||
        get_derivatives(ball, ball->dx, ball->n_states) != fmi3OK)
        return fmi3Error;
    for (size_t i = 0; i < ball->n_states; i++)
        ball->x[i] += SOLVER_STEP * ball->dx[i];
    if (set_states(ball, ball->x, ball->n_states) != fmi3OK)
        return fmi3Error;
    ball->n_steps++;
    ball->time = ball->start_time + (double)ball->n_steps * SOLVER_STEP;
    if (get_indicators(ball, ball->after, ball->n_indicators) != fmi3OK)
        return fmi3Error;
    *crossed = false;
    for (size_t i = 0; i < ball->n_indicators; i++)
        *crossed |= (ball->before[i] > 0.0) != (ball->after[i] > 0.0);
    double *swap = ball->before;
    ball->before = ball->after;
    ball->after = swap;
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded,
                      fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    Ball *ball = instance;
    double target = currentCommunicationPoint + communicationStepSize;
    (void)noSetFMUStatePriorToCurrentPoint;
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = false;
    *lastSuccessfulTime = ball->time;
    if (!is_close(currentCommunicationPoint, ball->next_point) || communicationStepSize <= 0.0)
        return fmi3Error;
    for (;;) {
        double next = ball->time + SOLVER_STEP;
        bool crossed;
        if (next > target && !is_close(next, target))
            break;
        if (solver_step(ball, &crossed) != fmi3OK)
            return fmi3Error;
        if (!crossed)
            continue;
        if (ball->event_mode_used)
            *eventHandlingNeeded = true;
        else if (bounce(ball) != fmi3OK || get_indicators(ball, ball->before, ball->n_indicators) != fmi3OK)
            return fmi3Error;
        if (ball->early_return_allowed) {
            *earlyReturn = !is_close(ball->time, target);
            break;
        }
    }
    ball->next_point = *earlyReturn ? ball->time : target;
    *lastSuccessfulTime = ball->time;
    return fmi3OK;
}

/* ---- the rest of the interface ---- */

static void set_up(Ball *ball)
{
    ball->time = ball->start_time = ball->next_point = 0.0;
    ball->n_steps = 0;
    ball->h = 1.0;
    ball->v = 0.0;
    ball->g = 9.81;
    ball->e = 0.7;
    get_indicators(ball, ball->before, N_INDICATORS);
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
    Ball *ball = calloc(1, sizeof *ball);
    double *vectors = calloc(2 * (N_STATES + N_INDICATORS), sizeof *vectors);
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
    (void)requiredIntermediateVariables, (void)nRequiredIntermediateVariables, (void)instanceEnvironment;
    (void)logMessage, (void)intermediateUpdate;
    if (!ball || !vectors) {
        free(ball);
        free(vectors);
        return NULL;
    }
    ball->n_states = N_STATES;
    ball->n_indicators = N_INDICATORS;
    ball->x = vectors;
    ball->dx = ball->x + N_STATES;
    ball->before = ball->dx + N_STATES;
    ball->after = ball->before + N_INDICATORS;
    ball->event_mode_used = eventModeUsed;
    ball->early_return_allowed = earlyReturnAllowed;
    set_up(ball);
    return ball;
}

void fmi3FreeInstance(fmi3Instance instance)
{
    Ball *ball = instance;
    free(ball->x);
    free(ball);
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    set_up(instance);
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    Ball *ball = instance;
    (void)toleranceDefined, (void)tolerance, (void)stopTimeDefined, (void)stopTime;
    ball->time = ball->start_time = ball->next_point = startTime;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[], size_t nValueReferences,
                          fmi3Float64 values[], size_t nValues)
{
    const Ball *ball = instance;
    if (nValues != nValueReferences)
        return fmi3Error;
    for (size_t i = 0; i < nValues; i++)
        switch (valueReferences[i]) {
        case REFERENCE_TIME: values[i] = ball->time; break;
        case REFERENCE_H: values[i] = ball->h; break;
        case REFERENCE_V: values[i] = ball->v; break;
        default: return fmi3Error;
        }
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    (void)instance;
    return fmi3OK;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime)
{
    Ball *ball = instance;
    *valuesOfContinuousStatesChanged = ball->h <= 0.0;
    *discreteStatesNeedUpdate = *terminateSimulation = *nominalsOfContinuousStatesChanged = false;
    *nextEventTimeDefined = false;
    *nextEventTime = 0.0;
    return bounce(ball);
}
