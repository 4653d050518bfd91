/* A C driver that measures what the calls of a Co-Simulation FMU cost: what its files share. */
#ifndef STEP_COST_H
#define STEP_COST_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define MOST_VALUES 16

typedef struct Interface Interface;

/* One FMU under test. */
typedef struct {
    const Interface *interface;
    const char *name, *binary, *token, *resources;
    uint32_t references[MOST_VALUES];   /* the Float64 variables that are read, in this order */
    size_t n_values;
    bool has_events, has_states;        /* as its description says */
    void *functions;                    /* loaded, for the interface */
    void *plain, *with_events;          /* instances: event mode off, and on with early return */
    void *saved;
    double values[MOST_VALUES];
} Contender;

/* What happened in a run in event mode. */
typedef struct {
    size_t calls;                       /* of fmi3DoStep */
    size_t events;
} EventRun;

/* What is measured, for one version of the standard.  Everything but `load` and the starts is timed,
   so each loops by itself.  A function that fails says why and returns false. */
struct Interface {
    const char *version;
    bool (*load)(Contender *contender);
    /* From time 0, initialised, in Step Mode (in Event Mode if `events`). */
    bool (*start)(Contender *contender, bool events);
    bool (*steps)(Contender *contender, size_t first, size_t n, double size);
    bool (*steps_and_reads)(Contender *contender, size_t first, size_t n, double size);
    bool (*reads)(Contender *contender, size_t n);
    bool (*saves)(Contender *contender, size_t n);
    /* Event mode: every event is handled, and no step goes beyond the announced next event if `obey`. */
    bool (*event_steps)(Contender *contender, size_t n, double size, bool obey, EventRun *run);
    void (*unload)(Contender *contender);
};

extern const Interface interface2, interface3;

/* The address of a function of the contender's library, NULL if it has none; `library` as from dlopen. */
typedef void (*AnyFunction)(void);
AnyFunction find_function(void *library, const char *name);
void *open_library(const Contender *contender);
/* Says what went wrong; always false. */
bool failed(const Contender *contender, const char *what);

#endif
