/* FMI 3.0 Co-Simulation. */
#include <stdio.h>
#include <stdlib.h>

#include "fmi3FunctionTypes.h"
#include "step_cost.h"

typedef struct {
    fmi3InstantiateCoSimulationTYPE *instantiate;
    fmi3ResetTYPE *reset;
    fmi3EnterInitializationModeTYPE *enter_initialization;
    fmi3ExitInitializationModeTYPE *exit_initialization;
    fmi3DoStepTYPE *step;
    fmi3GetFloat64TYPE *get;
    fmi3GetFMUStateTYPE *save;
    fmi3SetFMUStateTYPE *restore;
    fmi3FreeFMUStateTYPE *discard;
    fmi3EnterEventModeTYPE *enter_events;
    fmi3EnterStepModeTYPE *enter_steps;
    fmi3UpdateDiscreteStatesTYPE *update;
    fmi3FreeInstanceTYPE *destroy;
} Functions;

static void tell(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)environment, (void)category;
    if (status != fmi3OK)
        fprintf(stderr, "%s\n", message);
}

/* Libraries return functions as one type and mean another. */
#define FIND(field, type, name) (functions->field = (type *)find_function(library, name))

static bool load(Contender *contender)
{
    void *library = open_library(contender);
    Functions *functions = calloc(1, sizeof *functions);
    contender->functions = functions;
    if (!library || !functions)
        return false;
    bool found = FIND(instantiate, fmi3InstantiateCoSimulationTYPE, "fmi3InstantiateCoSimulation") &&
                 FIND(reset, fmi3ResetTYPE, "fmi3Reset") &&
                 FIND(enter_initialization, fmi3EnterInitializationModeTYPE, "fmi3EnterInitializationMode") &&
                 FIND(exit_initialization, fmi3ExitInitializationModeTYPE, "fmi3ExitInitializationMode") &&
                 FIND(step, fmi3DoStepTYPE, "fmi3DoStep") && FIND(get, fmi3GetFloat64TYPE, "fmi3GetFloat64") &&
                 FIND(destroy, fmi3FreeInstanceTYPE, "fmi3FreeInstance");
    if (contender->has_states)
        found = found && FIND(save, fmi3GetFMUStateTYPE, "fmi3GetFMUState") &&
                FIND(restore, fmi3SetFMUStateTYPE, "fmi3SetFMUState") &&
                FIND(discard, fmi3FreeFMUStateTYPE, "fmi3FreeFMUState");
    if (contender->has_events)
        found = found && FIND(enter_events, fmi3EnterEventModeTYPE, "fmi3EnterEventMode") &&
                FIND(enter_steps, fmi3EnterStepModeTYPE, "fmi3EnterStepMode") &&
                FIND(update, fmi3UpdateDiscreteStatesTYPE, "fmi3UpdateDiscreteStates");
    return found || failed(contender, "a function is missing");
}

static bool start(Contender *contender, bool events)
{
    const Functions *f = contender->functions;
    void **instance = events ? &contender->with_events : &contender->plain;
    if (!*instance)
        *instance = f->instantiate(contender->name, contender->token, contender->resources, fmi3False, fmi3False,
                                   events, events, NULL, 0, NULL, tell, NULL);
    else if (f->reset(*instance) != fmi3OK)
        return failed(contender, "fmi3Reset");
    if (!*instance)
        return failed(contender, "fmi3InstantiateCoSimulation");
    if (f->enter_initialization(*instance, fmi3False, 0.0, 0.0, fmi3False, 0.0) != fmi3OK ||
        f->exit_initialization(*instance) != fmi3OK)
        return failed(contender, "initialization");
    return true;
}

static bool steps(Contender *contender, size_t first, size_t n, double size)
{
    const Functions *f = contender->functions;
    fmi3Boolean event = fmi3False, terminate = fmi3False, early = fmi3False;
    fmi3Float64 last = 0.0;
    for (size_t i = first; i < first + n; i++)
        if (f->step(contender->plain, (double)i * size, size, fmi3True, &event, &terminate, &early, &last) != fmi3OK ||
            terminate)
            return failed(contender, "fmi3DoStep");
    return true;
}

static bool read_values(Contender *contender, void *instance)
{
    const Functions *f = contender->functions;
    return f->get(instance, contender->references, contender->n_values, contender->values, contender->n_values) ==
           fmi3OK;
}

static bool steps_and_reads(Contender *contender, size_t first, size_t n, double size)
{
    for (size_t i = first; i < first + n; i++)
        if (!steps(contender, i, 1, size) || !read_values(contender, contender->plain))
            return failed(contender, "fmi3DoStep, fmi3GetFloat64");
    return true;
}

static bool reads(Contender *contender, size_t n)
{
    const Functions *f = contender->functions;
    for (size_t i = 0; i < n; i++)
        if (f->get(contender->plain, contender->references, 1, contender->values, 1) != fmi3OK)
            return failed(contender, "fmi3GetFloat64");
    return true;
}

static bool saves(Contender *contender, size_t n)
{
    const Functions *f = contender->functions;
    for (size_t i = 0; i < n; i++)
        if (f->save(contender->plain, &contender->saved) != fmi3OK ||
            f->restore(contender->plain, contender->saved) != fmi3OK)
            return failed(contender, "fmi3GetFMUState, fmi3SetFMUState");
    return true;
}

/* The event iteration; `next` becomes the announced time, or `never`. */
static bool handle_event(const Contender *contender, double never, double *next)
{
    const Functions *f = contender->functions;
    fmi3Boolean again = fmi3True, terminate = fmi3False, nominals, values, defined = fmi3False;
    while (again && !terminate)
        if (f->update(contender->with_events, &again, &terminate, &nominals, &values, &defined, next) != fmi3OK)
            return false;
    if (!defined)
        *next = never;
    return !terminate && f->enter_steps(contender->with_events) == fmi3OK;
}

static bool event_steps(Contender *contender, size_t n, double size, bool obey, EventRun *run)
{
    const Functions *f = contender->functions;
    double t = 0.0, never = 1e300, next = never;
    *run = (EventRun){0, 0};
    if (!handle_event(contender, never, &next))
        return failed(contender, "fmi3UpdateDiscreteStates");
    for (size_t i = 1; i <= n; i++) {
        double point = (double)i * size;
        while (t < point) {
            double target = obey && next < point ? next : point;
            fmi3Boolean event = fmi3False, terminate = fmi3False, early = fmi3False;
            fmi3Float64 last = t;
            run->calls++;
            if (f->step(contender->with_events, t, target - t, fmi3True, &event, &terminate, &early, &last) != fmi3OK ||
                terminate)
                return failed(contender, "fmi3DoStep in event mode");
            t = early ? last : target;
            if (!event && !(obey && t >= next))
                continue;
            run->events++;
            if (f->enter_events(contender->with_events) != fmi3OK || !handle_event(contender, never, &next))
                return failed(contender, "Event Mode");
        }
    }
    return true;
}

static void unload(Contender *contender)
{
    const Functions *f = contender->functions;
    if (contender->saved)
        f->discard(contender->plain, &contender->saved);
    if (contender->plain)
        f->destroy(contender->plain);
    if (contender->with_events)
        f->destroy(contender->with_events);
    free(contender->functions);
}

const Interface interface3 = {"3.0", load, start, steps, steps_and_reads, reads, saves, event_steps, unload};
