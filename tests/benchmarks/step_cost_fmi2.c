/* FMI 2.0 Co-Simulation: as FMI 3.0, without event mode. */
#include <stdio.h>
#include <stdlib.h>

#include "fmi2FunctionTypes.h"
#include "step_cost.h"

typedef struct {
    fmi2InstantiateTYPE *instantiate;
    fmi2ResetTYPE *reset;
    fmi2SetupExperimentTYPE *set_up;
    fmi2EnterInitializationModeTYPE *enter_initialization;
    fmi2ExitInitializationModeTYPE *exit_initialization;
    fmi2DoStepTYPE *step;
    fmi2GetRealTYPE *get;
    fmi2GetFMUstateTYPE *save;
    fmi2SetFMUstateTYPE *restore;
    fmi2FreeFMUstateTYPE *discard;
    fmi2FreeInstanceTYPE *destroy;
} Functions;

static void tell(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                 fmi2String message, ...)
{
    (void)environment, (void)category;
    if (status != fmi2OK)
        fprintf(stderr, "%s: %s\n", name, message);
}

#define FIND(field, type, name) (functions->field = (type *)find_function(library, name))

static bool load(Contender *contender)
{
    void *library = open_library(contender);
    Functions *functions = calloc(1, sizeof *functions);
    contender->functions = functions;
    if (!library || !functions)
        return false;
    bool found = FIND(instantiate, fmi2InstantiateTYPE, "fmi2Instantiate") && FIND(reset, fmi2ResetTYPE, "fmi2Reset") &&
                 FIND(set_up, fmi2SetupExperimentTYPE, "fmi2SetupExperiment") &&
                 FIND(enter_initialization, fmi2EnterInitializationModeTYPE, "fmi2EnterInitializationMode") &&
                 FIND(exit_initialization, fmi2ExitInitializationModeTYPE, "fmi2ExitInitializationMode") &&
                 FIND(step, fmi2DoStepTYPE, "fmi2DoStep") && FIND(get, fmi2GetRealTYPE, "fmi2GetReal") &&
                 FIND(destroy, fmi2FreeInstanceTYPE, "fmi2FreeInstance");
    if (contender->has_states)
        found = found && FIND(save, fmi2GetFMUstateTYPE, "fmi2GetFMUstate") &&
                FIND(restore, fmi2SetFMUstateTYPE, "fmi2SetFMUstate") &&
                FIND(discard, fmi2FreeFMUstateTYPE, "fmi2FreeFMUstate");
    return found || failed(contender, "a function is missing");
}

static bool start(Contender *contender, bool events)
{
    static const fmi2CallbackFunctions callbacks = {tell, calloc, free, NULL, NULL};
    const Functions *f = contender->functions;
    void **instance = &contender->plain;
    if (events)
        return failed(contender, "FMI 2.0 has no event mode");
    if (!*instance)
        *instance = f->instantiate(contender->name, fmi2CoSimulation, contender->token, contender->resources,
                                   &callbacks, fmi2False, fmi2False);
    else if (f->reset(*instance) != fmi2OK)
        return failed(contender, "fmi2Reset");
    if (!*instance)
        return failed(contender, "fmi2Instantiate");
    if (f->set_up(*instance, fmi2False, 0.0, 0.0, fmi2False, 0.0) != fmi2OK ||
        f->enter_initialization(*instance) != fmi2OK || f->exit_initialization(*instance) != fmi2OK)
        return failed(contender, "initialization");
    return true;
}

static bool steps(Contender *contender, size_t first, size_t n, double size)
{
    const Functions *f = contender->functions;
    for (size_t i = first; i < first + n; i++)
        if (f->step(contender->plain, (double)i * size, size, fmi2True) != fmi2OK)
            return failed(contender, "fmi2DoStep");
    return true;
}

static bool steps_and_reads(Contender *contender, size_t first, size_t n, double size)
{
    const Functions *f = contender->functions;
    for (size_t i = first; i < first + n; i++)
        if (!steps(contender, i, 1, size) ||
            f->get(contender->plain, contender->references, contender->n_values, contender->values) != fmi2OK)
            return failed(contender, "fmi2DoStep, fmi2GetReal");
    return true;
}

static bool reads(Contender *contender, size_t n)
{
    const Functions *f = contender->functions;
    for (size_t i = 0; i < n; i++)
        if (f->get(contender->plain, contender->references, 1, contender->values) != fmi2OK)
            return failed(contender, "fmi2GetReal");
    return true;
}

static bool saves(Contender *contender, size_t n)
{
    const Functions *f = contender->functions;
    for (size_t i = 0; i < n; i++)
        if (f->save(contender->plain, &contender->saved) != fmi2OK ||
            f->restore(contender->plain, contender->saved) != fmi2OK)
            return failed(contender, "fmi2GetFMUstate, fmi2SetFMUstate");
    return true;
}

static void unload(Contender *contender)
{
    const Functions *f = contender->functions;
    if (contender->saved)
        f->discard(contender->plain, &contender->saved);
    if (contender->plain)
        f->destroy(contender->plain);
    free(contender->functions);
}

const Interface interface2 = {"2.0", load, start, steps, steps_and_reads, reads, saves, NULL, unload};
