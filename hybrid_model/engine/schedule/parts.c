/* One part of a network: its engine is the one of its group, on a block of its own. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "schedule.h"

unsigned char *schedule_block(const Schedule *schedule, uint32_t i)
{
    const Part *part = &schedule->parts[i];
    const Group *group = &schedule->groups[part->group];
    return group->slab + group->block_size * part->member;
}

double *schedule_inputs(const Schedule *schedule, uint32_t i)
{
    const Group *group = &schedule->groups[schedule->parts[i].group];
    return (double *)(void *)(schedule_block(schedule, i) + group->inputs_at);
}

static void let_go(Schedule *schedule, Group *group)
{
    /* Jumps are bounded part by part. */
    if (group->present != NOBODY)
        schedule->parts[group->present].jumps = group->engine->statistics.jumps;
    group->present = NOBODY;
}

void schedule_let_go(Schedule *schedule)
{
    for (size_t k = 0; k < schedule->n_groups; k++)
        let_go(schedule, &schedule->groups[k]);
}

Engine *schedule_turn_to(Schedule *schedule, uint32_t i)
{
    Part *part = &schedule->parts[i];
    Group *group = &schedule->groups[part->group];
    Engine *engine = group->engine;
    let_go(schedule, group);
    engine_use_block(engine, schedule_block(schedule, i));
    engine->statistics.jumps = part->jumps;
    group->present = i;
    return engine;
}

Engine *schedule_peek(Schedule *schedule, uint32_t i, double t)
{
    Part *part = &schedule->parts[i];
    Group *group = &schedule->groups[part->group];
    Engine *engine = group->engine;
    if (part->t >= t || part->pending)
        return schedule_at(schedule, i);
    bool there = group->copied == i && group->copied_to == t;
    if (there && engine->block == group->copy)
        return engine;
    let_go(schedule, group);
    engine_use_block(engine, group->copy);
    if (there)
        return engine;
    memcpy(group->copy, schedule_block(schedule, i), group->block_size);
    group->copied = i;
    group->copied_to = t;
    while (engine_advance(engine, t, EVENTS_STOP) == ADVANCE_PAUSED)
        ;
    return engine;
}

bool schedule_refuse(Schedule *schedule, uint32_t part, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(schedule->message, sizeof schedule->message, format, arguments);
    va_end(arguments);
    schedule->end = SCHEDULE_REFUSED;
    schedule->culprit = part;
    return false;
}

bool schedule_over(Schedule *schedule, uint32_t part)
{
    schedule->end = SCHEDULE_ENDED;
    schedule->culprit = part;
    return false;
}

double schedule_instant(const Schedule *schedule, uint32_t i, double t)
{
    const Part *part = &schedule->parts[i];
    const Engine *engine = schedule->groups[part->group].engine;
    const ModelScales *scales = &engine->model->scales;
    if (engine->options.event_tolerance > 0.0)
        return engine->options.event_tolerance;
    double by_run = scales->instant * (t - schedule->start);
    double by_gap = scales->instant_in_gap * (t - part->t_event);
    return engine_larger(engine_smaller(by_run, by_gap), scales->roundings * engine_time_ulp(t));
}

/* Whether the flow of a part has turned out to be stiff, and its model has no derivatives for that: the run is over. */
static bool needs_another_method(Schedule *schedule, uint32_t i)
{
    const Engine *engine = schedule_at(schedule, i);
    if (!engine->status->is_stiff || engine->implicit.jacobian)
        return false;
    schedule->end = SCHEDULE_STIFF;
    schedule->culprit = i;
    return true;
}

bool schedule_step(Schedule *schedule, uint32_t i, double target, bool *event)
{
    Part *part = &schedule->parts[i];
    Engine *engine = schedule_at(schedule, i);
    Advance advance = ADVANCE_PAUSED;
    schedule->steps++;
    while (advance == ADVANCE_PAUSED && !needs_another_method(schedule, i))
        advance = engine_advance(engine, target, EVENTS_STOP);
    if (advance == ADVANCE_PAUSED)
        return false;
    bool there = advance == ADVANCE_REACHED || advance == ADVANCE_EVENT_AT_TARGET;
    double reached = there ? target : fmin(engine_time(engine), target);
    *event = advance == ADVANCE_EVENT_AT_TARGET || advance == ADVANCE_EVENT_BEFORE;
    part->stalls = reached > part->t ? 0 : part->stalls + 1;
    part->t = reached;
    if (advance == ADVANCE_ENDED)
        return schedule_over(schedule, i);
    if (part->stalls > MOST_ITERATIONS)
        return schedule_refuse(schedule, i,
                               "gets no further than t = %.12g s: each of its last %d steps ended there with an event.",
                               part->t, MOST_ITERATIONS);
    return true;
}

/* Where a value comes from outside, a part is asked anew. */
static double limit_of(Schedule *schedule, uint32_t i)
{
    return fmin(schedule->stop, schedule_at(schedule, i)->status->stop_time);
}

/* Looks some steps ahead, or on from where a look ahead has ended, beyond `known`; a step that is made again, shorter,
   counts as one, and may be all of them. */
static bool look(Schedule *schedule, uint32_t i, bool further, double known, double *next)
{
    Engine *engine = schedule_at(schedule, i);
    double few = engine->options.look_ahead_steps, steps = few, limit = limit_of(schedule, i);
    bool ahead;
    *next = known;
    do {
        engine->options.look_ahead_steps = steps;
        ahead = further ? engine_look_further(engine, limit, next) : engine_look_ahead(engine, limit, next);
        steps *= 8.0;
    } while (!(*next > known) && engine->status->prediction == PREDICTION_RENEWAL && steps < MOST_ITERATIONS);
    engine->options.look_ahead_steps = few;
    return ahead;
}

/* What a look ahead has found goes into the queue. */
static void note(Schedule *schedule, uint32_t i, bool ahead, double next)
{
    Part *part = &schedule->parts[i];
    double limit = limit_of(schedule, i);
    Prediction found = (Prediction)schedule_at(schedule, i)->status->prediction;
    part->unsure = part->ends = part->far = false;
    if (ahead && found == PREDICTION_QUIET && next >= limit) {
        queue_remove(&schedule->queue, i);
        return;
    }
    part->unsure = ahead && found == PREDICTION_RENEWAL;
    if (found == PREDICTION_EVENT || part->unsure) {
        /* An event may be due where a look ahead has ended. */
        queue_put(&schedule->queue, i, ahead ? next : part->t);
        return;
    }
    /* What happens within an instant comes first: it may let the run go on. */
    double end = ahead ? next : part->t;
    part->ends = true;
    queue_put(&schedule->queue, i, fmin(end + schedule_instant(schedule, i, end), limit));
}

void schedule_predict(Schedule *schedule, uint32_t i)
{
    Part *part = &schedule->parts[i];
    double next;
    schedule->work++;
    part->unsure = part->ends = part->far = false;
    part->reach = 1.0;
    if (part->t >= limit_of(schedule, i)) {
        queue_remove(&schedule->queue, i);
        return;
    }
    bool ahead = look(schedule, i, false, part->t, &next);
    if (!needs_another_method(schedule, i))
        note(schedule, i, ahead, next);
}

void schedule_predict_further(Schedule *schedule, uint32_t i, double most)
{
    Part *part = &schedule->parts[i];
    double next, known = schedule->queue.times[i];
    schedule->work++;
    bool ahead = look(schedule, i, true, known, &next);
    if (needs_another_method(schedule, i))
        return;
    note(schedule, i, ahead, next);
    part->far = part->unsure && (!(next > known) || ++part->reach >= most);
}

bool schedule_end_ahead(Schedule *schedule, uint32_t i)
{
    Part *part = &schedule->parts[i];
    double next, known = schedule->queue.times[i];
    schedule->work++;
    bool ahead = look(schedule, i, false, part->t, &next);
    if (needs_another_method(schedule, i))
        return false;
    note(schedule, i, ahead, next);
    if (!part->ends || next > known)
        return true;
    Engine *engine = schedule_at(schedule, i);
    engine_end_ahead(engine);
    part->t = engine_time(engine);
    /* The others are shown as they are there. */
    schedule->t = fmax(schedule->t, part->t);
    return schedule_over(schedule, i);
}

bool schedule_signals(Schedule *schedule, uint32_t i, double *values)
{
    const Group *group = &schedule->groups[schedule->parts[i].group];
    const double *outputs = NULL;
    if (group->n_signals == 0)
        return true;
    Engine *engine = schedule_at(schedule, i);
    if (group->sends_outputs && !(outputs = engine_values(engine, VIEW_LIVE, BANK_OUTPUT))) {
        engine_end_run(engine);
        return schedule_over(schedule, i);
    }
    for (size_t k = 0; k < group->n_signals; k++) {
        const Signal *signal = &group->signals[k];
        values[k] = (signal->bank == BANK_OUTPUT ? outputs : engine->live.z)[signal->index];
    }
    return true;
}
