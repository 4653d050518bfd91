/* The version-neutral engine of an exported model: flow, jumps, event location, prediction,
   save and restore.  It knows no FMI version and no importer; instance.h is the layer above it.

   What evolves in a run lies in one contiguous block without pointers, so that saving a run
   is copying that block.  Nothing is allocated after engine_create. */
#ifndef HYBRID_ENGINE_H
#define HYBRID_ENGINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "model.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

#if defined(__GNUC__)
#define LIKE_PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define LIKE_PRINTF(text, first)
#endif

typedef struct Engine Engine;

/* Why a run cannot go on.  JUMPS: more than the options allow. */
typedef enum { ENDED_NOT, ENDED_ZENO, ENDED_BLOCKED, ENDED_NOT_FINITE, ENDED_FAILED, ENDED_JUMPS } Ending;

/* How a run is made: data, which whoever drives an engine may set before it starts.  They are no part of the block. */
typedef struct {
    double relative_tolerance;  /* of a step */
    double absolute_tolerance;  /* of a step, in the unit of each state; 0: a part of the states' own sizes */
    double longest_step;        /* s */
    double barrier;             /* s; where inputs may change from outside: no flow is looked at beyond it */
    double event_tolerance;     /* s and margin: what counts as one instant, and as a border; 0: follows from the run */
    /* What counts as an accumulation of jumps: see ZenoGuard in hybrid_model/reference/zeno.py. */
    double jumps_at_once, jumps_in_window, spread;
    double window, remainder;   /* s; below 0: follow from the run */
    double most_jumps;          /* of a run, breakpoints included */
    double steps_at_once;       /* of the solver in one engine_advance: more end the run, or pause it */
    double look_ahead_steps, look_ahead_work;   /* of a prediction; work is steps times states, margins and times */
    double pauses;              /* not 0: an advance that runs out of steps can be gone on with */
    double stiff;               /* 1: the flow is; -1: it is not; 0: as declared, or as it shows itself */
} EngineOptions;

/* What engine_advance does with events. */
typedef enum {
    EVENTS_INSIDE,              /* take every jump at its exact time */
    EVENTS_INSIDE_BEFORE_END,   /* the same, but leave jumps due at the target pending */
    EVENTS_STOP,                /* stop at the first event */
    EVENTS_STOP_AFTER           /* take the jumps of the first event on the way, and stop there */
} EventPolicy;

typedef enum {
    ADVANCE_REACHED,            /* at the target, nothing pending */
    ADVANCE_EVENT_AT_TARGET,    /* at the target, an event pending */
    ADVANCE_EVENT_BEFORE,       /* at an event before the target */
    ADVANCE_ENDED,              /* the run is over: see engine_message */
    ADVANCE_PAUSED              /* on the way, for want of steps */
} Advance;

/* Called with each visible jump that is taken. */
typedef void (*JumpHook)(void *context, double time, size_t jump);
/* Called during engine_advance after each step of the solver on the way, with the live state there and the target.
   It may set inputs, and returns the target from now on: what it was given, or a nearer one. */
typedef double (*StepHook)(void *context, double time, double target);

/* What a reader is shown. */
typedef enum {
    VIEW_NONE,
    VIEW_START,                 /* computed start values applied to what has been set */
    VIEW_LIVE,                  /* the state as it is */
    VIEW_PENDING                /* the state after the jump that comes next at this instant */
} View;

/* The vectors of a run that can be read; what is computed from the others begins with the outputs. */
typedef enum {
    BANK_STATE, BANK_DISCRETE, BANK_INPUT, BANK_PARAMETER, BANK_OUTPUT, BANK_DERIVATIVE, BANK_INDICATOR, N_BANKS
} Bank;

/* The importer's layer gets `wrapper_size` bytes of its own inside the block. */
Engine *engine_create(const Model *model, size_t wrapper_size);
void engine_free(Engine *engine);
void *engine_wrapper(Engine *engine);

/* All start values as the model declares them, time 0, wrapper zeroed. */
void engine_reset(Engine *engine);

size_t engine_block_size(const Engine *engine);
void engine_save(Engine *engine, void *block);
void engine_restore(Engine *engine, const void *block);
/* Goes on with the run in a block of the same model, aligned as malloc does: many runs can share an engine, and with it
   their options and statistics.  Whoever does that gives the engine its own block back before it is freed. */
void engine_use_block(Engine *engine, void *block);
/* Whether a block that comes from outside (aligned as malloc does) could be one of this engine's. */
bool engine_block_is_sound(const Engine *engine, void *block);
/* The importer's layer's part of a block. */
void *engine_wrapper_in(const Engine *engine, void *block);

/* The options, as engine_reset leaves them: to be changed before engine_start. */
EngineOptions *engine_options(Engine *engine);
/* The relative tolerance that an importer wishes for.  It buys speed only within bounds: the engine stays a
   thousand times more precise, so that what it promises of event times holds. */
void engine_set_tolerance(Engine *engine, double relative);
void engine_set_hook(Engine *engine, StepHook hook, void *context);
void engine_set_jump_hook(Engine *engine, JumpHook hook, void *context);
void engine_set_time(Engine *engine, double t);
/* The times (s) between which maps are evaluated; the present time becomes the start. */
void engine_set_span(Engine *engine, double start, double stop);
double engine_time(const Engine *engine);
/* Writes a value of BANK_STATE, BANK_DISCRETE, BANK_INPUT or BANK_PARAMETER.  A changed value
   makes a prediction invalid. */
void engine_set(Engine *engine, Bank bank, size_t index, double value);
/* Replaces all continuous states. */
void engine_set_states(Engine *engine, const double *x);
/* The values of a bank (states, inputs, parameters, outputs, derivatives, indicators) in a view; NULL if
   they cannot be computed, then engine_problem says why.  Indicators are the margins of the jumps, then
   that of the flow set if there is one. */
/* Notes the rates at a point that an integrator has come to. */
void engine_note_rates(Engine *engine);
/* Rates where the flow map gives none: outside the flow set, where an integrator may try a point, those noted last
   stand for it.  NULL where the point is not outside, or none are noted. */
const double *engine_outer_rates(Engine *engine, View view);
const double *engine_values(Engine *engine, View view, Bank bank);
size_t engine_indicators(const Engine *engine);
/* Places of derivatives along a direction: of t (1), x, z, u, p; of dx/dt and y; of x and z as they are shown,
   which in the view of the start values depend on what they are computed from. */
enum { SEED_TIME, SEED_STATES, SEED_DISCRETE, SEED_INPUTS, SEED_PARAMETERS, SEED_RATES, SEED_OUTPUTS, SEED_SHOWN,
       N_SEEDS = SEED_SHOWN + 2 };
/* The engine's memory for them, zeroed. */
void engine_seeds(Engine *engine, double *places[N_SEEDS]);
/* Fills those from SEED_RATES on from those before (forward), or the other way round (reverse). */
bool engine_forward(Engine *engine, View view, double *const seeds[N_SEEDS]);
bool engine_reverse(Engine *engine, View view, double *const seeds[N_SEEDS]);

/* Applies the computed start values and the breakpoints that are due. */
bool engine_start(Engine *engine);
/* The first enabled visible jump: its index, or n_jumps if there is none. */
size_t engine_pending(Engine *engine);
/* Takes that jump (if any); false when the run ended with it. */
bool engine_jump(Engine *engine, bool *states_changed);
/* Takes all enabled visible jumps, one after the other. */
bool engine_jump_all(Engine *engine);
Advance engine_advance(Engine *engine, double target, EventPolicy policy);
/* The same in a few comparisons, where it is known already that nothing happens up to there; false if it is not. */
bool engine_advance_quietly(Engine *engine, double target);

/* Looks ahead to the next visible event, at most to `limit` (may be infinite); its time, or that of
   the limit if nothing happens before.  False if that is not ahead.  The state there is kept, and
   engine_advance takes it from there. */
bool engine_predict(Engine *engine, double limit, double *event_time);
/* The same for whoever comes back to times before that event: where the interpolation of a step is the step itself, the
   first step is kept for them. */
bool engine_look_ahead(Engine *engine, double limit, double *event_time);
/* Goes on where the last look ahead has ended for want of steps, as many further. */
bool engine_look_further(Engine *engine, double limit, double *event_time);
/* Where the look ahead that was made last, by this engine, has found that the run ends: it is over there. */
void engine_end_ahead(Engine *engine);
/* Whether the last prediction, still valid, is of an event. */
bool engine_foresees(const Engine *engine);
/* The earliest time event after now; breakpoints of the flow only if asked for. */
bool engine_next_time_event(Engine *engine, bool breakpoints, double *event_time);
/* An importer that integrates by itself says that it has come to an event: guards that it stopped short of
   by less than the event tolerance are enabled, and a time event that it missed by a rounding is due. */
bool engine_arrive(Engine *engine);
/* Whether that importer may go on: false, and the run is over, where the flow leads further out of the flow set.  One
   that has gone too far, or came out by a jump, may find its way back. */
bool engine_may_flow(Engine *engine);

/* What is kept of a run.  A row of a step: its ends t0 and t1, where it was cut (t1 if it was not), the states there,
   and the vectors of its interpolation on [t0, t1].  A row of a jump: the number of steps before it, its time, its
   index, and continuous and discrete states before and after it; breakpoints of the flow are among them.  The first of
   these rows is the start, with the index n_jumps. */
typedef enum { RECORD_NOTHING, RECORD_JUMPS, RECORD_ALL } RecordKind;
typedef enum { ROWS_OF_STEPS, ROWS_OF_JUMPS, N_ROW_KINDS } RowKind;
/* From now on; what was kept before is dropped. */
void engine_record(Engine *engine, RecordKind kind);
/* The rows so far, one after the other, until the engine goes on. */
const double *engine_rows(const Engine *engine, RowKind kind, size_t *count, size_t *width);
/* What a run has cost since engine_reset.  Probes: states looked at between the ends of a step. */
typedef struct {
    uint64_t steps, rejected, evaluations, jumps, probes, jacobians;
} Statistics;
const Statistics *engine_statistics(const Engine *engine);

/* Visible jumps taken since engine_clear_ticks, with which clocks tick; engine_advance clears them when it begins. */
bool engine_ticked(const Engine *engine, size_t jump);
void engine_clear_ticks(Engine *engine);
/* The target of the last engine_advance, nearer than the one asked for if the hook wanted that. */
double engine_target(const Engine *engine);
/* Visible jumps taken in the last engine_advance. */
size_t engine_jumps_taken(const Engine *engine);

/* Why the run ended: a sentence with the time, the values and the remedy. */
const char *engine_message(const Engine *engine);
/* Why the last call that failed did so, also when the run is not over. */
const char *engine_problem(const Engine *engine);

/* Drops what truncation left of a UTF-8 character at the end of a text. */
void engine_end_text(char *text);

/* The distance from |t| to the next larger double: doubles above zero follow each other as their bits do. */
static inline double engine_time_ulp(double t)
{
    double size, next;
    uint64_t bits;
    memcpy(&bits, &t, sizeof bits);
    bits &= UINT64_MAX >> 1;
    memcpy(&size, &bits, sizeof size);
    bits++;
    memcpy(&next, &bits, sizeof next);
    return next - size;
}

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
