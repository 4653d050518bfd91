/* An FMU of FMI 2.0 that is not ours: x' = gain u, exactly for inputs that go along straight lines, whose slopes it
   takes; it gives the derivative of x. Both as FMI 2.0.4, section 4.2.1, has it. */
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { X, U, GAIN, VARIABLES };
typedef struct {
    double values[VARIABLES], slope;
} Block;

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String place,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    Block *b = calloc(1, sizeof *b);
    (void)name, (void)type, (void)guid, (void)place, (void)functions, (void)visible, (void)logging;
    b->values[GAIN] = 1.0;
    return b;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real t, fmi2Boolean d, fmi2Real e) { return fmi2OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_set)
{
    Block *b = c;
    b->values[X] += b->values[GAIN] * h * (b->values[U] + 0.5 * h * b->slope);
    b->values[U] += h * b->slope;
    return fmi2OK;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[])
{
    for (size_t k = 0; k < n; k++) v[k] = ((Block *)c)->values[r[k]];
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real v[])
{
    for (size_t k = 0; k < n; k++) ((Block *)c)->values[r[k]] = v[k];
    return fmi2OK;
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer orders[],
                                       const fmi2Real v[])
{
    if (n != 1 || r[0] != U || orders[0] != 1) return fmi2Error;
    ((Block *)c)->slope = v[0];
    return fmi2OK;
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer orders[],
                                        fmi2Real v[])
{
    Block *b = c;
    if (n != 1 || r[0] != X || orders[0] != 1) return fmi2Error;
    v[0] = b->values[GAIN] * b->values[U];
    return fmi2OK;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s)
{
    if (!*s) *s = malloc(sizeof(Block));
    memcpy(*s, c, sizeof(Block));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { memcpy(c, s, sizeof(Block)); return fmi2OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) { free(*s); *s = NULL; return fmi2OK; }
