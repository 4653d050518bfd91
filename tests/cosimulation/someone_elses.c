/* An FMU of FMI 2.0 that is not ours: x' = -rate x by the exact solution, one step never longer than `limit`.
   Its memory is the importer's, as FMI 2.0 wants it. What it does beyond that is chosen by `behaviour`. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { WELL, STUCK, ENDS, FAILS, CRAWLS, DIES, BREAKS, SHRUGS };

typedef struct {
    const fmi2CallbackFunctions *functions;
    char name[64];
    double t, x, rate, limit;
    int behaviour, steps, level, ended, double_rate;
} Block;

static void say(Block *block, fmi2Status status, const char *format, double number)
{
    block->functions->logger(block->functions->componentEnvironment, block->name, status, "logStatus", format, number);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)visible, (void)logging;
    if (!functions->allocateMemory || !functions->freeMemory || !location)
        return NULL;
    Block *block = functions->allocateMemory(1, sizeof *block);
    block->functions = functions;
    strncpy(block->name, name, sizeof block->name - 1);
    block->x = block->rate = 1.0;
    block->limit = INFINITY;
    block->level = 2;
    if (type != fmi2CoSimulation || strcmp(guid, "someone-else") != 0) {
        say(block, fmi2Error, "this is no block number %g", 7.0);
        functions->freeMemory(block);
        return NULL;
    }
    return block;
}

void fmi2FreeInstance(fmi2Component c) { ((Block *)c)->functions->freeMemory(c); }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)c, (void)on, (void)n, (void)categories;
    return fmi2OK;
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    ((Block *)c)->t = start;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { (void)c; return fmi2OK; }

static double *real(Block *block, fmi2ValueReference reference)
{
    return reference == 0 ? &block->x : reference == 1 ? &block->rate : reference == 2 ? &block->limit : NULL;
}
static int *integer(Block *block, fmi2ValueReference reference)
{
    return reference == 3 ? &block->behaviour : reference == 4 ? &block->steps : reference == 5 ? &block->level : NULL;
}
#define ACCESS(NAME, TYPE, PLACE)                                                                                      \
    fmi2Status fmi2Get##NAME(fmi2Component c, const fmi2ValueReference r[], size_t n, TYPE value[])                    \
    {                                                                                                                  \
        for (size_t i = 0; i < n; i++) {                                                                               \
            if (!PLACE(c, r[i]))                                                                                       \
                return fmi2Error;                                                                                      \
            value[i] = *PLACE(c, r[i]);                                                                                \
        }                                                                                                              \
        return fmi2OK;                                                                                                 \
    }                                                                                                                  \
    fmi2Status fmi2Set##NAME(fmi2Component c, const fmi2ValueReference r[], size_t n, const TYPE value[])              \
    {                                                                                                                  \
        for (size_t i = 0; i < n; i++) {                                                                               \
            if (!PLACE(c, r[i]))                                                                                       \
                return fmi2Error;                                                                                      \
            *PLACE(c, r[i]) = value[i];                                                                                \
        }                                                                                                              \
        return fmi2OK;                                                                                                 \
    }
static int *boolean(Block *block, fmi2ValueReference reference)
{
    return reference == 6 ? &block->double_rate : NULL;
}
ACCESS(Real, fmi2Real, real)
ACCESS(Integer, fmi2Integer, integer)
ACCESS(Boolean, fmi2Boolean, boolean)

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real point, fmi2Real size, fmi2Boolean no_set)
{
    Block *block = c;
    double h = fmin(size, block->limit);
    (void)no_set;
    block->steps++;
    if (block->behaviour == FAILS) {
        say(block, fmi2Error, "no solution at %g", point);
        return fmi2Error;
    }
    if (block->behaviour == BREAKS)
        return fmi2Fatal;
    if (block->behaviour == SHRUGS)
        return fmi2Discard;
    if (block->behaviour == DIES)
        _Exit(7);
    if (block->behaviour == STUCK)
        h = 0.0;
    if (block->behaviour == CRAWLS)
        h = 1e-9;
    if (block->behaviour == ENDS && point + h >= 1.0) {
        h = 1.0 - point;
        block->ended = 1;
        say(block, fmi2OK, "the tank ran empty at %g", 1.0);
    }
    block->x *= exp(-(block->double_rate ? 2.0 : 1.0) * block->rate * h);
    block->t = point + h;
    return h < size || block->ended ? fmi2Discard : fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    *value = ((Block *)c)->t;
    return kind == fmi2LastSuccessfulTime && ((Block *)c)->behaviour != SHRUGS ? fmi2OK : fmi2Discard;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    *value = ((Block *)c)->ended;
    return kind == fmi2Terminated && ((Block *)c)->behaviour != SHRUGS ? fmi2OK : fmi2Discard;
}
