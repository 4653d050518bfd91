/* A decay x' = -rate x + u, y = x, stepped by Euler: both versions, all interface types, and faults by -DFAULT_NAME.
   No FMI header: the signatures are the standard's, written out for this one machine. */
#include <math.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#ifndef TOKEN
#define TOKEN "token"
#endif
#define API __attribute__((visibility("default")))
#define OK 0
#define ERROR 3
/* What the functions behind optional capability flags return. */
#ifndef CLAIMED
#define CLAIMED ERROR
#endif

typedef struct {
    double t, x, rate, u, memory, stop;
    int calls, reads, initializing, resets;
} State;

#ifndef STIFFNESS
#define STIFFNESS 1.0
#endif

static State* make(const char* token, const char* resources) {
#ifdef FAULT_RESOURCES
    if (strstr(resources, "resources") == NULL) return NULL;
#endif
    (void)resources;
#ifndef FAULT_TOKEN
    if (strcmp(token, TOKEN) != 0) return NULL;
#else
    (void)token;
#endif
#ifdef FAULT_INSTANTIATE
    return NULL;
#endif
    State* s = calloc(1, sizeof *s);
    s->x = 1.0;
    s->rate = STIFFNESS;
    s->stop = INFINITY;
#ifdef FAULT_STDOUT
    printf("hello from the solver\n");
    fflush(stdout);
#endif
#ifdef FAULT_FILE
    fclose(fopen("solver.log", "w"));
#endif
#ifdef FAULT_FLOOD
    for (;;) printf("a line of a very talkative solver\n");
#endif
#ifdef FAULT_FORK
    if (fork() == 0) execlp("sleep", "sleep", "3141592", (char*)NULL);
    for (;;) pause();
#endif
#ifdef FAULT_EXIT
    exit(0);
#endif
#ifdef FAULT_MEMORY
    for (;;) memset(malloc(1 << 24), 1, 1 << 24);
#endif
    return s;
}

static int get(State* s, unsigned reference, double* value) {
#ifdef FAULT_NO_VALUES_IN_INITIALIZATION
    if (s->initializing) return ERROR;
#endif
    switch (reference) {
        case 0: *value = s->t; return OK;
        case 1: *value = s->x; return OK;
        case 2: *value = -s->rate * s->x + s->u; return OK;
        case 3: *value = s->rate; return OK;
        case 4: *value = s->x - 0.5; return OK;
        case 5:
#ifdef FAULT_NAN
            *value = s->t > 0.3 ? NAN : s->x;
#elif defined(FAULT_GETTER)
            *value = s->x + s->reads++;
#elif defined(FAULT_UNREADABLE)
            return ERROR;
#else
            *value = s->x;
#endif
            return OK;
        case 7: *value = s->u; return OK;
        default: return ERROR;
    }
}

static int set(State* s, unsigned reference, double value) {
    if (reference == 1) s->x = value;
    else if (reference == 3) s->rate = value;
    else if (reference == 7) s->u = value;
    else return ERROR;
    return OK;
}

static int step(State* s, double t, double h) {
#ifdef FAULT_CRASH
    if (s->t > 0.3) {
        fprintf(stderr, "the solver lost its way\n");
        *(volatile int*)8 = 1;
    }
#endif
#ifdef FAULT_PARENT
    if (s->t > 0.3) kill(getppid(), SIGKILL);
#endif
#ifdef FAULT_ABORT
    if (s->t > 0.3) abort();
#endif
#ifdef FAULT_STOP
    if (t + h > s->stop) return ERROR;
#endif
#ifdef FAULT_HANG
    /* The loop of a solver that asks `t < end` the other way round never ends on NaN. */
    for (double end = t + h; !(s->t >= end); s->t += 0.01) {}
#elif !defined(FAULT_ANY_STEP)
    if (!(h > 0.0)) return ERROR;
#endif
    s->x += (-s->rate * s->x + s->u) * h - 1e-2 * s->memory;
    s->memory += h;
    s->t = t + h;
#ifndef REPEATED
#define REPEATED 1e-2
#endif
#ifdef FAULT_REPEAT
    static int calls;
    s->x += REPEATED * calls++;
#endif
    s->calls++;
#ifdef FAULT_STATE
    s->x += 1e-2 * (s->calls % 7);
#endif
    return OK;
}

static void reset(State* s) {
#ifndef FAULT_RESET
    s->t = s->memory = 0.0;
    s->calls = s->reads = 0;
#endif
    s->x = 1.0;
    s->rate = STIFFNESS;
    s->u = 0.0;
    s->resets++;
}

static int copy(State* s, void** out) {
    *out = malloc(sizeof *s);
    memcpy(*out, s, sizeof *s);
    return OK;
}

static int put_back(State* s, const State* from) {
#ifdef FAULT_STATE
    int calls = s->calls;
    *s = *from;
    s->calls = calls;
#else
    *s = *from;
#endif
    return OK;
}

/* d y / d x = 1; d der(x) / d x = -rate; d der(x) / d u = 1. */
static double slope(const State* s, unsigned unknown, unsigned known) {
#ifdef FAULT_DERIVATIVE_NAN
    return NAN;
#endif
    if (known == 7) return unknown == 2;
    return unknown == 2 ? -s->rate : 1.0;
}

#ifdef FAULT_SYMBOLS
API double gamma(double v) { return v; }
#endif
#ifdef FAULT_UNDEFINED
extern void solver_of_the_vendor(void);
API void fmi3Unused(void) { solver_of_the_vendor(); }
#endif
#ifdef FAULT_PYTHON
extern void Py_Initialize(void);
extern void* PyLong_FromLong(long);
API void* fmi3Unused(void) { Py_Initialize(); return PyLong_FromLong(1); }
#endif

/* What both versions have; FMI 3.0 passes further numbers of values, which are not looked at. */
#if FMI == 3
#define NAMED(NAME2, NAME3) fmi3##NAME3
typedef bool Truth;
#else
#define NAMED(NAME2, NAME3) fmi2##NAME2
typedef int Truth;
#endif
#define BOTH(NAME) NAMED(NAME, NAME)
API void BOTH(FreeInstance)(State* s) { free(s); }
API int BOTH(ExitInitializationMode)(State* s) { s->initializing = 0; return OK; }
API int BOTH(EnterEventMode)(State* s) { (void)s; return OK; }
API int BOTH(EnterContinuousTimeMode)(State* s) { (void)s; return OK; }
API int BOTH(Terminate)(State* s) {
#ifdef FAULT_LAST_WORDS
    fprintf(stderr, "terminated at %g\n", s->t);
    return ERROR;
#endif
    (void)s;
    return OK;
}
API int BOTH(Reset)(State* s) { reset(s); return OK; }
API int NAMED(GetReal, GetFloat64)(State* s, const uint32_t r[], size_t n, double v[]) {
    for (size_t i = 0; i < n; i++) if (get(s, r[i], v + i)) return ERROR;
    return OK;
}
API int NAMED(SetReal, SetFloat64)(State* s, const uint32_t r[], size_t n, const double v[]) {
    for (size_t i = 0; i < n; i++) if (set(s, r[i], v[i])) return ERROR;
    return OK;
}
API int NAMED(GetFMUstate, GetFMUState)(State* s, void** out) { return copy(s, out); }
API int NAMED(SetFMUstate, SetFMUState)(State* s, void* from) { return put_back(s, from); }
API int NAMED(FreeFMUstate, FreeFMUState)(State* s, void** state) { (void)s; free(*state); *state = NULL; return OK; }
API int NAMED(SerializedFMUstateSize, SerializedFMUStateSize)(State* s, void* state, size_t* n) {
    (void)s; (void)state;
    *n = sizeof(State);
    return OK;
}
API int NAMED(SerializeFMUstate, SerializeFMUState)(State* s, void* state, uint8_t* out, size_t n) {
    (void)s;
    memcpy(out, state, n);
    return OK;
}
API int NAMED(DeSerializeFMUstate, DeserializeFMUState)(State* s, const uint8_t* in, size_t n, void** out) {
    copy(s, out);
    memcpy(*out, in, n);
#ifdef FAULT_SERIALIZE
    ((State*)*out)->x += 1e-2;
#endif
    return OK;
}
API int BOTH(SetTime)(State* s, double t) { s->t = t; return OK; }
API int BOTH(SetContinuousStates)(State* s, const double x[], size_t n) { (void)n; s->x = x[0]; return OK; }
API int BOTH(GetContinuousStates)(State* s, double x[], size_t n) { (void)n; x[0] = s->x; return OK; }
API int BOTH(GetNominalsOfContinuousStates)(State* s, double x[], size_t n) { (void)s; (void)n; x[0] = 1.0; return OK; }
API int NAMED(GetDerivatives, GetContinuousStateDerivatives)(State* s, double x[], size_t n) { (void)n; return get(s, 2, x); }
API int BOTH(GetEventIndicators)(State* s, double z[], size_t n) { (void)n; z[0] = s->x - 0.5; return OK; }
API int BOTH(CompletedIntegratorStep)(State* s, Truth no, Truth* event, Truth* end) {
    (void)s; (void)no;
    *event = *end = 0;
    return OK;
}

#if FMI == 3
API const char* fmi3GetVersion(void) { return "3.0"; }
API void* fmi3InstantiateCoSimulation(const char* name, const char* token, const char* place) { (void)name; return make(token, place); }
API void* fmi3InstantiateModelExchange(const char* name, const char* token, const char* place) { (void)name; return make(token, place); }
API void* fmi3InstantiateScheduledExecution(const char* name, const char* token, const char* place) { (void)name; return make(token, place); }
API int fmi3EnterInitializationMode(State* s, bool d, double tol, double start, bool limited, double stop) {
    (void)d; (void)tol;
    s->initializing = 1;
    s->t = start;
    if (limited) s->stop = stop;
    return OK;
}
API int fmi3EnterStepMode(State* s) {
#ifdef FAULT_NEEDS_EVENT_MODE
    s->memory = -1.0;
#endif
    (void)s;
    return OK;
}
API int fmi3GetClock(State* s, const uint32_t r[], size_t n, bool v[]) {
    (void)s; (void)r;
    for (size_t i = 0; i < n; i++) v[i] = false;
    return OK;
}
API int fmi3UpdateDiscreteStates(State* s, bool* again, bool* end, bool* nominals, bool* values, bool* defined, double* next) {
    (void)s;
    *again = *end = *nominals = *values = *defined = false;
    *next = 0.0;
#ifdef FAULT_ITERATION
    *again = true;
#endif
#ifdef FAULT_NEXT_TIME
    *defined = true;
    *next = -1.0;
#endif
    return OK;
}
API int fmi3DoStep(State* s, double t, double h, bool no, bool* event, bool* end, bool* early, double* last) {
    (void)no;
    *event = *end = *early = false;
    int status = step(s, t, h);
#ifdef FAULT_NEEDS_EVENT_MODE
    if (s->memory >= 0.0) return ERROR;
#endif
    *last = s->t;
#ifdef FAULT_LAST_TIME
    *last = t + h / 2.0;
#endif
#ifdef FAULT_RESET_ENDS
    *end = s->resets > 0;
#endif
#ifdef FAULT_MANY
    *early = true;
    *last = s->t = t + 5e-5;
#endif
#ifdef FAULT_PROGRESS
    *early = true;
    *last = s->t = t;
#endif
    return status;
}
API int fmi3GetDirectionalDerivative(State* s, const uint32_t r[], size_t n, const uint32_t k[], size_t nk, const double seed[],
                                     size_t ns, double out[], size_t no) {
    (void)ns; (void)no;
    for (size_t i = 0; i < n; i++) {
        out[i] = 0.0;
        for (size_t j = 0; j < nk; j++) out[i] += slope(s, r[i], k[j]) * seed[j];
        if (r[i] == 5 && k[0] == 7) {
#ifdef FAULT_NOISE
            out[i] = 1e-5 * (s->calls++ % 7 - 3.3);
#elif defined(FAULT_ZERO_REFUSED)
            return ERROR;
#elif defined(FAULT_ZERO_NAN)
            out[i] = NAN;
#endif
        }
#ifdef FAULT_DERIVATIVE_REFUSED
        return ERROR;
#endif
    }
    return OK;
}
API int fmi3GetAdjointDerivative(State* s, const uint32_t r[], size_t n, const uint32_t k[], size_t nk, const double seed[],
                                 size_t ns, double out[], size_t no) {
    (void)ns; (void)no;
    for (size_t j = 0; j < nk; j++) {
        out[j] = 0.0;
        for (size_t i = 0; i < n; i++) out[j] += slope(s, r[i], k[j]) * seed[i];
#ifdef FAULT_ADJOINT_REFUSED
        return ERROR;
#endif
#ifdef FAULT_ADJOINT
        out[j] = -out[j];
#endif
    }
    return OK;
}
API int fmi3GetOutputDerivatives(State* s, const uint32_t r[], size_t n, const int32_t orders[], double out[], size_t no) {
    (void)r; (void)no;
    for (size_t i = 0; i < n; i++) {
        if (orders[i] != 1) return CLAIMED;
        get(s, 2, out + i);
#ifdef FAULT_OUTPUT_DERIVATIVE
        out[i] = NAN;
#endif
    }
    return OK;
}
API int fmi3EvaluateDiscreteStates(State* s) { (void)s; return CLAIMED; }
API int fmi3GetNumberOfVariableDependencies(State* s, uint32_t r, size_t* n) { (void)s; (void)r; *n = 1; return CLAIMED; }
API int fmi3GetVariableDependencies(State* s, uint32_t r, size_t e[], uint32_t k[], size_t f[], int kinds[], size_t n) {
    (void)s; (void)r;
    if (n != 1) return ERROR;
    *e = *f = 1;
    *k = 1;
    *kinds = 0;
#ifdef FAULT_DEPENDENCIES
    return ERROR;
#endif
    return CLAIMED;
}
API int fmi3GetNumberOfContinuousStates(State* s, size_t* n) { (void)s; *n = 1; return OK; }
API int fmi3GetNumberOfEventIndicators(State* s, size_t* n) {
    (void)s;
    *n = 1;
#ifdef FAULT_COUNTS
    *n = 0;
#endif
    return OK;
}
API int fmi3ActivateModelPartition(State* s, uint32_t clock, double t) { (void)clock; s->t = t; s->x *= 0.5; return OK; }
#else
API const char* fmi2GetVersion(void) { return "2.0"; }
API const char* fmi2GetTypesPlatform(void) { return "default"; }
API void* fmi2Instantiate(const char* name, int kind, const char* token, const char* place) {
    (void)name; (void)kind;
    return make(token, place);
}
API int fmi2SetupExperiment(State* s, int d, double tol, double start, int limited, double stop) {
    (void)d; (void)tol;
    s->t = start;
    if (limited) s->stop = stop;
    return OK;
}
API int fmi2EnterInitializationMode(State* s) { s->initializing = 1; return OK; }
typedef struct { int again, end, nominals, values, defined; double next; } Info;
API int fmi2NewDiscreteStates(State* s, Info* info) {
    (void)s;
    memset(info, 0, sizeof *info);
#ifdef FAULT_ITERATION
    info->again = 1;
#endif
    return OK;
}
API int fmi2DoStep(State* s, double t, double h, int no) {
    (void)no;
#ifdef FAULT_DISCARD
    if (t > 0.3) return 2;
#endif
    return step(s, t, h);
}
API int fmi2GetRealStatus(State* s, int kind, double* v) { (void)kind; *v = s->t; return OK; }
API int fmi2GetBooleanStatus(State* s, int kind, int* v) { (void)s; (void)kind; *v = 1; return OK; }
API int fmi2GetDirectionalDerivative(State* s, const unsigned r[], size_t n, const unsigned k[], size_t nk, const double seed[],
                                     double out[]) {
    for (size_t i = 0; i < n; i++) {
        out[i] = 0.0;
        for (size_t j = 0; j < nk; j++) out[i] += slope(s, r[i], k[j]) * seed[j];
#ifdef FAULT_DERIVATIVE_LINEAR
        out[i] += 1.0;
#endif
    }
    return OK;
}
API int fmi2GetRealOutputDerivatives(State* s, const unsigned r[], size_t n, const int orders[], double out[]) {
    (void)r;
    for (size_t i = 0; i < n; i++) {
        if (orders[i] != 1) return CLAIMED;
        get(s, 2, out + i);
    }
    return OK;
}
API int fmi2SetRealInputDerivatives(State* s, const unsigned r[], size_t n, const int orders[], const double v[]) {
    (void)s; (void)n; (void)v;
    return r[0] == 7 && orders[0] == 1 ? CLAIMED : ERROR;
}
#endif
