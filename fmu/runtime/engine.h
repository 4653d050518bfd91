/* The version-neutral engine of an exported model: flow, jumps, event location, prediction,
   save and restore.  It knows no FMI version; fmi3.c is a thin layer above it.

   What evolves in a run lies in one contiguous block without pointers, so that saving a run
   is copying that block.  Nothing is allocated after engine_create. */
#ifndef HYBRID_ENGINE_H
#define HYBRID_ENGINE_H

#include <stdbool.h>
#include <stddef.h>

#include "model.h"

typedef struct Engine Engine;

/* Why a run cannot go on. */
typedef enum { ENDED_NOT, ENDED_ZENO, ENDED_BLOCKED, ENDED_NOT_FINITE, ENDED_FAILED } Ending;

/* What engine_advance does with events. */
typedef enum {
    EVENTS_INSIDE,              /* take every jump at its exact time */
    EVENTS_INSIDE_BEFORE_END,   /* the same, but leave jumps due at the target pending */
    EVENTS_STOP                 /* stop at the first event */
} EventPolicy;

typedef enum {
    ADVANCE_REACHED,            /* at the target, nothing pending */
    ADVANCE_EVENT_AT_TARGET,    /* at the target, an event pending */
    ADVANCE_EVENT_BEFORE,       /* at an event before the target */
    ADVANCE_ENDED               /* the run is over: see engine_message */
} Advance;

/* What a reader is shown. */
typedef enum {
    VIEW_NONE,
    VIEW_START,                 /* computed start values applied to what has been set */
    VIEW_LIVE,                  /* the state as it is */
    VIEW_PENDING                /* the state after the jump that comes next at this instant */
} View;

/* The importer's layer gets `wrapper_size` bytes of its own inside the block. */
Engine *engine_create(const Model *model, size_t wrapper_size);
void engine_free(Engine *engine);
void *engine_wrapper(Engine *engine);

/* All start values as the model declares them, time 0, wrapper zeroed. */
void engine_reset(Engine *engine);

size_t engine_block_size(const Engine *engine);
void engine_save(const Engine *engine, void *block);
void engine_restore(Engine *engine, const void *block);

/* A relative tolerance looser than the engine's own is ignored. */
void engine_set_tolerance(Engine *engine, double relative);
void engine_set_time(Engine *engine, double t);
double engine_time(const Engine *engine);
/* Writes a value of BANK_STATE, BANK_DISCRETE, BANK_INPUT or BANK_PARAMETER.  A changed value
   makes a prediction invalid. */
void engine_set(Engine *engine, Bank bank, size_t index, double value);
/* The values of a bank (not time, not clocks) in a view; NULL if they cannot be computed, then
   engine_problem says why. */
const double *engine_values(Engine *engine, View view, Bank bank);

/* Applies the computed start values and the breakpoints that are due. */
bool engine_start(Engine *engine);
/* The first enabled visible jump: its index, or n_jumps if there is none. */
size_t engine_pending(Engine *engine);
/* Takes that jump (if any); false when the run ended with it. */
bool engine_jump(Engine *engine, bool *states_changed);
/* Takes all enabled visible jumps, one after the other. */
bool engine_jump_all(Engine *engine);
Advance engine_advance(Engine *engine, double target, EventPolicy policy);

/* Looks ahead to the next visible event, at most to `limit` (may be infinite); its time, or that of
   the limit if nothing happens before.  False if that is not ahead.  The state there is kept, and
   engine_advance takes it from there. */
bool engine_predict(Engine *engine, double limit, double *event_time);
/* The earliest visible time event after now. */
bool engine_next_time_event(Engine *engine, double *event_time);

/* Clocks that ticked since engine_clear_ticks; engine_advance clears them when it begins. */
bool engine_ticked(const Engine *engine, size_t clock);
void engine_clear_ticks(Engine *engine);
/* Visible jumps taken in the last engine_advance. */
size_t engine_jumps_taken(const Engine *engine);

/* Why the run ended: a sentence with the time, the values and the remedy. */
const char *engine_message(const Engine *engine);
/* Why the last call that failed did so, also when the run is not over. */
const char *engine_problem(const Engine *engine);

/* Drops what truncation left of a UTF-8 character at the end of a text. */
void end_text_cleanly(char *text);

/* The distance from |t| to the next larger double. */
double time_ulp(double t);

#endif
