/* An instance of the FMU as both versions of the standard see it: the calling rules, the checks of
   what comes from outside, saved states, steps, events and derivatives.  fmi2.c and fmi3.c translate
   their functions to these; nothing here knows which of them calls.

   Where a function takes `function`, that is the name of the standard's function, for messages. */
#ifndef HYBRID_INSTANCE_H
#define HYBRID_INSTANCE_H

#include <stdint.h>

#include "description.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Numbered as fmi2Status and fmi3Status are. */
typedef enum { ANSWER_OK, ANSWER_WARNING, ANSWER_DISCARD, ANSWER_ERROR } Answer;
typedef enum { CO_SIMULATION, MODEL_EXCHANGE } Interface;
typedef uint32_t Reference;

enum {
    MODE_INSTANTIATED = 1,
    MODE_CONFIGURATION = 2,
    MODE_INITIALIZATION = 4,
    MODE_EVENT = 8,
    MODE_STEP = 16,
    MODE_CONTINUOUS = 32,
    MODE_INTERMEDIATE = 64,
    MODE_TERMINATED = 128,
    MODE_RUNNING = 4 + 8 + 16 + 32 + 64 + 128,   /* initialised or about to be */
    MODE_OUTSIDE = 1 + 2 + 4 + 8 + 16 + 32 + 128,    /* not within a callback of the FMU */
    MODE_SETTABLE = 127,
    MODE_ANY = 255
};

/* Bits of the log categories. */
enum { LOG_ERRORS = 1, LOG_EVENTS = 2 };

/* What evolves in a run beside the engine's own; it lies in the engine's block. */
typedef struct {
    double time;               /* the communication point, or the time that the importer set */
    double stop_time;          /* infinite if there is none */
    int32_t mode;
    int32_t end_reported;      /* a step has said that the run is over */
    int32_t stop_at_events;    /* the option of that name */
    int32_t interval_told;     /* the countdown clock's interval has been asked for since it changed */
    int32_t interval_owed;     /* it has been told and the clock has not ticked since: it must remain known */
    double next_event;         /* the time of the countdown clock's next tick, infinite if there is none */
} Run;

typedef struct Instance Instance;
typedef void LogLine(const Instance *instance, Answer level, const char *category, const char *message);

struct Instance {
    Engine *engine;
    Assembled *parts;          /* of a network that is run part by part once it has started; else NULL */
    Run *run;
    const char *name;
    LogLine *log_line;         /* NULL: nobody listens */
    Interface interface;
    bool event_mode_used, early_return_allowed;
    bool logging;
    unsigned categories;
};

/* instance.c: life and log */

/* A copy of the prototype, `size` bytes that begin with an Instance, with an engine and a name of its own;
   NULL (and one log line) if the name or the token is wrong or there is no memory. */
Instance *instance_new(const Instance *prototype, size_t size, const char *function, const char *token);
/* The parts, if they run and not the engine; NULL otherwise. */
Assembled *instance_parts(const Instance *instance);
/* Logs an error, also when logging is switched off, if there is a logger; always ANSWER_ERROR, so that
   callers can return it. */
Answer instance_refuse(const Instance *instance, const char *format, ...) LIKE_PRINTF(2, 3);
Answer instance_null_argument(const Instance *instance, const char *function);
/* The instance, if the function may be called now; NULL (and one log line) otherwise. */
Instance *instance_enter(void *handle, const char *function, int modes);
/* The same for a function of one kind of instances only. */
Instance *instance_enter_kind(void *handle, const char *function, Interface kind, int modes);
const char *instance_mode_name(int mode);
void instance_free(void *handle, const char *function);
Answer instance_reset(void *handle, const char *function);
Answer instance_terminate(void *handle, const char *function);
Answer instance_log(void *handle, const char *function, bool on, size_t n, const char *const categories[]);

/* set_up.c: from Instantiated to the first mode of the run */

typedef struct {
    bool has_tolerance, has_stop;
    double tolerance, start, stop;
} Experiment;

Answer instance_set_up(void *handle, const char *function, const Experiment *experiment);
Answer instance_enter_initialization(void *handle, const char *function);
Answer instance_exit_initialization(void *handle, const char *function);
Answer instance_configure(void *handle, const char *function, bool begin);

/* access.c: values of variables */

typedef void StoreValue(void *values, size_t i, double value);
typedef double LoadValue(const void *values, size_t i);

/* The variable of a value reference; NULL (and one log line) if there is none. */
const Variable *instance_variable(const Instance *instance, const char *function, Reference reference);
Answer instance_check_type(const Instance *instance, const char *function, const Variable *variable, Type type);
/* All or nothing: a value that cannot be had, or must not be set, leaves everything as it was. */
Answer instance_get(void *handle, const char *function, Type type, const Reference references[], size_t n,
                    void *values, size_t n_values, StoreValue *store);
Answer instance_set(void *handle, const char *function, Type type, const Reference references[], size_t n,
                    const void *values, size_t n_values, LoadValue *load);
/* A type that no variable has: nothing to do for no variables, an error otherwise. */
Answer instance_no_type(void *handle, const char *function, size_t n, bool set);
/* The view of the engine that readers get in the present mode. */
View instance_view(const Instance *instance);
/* Some other function that this FMU does not have. */
Answer instance_unsupported(void *handle, const char *function);

/* clocks.c: which clocks tick, and when the next event comes */

Answer instance_get_clocks(void *handle, const char *function, const Reference references[], size_t n, bool active[]);
Answer instance_set_clocks(void *handle, const char *function, const Reference references[], size_t n,
                           const bool active[]);
/* An interval as the standard's qualifiers see it, numbered as they are. */
typedef enum { INTERVAL_NOT_YET_KNOWN, INTERVAL_UNCHANGED, INTERVAL_CHANGED } Qualifier;
/* The interval of the countdown clocks referred to, which is one for all; `places` is where the importer wants it. */
Answer instance_get_interval(void *handle, const char *function, const Reference references[], size_t n,
                             const void *places, double *interval, Qualifier *qualifier);

/* saved.c: saved and serialised states */

Answer instance_save(void *handle, const char *function, void **state);
Answer instance_restore(void *handle, const char *function, const void *state);
Answer instance_forget(void *handle, const char *function, void **state);
Answer instance_serialized_size(void *handle, const char *function, const void *state, size_t *size);
Answer instance_serialize(void *handle, const char *function, const void *state, unsigned char bytes[], size_t size);
Answer instance_deserialize(void *handle, const char *function, const unsigned char bytes[], size_t size,
                            void **state);

/* events.c: Event Mode */

typedef struct {
    bool again, terminate, nominals_changed, states_changed, has_next;
    double next;
} EventUpdate;

/* The jump that comes next at this instant, n_jumps if none does. */
size_t instance_pending(const Instance *instance);
Answer instance_enter_event_mode(void *handle, const char *function, int modes);
/* From Event Mode to Step Mode or Continuous-Time Mode. */
Answer instance_leave_event_mode(void *handle, const char *function, int mode);
Answer instance_update(void *handle, const char *function, EventUpdate *update);

/* stepping.c: Co-Simulation */

typedef struct {
    bool event, terminate, early;
    double reached;
} StepReport;

/* Makes a step of an instance in Step Mode in a few comparisons, as most are made: it begins where the last one ended,
   and it is known already that nothing happens on it.  False if instance_step has to look. */
bool instance_step_quietly(const Instance *instance, double point, double size);
/* `policy` is what to do with events on the way.  The instance is in Step Mode. */
Answer instance_step(Instance *instance, const char *function, double point, double size, EventPolicy policy,
                     StepReport *report);

/* continuous.c: Model Exchange */

Answer instance_set_time(void *handle, const char *function, double time);
Answer instance_set_states(void *handle, const char *function, const double x[], size_t n);
/* The continuous states, their derivatives or the event indicators. */
Answer instance_get_vector(void *handle, const char *function, Bank bank, double values[], size_t n);
Answer instance_nominals(void *handle, const char *function, double values[], size_t n);
Answer instance_completed_step(void *handle, const char *function, bool *event, bool *terminate);

/* partial.c: derivatives */

typedef struct {
    const Reference *references;
    size_t n;
    const double *seeds;       /* those that are given */
    double *results;           /* those that are wanted */
    size_t n_values;
} Direction;

/* Forward: seeds of the knowns give results of the unknowns; otherwise the other way round. */
Answer instance_derivatives(void *handle, const char *function, const Direction *unknowns, const Direction *knowns,
                            bool forward);
Answer instance_output_rates(void *handle, const char *function, const Reference references[], size_t n,
                             const int32_t orders[], double values[], size_t n_values);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
