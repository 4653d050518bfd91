/* A network behind the calls of an engine: its life. */
#include "assembled.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void note_jump(void *context, double time, uint32_t part, size_t jump)
{
    Assembled *assembled = context;
    size_t number = assembled->of->places[part].jump + jump;
    assembled->whole->ticked[number] = 1;
    if (assembled->jump_hook)
        assembled->jump_hook(assembled->jump_context, time, number);
}

Assembled *assembled_create(const Assembly *of, Engine *whole)
{
    Assembled *assembled = calloc(1, sizeof *assembled);
    if (!assembled)
        return NULL;
    assembled->of = of;
    assembled->whole = whole;
    Schedule *schedule = assembled->schedule =
        schedule_create(of->n_groups, of->models, of->n_signals, of->signals, of->n_parts, of->groups);
    if (!schedule) {
        assembled_free(assembled);
        return NULL;
    }
    schedule->wires = of->wires;
    schedule->hook = note_jump;
    schedule->hook_context = assembled;
    return assembled;
}

void assembled_free(Assembled *assembled)
{
    if (!assembled)
        return;
    schedule_free(assembled->schedule);
    free(assembled);
}

void assembled_set_jump_hook(Assembled *assembled, JumpHook hook, void *context)
{
    assembled->jump_hook = hook;
    assembled->jump_context = context;
}

void assembled_set_hook(Assembled *assembled, StepHook hook, void *context)
{
    assembled->hook = hook;
    assembled->hook_context = context;
}

void assembled_reset(Assembled *assembled)
{
    schedule_clear(assembled->schedule);
    /* The whole begins anew by itself. */
    assembled->filled = assembled->mirrored = false;
}

bool assembled_running(const Assembled *assembled)
{
    return assembled->schedule->running;
}

double assembled_time(const Assembled *assembled)
{
    return assembled->schedule->t;
}

bool assembled_over(Assembled *assembled)
{
    Schedule *schedule = assembled->schedule;
    uint32_t part = schedule->culprit;
    const Engine *engine = schedule_at(schedule, part);
    const char *name = NAME_AT(assembled->of->names, assembled->of->part_names[part]);
    Ending ending = (Ending)engine->status->ending;
    const char *stiff = "its flow is stiff, and it has too many states for a method for that.";
    const char *message = schedule->end == SCHEDULE_REFUSED ? schedule->message
                          : schedule->end == SCHEDULE_STIFF ? stiff
                          : ending == ENDED_NOT             ? engine_problem(engine)
                                                            : engine_message(engine);
    *assembled->whole->live.time = fmin(engine_time(engine), schedule->t);
    engine_fail(assembled->whole, ending == ENDED_NOT ? ENDED_FAILED : ending, "Part %s: %s", name, message);
    return engine_end_run(assembled->whole);
}

bool assembled_settle(Assembled *assembled, uint32_t *next)
{
    Schedule *schedule = assembled->schedule;
    *next = NOBODY;
    if (assembled->whole->status->ending != ENDED_NOT)
        return false;
    while (schedule->pending.count > 0) {
        uint32_t i = schedule->pending.parts[0];
        Engine *engine = schedule_at(schedule, i);
        engine_catch_up(engine);
        if (engine->status->ending == ENDED_NOT && !engine_take_internal_jumps(engine, &engine->live)) {
            engine_end_run(engine);
            schedule_over(schedule, i);
            return assembled_over(assembled);
        }
        if (engine_pending(engine) < engine->model->n_jumps) {
            *next = i;
            return true;
        }
        if (!schedule_update(schedule, schedule->t))
            return assembled_over(assembled);
    }
    return schedule_close(schedule) || assembled_over(assembled);
}

/* Of the whole's states nothing is kept that follows from the parts. */
static void forget(Assembled *assembled)
{
    Engine *whole = assembled->whole;
    const Model *m = whole->model;
    engine_set_time(whole, engine_time(whole));
    memset(whole->live.x, 0, (m->n_states + m->n_discrete) * sizeof(double));
    memset(whole->live.size, 0, m->n_states * sizeof(double));
    assembled->filled = assembled->mirrored = false;
}

/* The options of a run are those of the whole, and looking ahead far is for those who ask. */
static void share_options(Assembled *assembled)
{
    Schedule *schedule = assembled->schedule;
    for (size_t k = 0; k < schedule->n_groups; k++) {
        EngineOptions *options = engine_options(schedule->groups[k].engine);
        *options = *engine_options(assembled->whole);
        options->look_ahead_steps = 1.0;
    }
}

/* A part begins with its share of the whole's vectors. */
static const double *place(Assembled *assembled, uint32_t i, const double *constants)
{
    const Places *at = &assembled->of->places[i];
    const Engine *whole = assembled->whole, *engine = schedule_at(assembled->schedule, i);
    const Model *m = engine->model;
    size_t own = at[1].p - at->p, extra = m->n_parameters - own;
    engine_copy(engine->live.x, whole->live.x + at->x, m->n_states);
    engine_copy(engine->live.z, whole->live.z + at->z, m->n_discrete);
    engine_copy(engine->p, whole->p + at->p, own);
    engine_copy(engine->p + own, constants, extra);
    return constants + extra;
}

bool assembled_begin(Assembled *assembled)
{
    const Assembly *of = assembled->of;
    Schedule *schedule = assembled->schedule;
    const Engine *whole = assembled->whole;
    double start = engine_time(whole);
    uint32_t next;
    const double *constants = of->constants;
    schedule_clear(schedule);
    share_options(assembled);
    for (uint32_t i = 0; i < of->n_parts; i++)
        constants = place(assembled, i, constants);
    for (size_t k = 0; k < whole->model->n_inputs; k++)
        for (uint64_t j = of->first_heard[k]; j < of->first_heard[k + 1]; j++)
            schedule_inputs(schedule, of->heard[j].part)[of->heard[j].input] = whole->u[k];
    forget(assembled);
    schedule->running = true;
    return (schedule_start(schedule, start, whole->status->stop_time, false) &&
            schedule_hand_out(schedule) && schedule_wake(schedule))
               ? assembled_settle(assembled, &next)
               : assembled_over(assembled);
}

size_t assembled_state_size(const Assembled *assembled)
{
    return schedule_state_size(assembled->schedule);
}

void assembled_before_save(Assembled *assembled)
{
    if (assembled->filled)
        forget(assembled);
}

void assembled_save(Assembled *assembled, void *bytes)
{
    schedule_save(assembled->schedule, bytes);
}

void assembled_restore(Assembled *assembled, const void *bytes)
{
    schedule_restore(assembled->schedule, bytes);
    share_options(assembled);
    assembled->filled = assembled->mirrored = false;
}

bool assembled_state_is_sound(const Assembled *assembled, void *bytes)
{
    return schedule_state_is_sound(assembled->schedule, bytes);
}
