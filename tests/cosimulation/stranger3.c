/* An FMU of FMI 3.0 that is not ours: x rises at `rate` and is set back to 0 at 1, which `count` counts.
   It says of its time what it rounded to 1e-6 s, tells nobody of its events beforehand unless it `announces` them, and
   echoes values of all types. What else it does is chosen by `behaviour`, and by words in its token:
   "stateless": it cannot save its state; "rigid": its steps have one length, 0.1 s. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fmi3Functions.h"

enum { WELL, STALLS, REPEATS, CREEPS, DIES, FAILS, PANTS, HANGS, ABORTS, ITERATES,
       PASTS, BEYOND, BACKWARD, THRICE, LEAVES, BLINDED };
enum { X = 1, COUNT, RATE, ENDS, BEHAVIOUR, ANNOUNCES, SIZE, WEIGHTS, TOTAL, STEPS, SENT, HEARD, GAIN, GAINED, PULSE,
       FIRST_ECHO = 20, ECHOES = 40 };
enum { MOST = 100 };

typedef struct {
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    double t, next, stop, last, rate, weights[MOST], reals[ECHOES], heard, gain;
    float singles[ECHOES];
    int64_t wholes[ECHOES];
    uint64_t naturals[ECHOES], size;
    int32_t count, ends, behaviour, steps;
    int updates, announces, events, stateless, rigid, configuring, initializing, frozen;
    char text[100];
    unsigned char bytes[100];
    size_t length;
} Block;

/* States that are saved and not freed, of all instances. */
int stranger_held;

static fmi3Status refuse(Block *b, const char *format, double number)
{
    char text[200];
    snprintf(text, sizeof text, format, number);
    if (b->log)
        b->log(b->environment, fmi3Error, "logStatusError", text);
    return fmi3Error;
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events,
    fmi3Boolean early, const fmi3ValueReference wanted[], size_t n, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)early, (void)wanted, (void)n, (void)update;
    if (strncmp(token, "stranger", 8) != 0)
        return NULL;
    Block *b = calloc(1, sizeof *b);
    b->environment = environment;
    b->log = log;
    b->rate = b->gain = 1.0;
    b->ends = 1000000;
    b->size = 2;
    b->weights[0] = b->weights[1] = 1.0;
    strcpy(b->text, "nothing");
    b->events = events;
    b->stateless = strstr(token, "stateless") != NULL;
    b->rigid = strstr(token, "rigid") != NULL;
    return b;
}

void fmi3FreeInstance(fmi3Instance i)
{
    if (((Block *)i)->behaviour == LEAVES)
        abort();
    free(i);
}
fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop)
{
    (void)has_tolerance, (void)tolerance;
    Block *b = i;
    b->t = b->next = b->last = start;
    b->stop = has_stop ? stop : INFINITY;
    b->initializing = b->frozen = 1;
    return fmi3OK;
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance i) { ((Block *)i)->initializing = 0; return fmi3OK; }
fmi3Status fmi3EnterEventMode(fmi3Instance i) { return ((Block *)i)->events ? fmi3OK : fmi3Error; }
fmi3Status fmi3EnterStepMode(fmi3Instance i) { (void)i; return fmi3OK; }
fmi3Status fmi3Terminate(fmi3Instance i) { (void)i; return fmi3OK; }
fmi3Status fmi3EnterConfigurationMode(fmi3Instance i)
{
    Block *b = i;
    if (b->frozen)
        return refuse(b, "no Configuration Mode after initialization", 0.0);
    b->configuring = 1;
    return fmi3OK;
}
fmi3Status fmi3ExitConfigurationMode(fmi3Instance i) { ((Block *)i)->configuring = 0; return fmi3OK; }

/* Stepping. */

static double due(const Block *b) { return b->rate > 0.0 ? b->last + 1.0 / b->rate : INFINITY; }
static void jump(Block *b)
{
    b->last = due(b);
    b->count++;
}

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance i, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                    fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *time)
{
    Block *b = i;
    if (b->next >= due(b) - 1e-9)
        jump(b);
    *nominals = *values = 0;
    b->updates++;
    *again = b->behaviour == ITERATES || (b->behaviour == THRICE && b->updates % 3 != 0);
    *terminate = b->count >= b->ends;
    *defined = b->announces || b->behaviour == PASTS;
    *time = b->behaviour == PASTS ? b->next - 1.0 : due(b);
    return fmi3OK;
}

/* The clock ticks in the second of three iterations alone. */
fmi3Status fmi3GetClock(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Clock v[])
{
    Block *b = i;
    for (size_t j = 0; j < n; j++)
        v[j] = r[j] == PULSE && b->behaviour == THRICE && b->count > 0 && b->updates % 3 == 1;
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance i, fmi3Float64 point, fmi3Float64 size, fmi3Boolean no_set, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *time)
{
    (void)no_set;
    Block *b = i;
    *event = *terminate = *early = 0;
    *time = point;
    b->steps++;
    if (fabs(point - b->next) > 1e-6)
        return refuse(b, "this step does not begin at %.17g", b->next);
    if (!(size > 0.0))
        return refuse(b, "no step of %.17g", size);
    if (b->rigid && fabs(size - 0.1) > 1e-9)
        return refuse(b, "no step of %.17g: steps have the length 0.1", size);
    if (point + size > b->stop + 1e-9)
        return refuse(b, "this step ends behind the stop time %.17g", b->stop);
    if (b->behaviour == DIES)
        _Exit(7);
    if (b->behaviour == ABORTS && point > 0.45)
        abort();
    while (b->behaviour == HANGS)
        sleep(1);
    if (b->behaviour == FAILS)
        return refuse(b, "no solution at %.17g", point);
    double target = point + size;
    if (b->behaviour == STALLS || b->behaviour == REPEATS || b->behaviour == CREEPS) {
        *early = 1;
        *event = b->behaviour == REPEATS;
        *time = b->next = b->behaviour == CREEPS ? nextafter(point, INFINITY) : point;
        return fmi3OK;
    }
    if ((b->behaviour == BEYOND || b->behaviour == BACKWARD) && point > 0.45) {
        *event = *early = 1;
        *time = b->next = b->behaviour == BEYOND ? target + 1.0 : point - 0.2;
        return fmi3OK;
    }
    if (b->behaviour == PANTS && size > 0.03) {
        *early = 1;
        target = point + 0.03;
    }
    while (due(b) <= target && !*event && b->count < b->ends) {
        if (b->events) {
            *event = 1;
            *early = due(b) < target;
            target = due(b);
        } else {
            jump(b);
            *terminate = b->count >= b->ends;
            if (*terminate)
                target = b->last;
        }
    }
    b->t = b->next = target;
    *time = *early || *terminate ? target : rint(target * 1e6) / 1e6;
    return fmi3OK;
}

/* Variables. */

static double *real(Block *b, fmi3ValueReference r)
{
    if (r == RATE)
        return &b->rate;
    if (r == HEARD)
        return &b->heard;
    if (r == GAIN)
        return &b->gain;
    return r >= FIRST_ECHO && r < FIRST_ECHO + ECHOES ? &b->reals[(r - FIRST_ECHO) / 2] : NULL;
}

fmi3Status fmi3GetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], size_t m)
{
    Block *b = i;
    double sum = 0.0;
    if (b->behaviour == BLINDED && b->next > 0.45)
        abort();
    for (uint64_t k = 0; k < b->size; k++)
        sum += b->weights[k];
    for (size_t j = 0; j < n; j++, v++, m--) {
        if (r[j] == WEIGHTS) {
            if (m < b->size || (n == 1 && m > b->size))
                return refuse(b, "weights have %g elements", (double)b->size);
            memcpy(v, b->weights, b->size * sizeof *v);
            v += b->size - 1, m -= b->size - 1;
        } else if (r[j] == 0)
            *v = b->next;
        else if (r[j] == X)
            *v = (b->next - b->last) * b->rate;
        else if (r[j] == TOTAL)
            *v = sum;
        else if (r[j] == GAINED)
            *v = b->gain * b->heard;
        else if (real(b, r[j]))
            *v = *real(b, r[j]);
        else
            return refuse(b, "no Float64 %g", r[j]);
    }
    return fmi3OK;
}
fmi3Status fmi3SetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[], size_t m)
{
    Block *b = i;
    for (size_t j = 0; j < n; j++) {
        if (r[j] == WEIGHTS) {
            if (m != b->size)
                return refuse(b, "weights have %g elements", (double)b->size);
            memcpy(b->weights, v, m * sizeof *v);
        } else if (real(b, r[j]))
            *real(b, r[j]) = v[j];
        else
            return refuse(b, "Float64 %g cannot be set", r[j]);
    }
    return fmi3OK;
}

static int32_t *integer(Block *b, fmi3ValueReference r)
{
    return r == ENDS ? &b->ends : r == BEHAVIOUR ? &b->behaviour : NULL;
}
#define NUMBER(NAME, TYPE, PLACE)                                                                                      \
    fmi3Status fmi3Get##NAME(fmi3Instance i, const fmi3ValueReference r[], size_t n, TYPE v[], size_t m)               \
    {                                                                                                                  \
        Block *b = i;                                                                                                  \
        (void)m;                                                                                                       \
        for (size_t j = 0; j < n; j++) {                                                                               \
            if (r[j] == COUNT || r[j] == STEPS || r[j] == SENT)                                                        \
                v[j] = (TYPE)(r[j] == STEPS ? b->steps : b->count);                                                    \
            else if (r[j] == SIZE)                                                                                     \
                v[j] = (TYPE)b->size;                                                                                  \
            else if (integer(b, r[j]))                                                                                 \
                v[j] = (TYPE)*integer(b, r[j]);                                                                        \
            else if (r[j] >= FIRST_ECHO && r[j] < FIRST_ECHO + ECHOES)                                                 \
                v[j] = (TYPE)b->PLACE[(r[j] - FIRST_ECHO) / 2];                                                        \
            else                                                                                                       \
                return refuse(b, "no " #NAME " %g", r[j]);                                                             \
        }                                                                                                              \
        return fmi3OK;                                                                                                 \
    }                                                                                                                  \
    fmi3Status fmi3Set##NAME(fmi3Instance i, const fmi3ValueReference r[], size_t n, const TYPE v[], size_t m)         \
    {                                                                                                                  \
        Block *b = i;                                                                                                  \
        (void)m;                                                                                                       \
        for (size_t j = 0; j < n; j++) {                                                                               \
            if (r[j] == SIZE) {                                                                                        \
                if (!b->configuring || (double)v[j] < 1.0 || (double)v[j] > MOST)                                      \
                    return refuse(b, "the size is for Configuration Mode, and at most 100: not %g", (double)v[j]);     \
                b->size = (uint64_t)v[j];                                                                              \
                for (uint64_t k = 0; k < b->size; k++)                                                                 \
                    b->weights[k] = 1.0;                                                                               \
            } else if (integer(b, r[j]))                                                                               \
                *integer(b, r[j]) = (int32_t)v[j];                                                                     \
            else if (r[j] >= FIRST_ECHO && r[j] < FIRST_ECHO + ECHOES)                                                 \
                b->PLACE[(r[j] - FIRST_ECHO) / 2] = v[j];                                                              \
            else                                                                                                       \
                return refuse(b, #NAME " %g cannot be set", r[j]);                                                     \
        }                                                                                                              \
        return fmi3OK;                                                                                                 \
    }
NUMBER(Float32, fmi3Float32, singles)
NUMBER(Int8, fmi3Int8, wholes)
NUMBER(UInt8, fmi3UInt8, wholes)
NUMBER(Int16, fmi3Int16, wholes)
NUMBER(UInt16, fmi3UInt16, wholes)
NUMBER(Int32, fmi3Int32, wholes)
NUMBER(UInt32, fmi3UInt32, wholes)
NUMBER(Int64, fmi3Int64, wholes)
NUMBER(UInt64, fmi3UInt64, naturals)

fmi3Status fmi3GetBoolean(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Boolean v[], size_t m)
{
    Block *b = i;
    (void)m;
    for (size_t j = 0; j < n; j++)
        v[j] = r[j] == ANNOUNCES ? b->announces : b->wholes[(r[j] - FIRST_ECHO) / 2] != 0;
    return fmi3OK;
}
fmi3Status fmi3SetBoolean(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Boolean v[], size_t m)
{
    Block *b = i;
    (void)m;
    for (size_t j = 0; j < n; j++)
        if (r[j] == ANNOUNCES)
            b->announces = v[j];
        else
            b->wholes[(r[j] - FIRST_ECHO) / 2] = v[j];
    return fmi3OK;
}
fmi3Status fmi3GetString(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3String v[], size_t m)
{
    (void)r, (void)m;
    for (size_t j = 0; j < n; j++)
        v[j] = ((Block *)i)->text;
    return fmi3OK;
}
fmi3Status fmi3SetString(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3String v[], size_t m)
{
    (void)r, (void)m;
    for (size_t j = 0; j < n; j++)
        snprintf(((Block *)i)->text, sizeof ((Block *)i)->text, "%s", v[j]);
    return fmi3OK;
}
fmi3Status fmi3GetBinary(fmi3Instance i, const fmi3ValueReference r[], size_t n, size_t sizes[], fmi3Binary v[], size_t m)
{
    (void)r, (void)m;
    for (size_t j = 0; j < n; j++) {
        v[j] = ((Block *)i)->bytes;
        sizes[j] = ((Block *)i)->length;
    }
    return fmi3OK;
}
fmi3Status fmi3SetBinary(fmi3Instance i, const fmi3ValueReference r[], size_t n, const size_t sizes[],
                         const fmi3Binary v[], size_t m)
{
    Block *b = i;
    (void)r, (void)m;
    for (size_t j = 0; j < n; j++) {
        if (sizes[j] > sizeof b->bytes)
            return refuse(b, "%g bytes are too many", (double)sizes[j]);
        memcpy(b->bytes, v[j], sizes[j]);
        b->length = sizes[j];
    }
    return fmi3OK;
}

/* State. */

fmi3Status fmi3GetFMUState(fmi3Instance i, fmi3FMUState *state)
{
    if (((Block *)i)->stateless)
        return refuse(i, "no state can be had", 0.0);
    if (!*state) {
        *state = malloc(sizeof(Block));
        stranger_held++;
    }
    memcpy(*state, i, sizeof(Block));
    return fmi3OK;
}
fmi3Status fmi3SetFMUState(fmi3Instance i, fmi3FMUState state) { memcpy(i, state, sizeof(Block)); return fmi3OK; }
fmi3Status fmi3FreeFMUState(fmi3Instance i, fmi3FMUState *state)
{
    (void)i;
    stranger_held -= *state != NULL;
    free(*state);
    *state = NULL;
    return fmi3OK;
}
