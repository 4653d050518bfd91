/* A model that is a network of parts which meet only at events, run part by part behind calls like those of an engine:
   who drives it sees the vectors of the whole.  The engine of the whole is there beside it: it computes the start, and
   what is asked about the whole at once. */
#ifndef HYBRID_ASSEMBLY_H
#define HYBRID_ASSEMBLY_H

#include "engine.h"

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* A scalar that leaves the parts of a group: a state, a discrete state or an output. */
typedef struct {
    uint32_t bank, index;
} Signal;

/* Wires as compressed rows: those that leave part i are first[i] ... first[i + 1] - 1. */
typedef struct {
    const uint64_t *first;
    const uint32_t *signals, *targets, *inputs;
} Wires;

/* Where a part's vectors begin in those of the whole, and its jump margins and jumps in theirs. */
typedef struct {
    uint32_t x, z, p, y, margin, jump;
} Places;

/* An input of a part. */
typedef struct {
    uint32_t part, input;
} Hearing;

/* Tables that are generated with a model. */
typedef struct {
    size_t n_groups, n_parts;
    const Model *const *models;   /* of each group; their parameters end with the constants of each part */
    const size_t *n_signals;      /* of each group, and the signals, one group after the other */
    const Signal *signals;
    const uint32_t *groups;       /* of each part */
    Wires wires;
    const Places *places;         /* of each part, and the ends of all */
    const uint64_t *first_heard;  /* inputs of the whole as compressed rows of those that hear them */
    const Hearing *heard;
    const double *constants;      /* of all parts, one after the other */
    const ModelName *part_names;
    const char *names;
} Assembly;

typedef struct Assembled Assembled;

/* NULL without memory.  The engine of the whole stays the caller's. */
Assembled *assembled_create(const Assembly *assembly, Engine *whole);
void assembled_free(Assembled *assembled);
void assembled_set_jump_hook(Assembled *assembled, JumpHook hook, void *context);
/* After each instant with events on the way of an advance, as the engine's after each step. */
void assembled_set_hook(Assembled *assembled, StepHook hook, void *context);
/* The run goes back to where the parts have not begun. */
void assembled_reset(Assembled *assembled);
/* The parts go on from the engine of the whole, which has started; false if the run is over at once. */
bool assembled_begin(Assembled *assembled);
/* Whether they have: only then may the functions below be called, those on saved states excepted. */
bool assembled_running(const Assembled *assembled);

size_t assembled_state_size(const Assembled *assembled);
/* Before the engine of the whole is saved: nothing is in it that follows from the parts. */
void assembled_before_save(Assembled *assembled);
void assembled_save(Assembled *assembled, void *bytes);
void assembled_restore(Assembled *assembled, const void *bytes);
bool assembled_state_is_sound(const Assembled *assembled, void *bytes);

/* As the functions of the engine.  The whole has the messages of a run that is over, and which jumps have ticked. */
double assembled_time(const Assembled *assembled);
void assembled_set(Assembled *assembled, Bank bank, size_t index, double value);
/* What follows from all that was set, up to a jump: to be called then. */
void assembled_follow(Assembled *assembled);
/* The values of a bank from element `index` on to the end of that part's. */
const double *assembled_values(Assembled *assembled, View view, Bank bank, size_t index);
/* The engine of the whole at the present state of all parts, until anything goes on. */
Engine *assembled_whole(Assembled *assembled);
size_t assembled_pending(Assembled *assembled);
bool assembled_jump(Assembled *assembled, bool *states_changed);
bool assembled_jump_all(Assembled *assembled);
bool assembled_predict(Assembled *assembled, double *event_time);
/* Whether the time that was predicted is that of an event. */
bool assembled_foresees(const Assembled *assembled);
Advance assembled_advance(Assembled *assembled, double target, EventPolicy policy);
bool assembled_advance_quietly(Assembled *assembled, double target);
double assembled_target(const Assembled *assembled);
size_t assembled_jumps_taken(const Assembled *assembled);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
