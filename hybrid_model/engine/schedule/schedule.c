/* A network from its start to its end: the next instant, and who has events there. */
#include <math.h>

#include "schedule.h"

void schedule_place(Schedule *schedule, size_t number, const double *const values[])
{
    Engine *engine = schedule->groups[number].engine;
    const Model *m = engine->model;
    for (uint32_t i = 0; i < schedule->n_parts; i++) {
        size_t row = schedule->parts[i].member;
        if (schedule->parts[i].group != number)
            continue;
        schedule_at(schedule, i);
        engine_copy(engine->live.x, values[BANK_STATE] + row * m->n_states, m->n_states);
        engine_copy(engine->live.z, values[BANK_DISCRETE] + row * m->n_discrete, m->n_discrete);
        engine_copy(engine->u, values[BANK_INPUT] + row * m->n_inputs, m->n_inputs);
        engine_copy(engine->p, values[BANK_PARAMETER] + row * m->n_parameters, m->n_parameters);
    }
}

/* Before the start: what a part sends is with its receivers; whether anything has changed by that. */
static bool hand_out(Schedule *schedule, uint32_t i, bool *changed)
{
    const Wires *wires = &schedule->wires;
    if (wires->first[i] == wires->first[i + 1])
        return true;
    if (!schedule_signals(schedule, i, schedule->values))
        return false;
    for (uint64_t wire = wires->first[i]; wire < wires->first[i + 1]; wire++) {
        double value = schedule->values[wires->signals[wire]];
        double *input = schedule_inputs(schedule, wires->targets[wire]) + wires->inputs[wire];
        *changed = *changed || *input != value;
        *input = value;
    }
    return true;
}

bool schedule_hand_out(Schedule *schedule)
{
    bool changed = true;
    for (int round = 0; changed; round++) {
        changed = false;
        for (uint32_t i = 0; i < schedule->n_parts; i++) {
            schedule->groups[schedule->parts[i].group].engine->view = VIEW_NONE;
            if (!hand_out(schedule, i, &changed))
                return false;
        }
        if (changed && round >= MOST_ITERATIONS)
            return schedule_refuse(schedule, 0, "begins in a network whose outputs at the start need each other.");
    }
    return true;
}

/* The start maps, part by part: later parts see the start values of earlier ones. */
static bool compute_starts(Schedule *schedule)
{
    if (!schedule_hand_out(schedule))
        return false;
    for (uint32_t i = 0; i < schedule->n_parts; i++) {
        bool changed = false;
        Engine *engine = schedule_at(schedule, i);
        if (!engine_apply_start(engine, &engine->live)) {
            engine_end_run(engine);
            return schedule_over(schedule, i);
        }
        engine->view = VIEW_NONE;
        if (!hand_out(schedule, i, &changed))
            return false;
    }
    return schedule_hand_out(schedule);
}

bool schedule_start(Schedule *schedule, double start, double stop, bool computed)
{
    schedule->t = schedule->start = start;
    schedule->stop = stop;
    for (uint32_t i = 0; i < schedule->n_parts; i++) {
        schedule->parts[i].t = schedule->parts[i].t_event = start;
        engine_set_span(schedule_at(schedule, i), start, stop);
    }
    return !computed || compute_starts(schedule);
}

bool schedule_wake(Schedule *schedule)
{
    for (uint32_t i = 0; i < schedule->n_parts; i++) {
        Engine *engine = schedule_at(schedule, i);
        engine_note_sizes(engine, &engine->live);
        engine_changed(engine);
        if (!engine_take_internal_jumps(engine, &engine->live)) {
            engine_end_run(engine);
            return schedule_over(schedule, i);
        }
        schedule_touch(schedule, i);
    }
    return true;
}

bool schedule_begin(Schedule *schedule)
{
    return schedule_wake(schedule) && schedule_iterate(schedule, schedule->start);
}

/* Looks further ahead from where a look ahead has ended; nobody else notices. */
static bool look_further(Schedule *schedule, uint32_t i)
{
    bool event = false;
    double known = schedule->queue.times[i];
    queue_remove(&schedule->queue, i);
    if (schedule->parts[i].t < known && !schedule_step(schedule, i, known, &event))
        return false;
    schedule_predict(schedule, i);
    return schedule->end == SCHEDULE_GOING;
}

/* Whether the first prediction is of an event, at most so late. */
static bool first_is_sure(Schedule *schedule, double limit)
{
    const Queue *queue = &schedule->queue;
    while (schedule->end == SCHEDULE_GOING && queue->count > 0 && queue->times[queue->parts[0]] <= limit) {
        const Part *first = &schedule->parts[queue->parts[0]];
        if (!first->unsure && !first->ends)
            return true;
        if (first->ends)
            schedule_end_ahead(schedule, queue->parts[0]);
        else
            look_further(schedule, queue->parts[0]);
        if (schedule->work >= schedule->enough)
            return false;
    }
    return false;
}

bool schedule_next_instant(Schedule *schedule, double limit, double *instant)
{
    Queue *queue = &schedule->queue;
    bool event;
    schedule->n_due = 0;
    if (!first_is_sure(schedule, limit))
        return schedule->end == SCHEDULE_GOING;
    double first = *instant = queue->times[queue->parts[0]];
    while (queue->count > 0) {
        uint32_t i = queue->parts[0];
        if (queue->times[i] > fmin(first + schedule_instant(schedule, i, first), limit))
            break;
        if (schedule->parts[i].unsure) {
            if (!look_further(schedule, i))
                return false;
            continue;
        }
        *instant = fmax(*instant, queue->times[i]);
        queue_remove(queue, i);
        schedule->due[schedule->n_due++] = i;
    }
    for (size_t k = 0; k < schedule->n_due; k++)
        if (schedule->parts[schedule->due[k]].t < *instant &&
            !schedule_step(schedule, schedule->due[k], *instant, &event))
            return false;
    return true;
}

void schedule_touch_due(Schedule *schedule)
{
    for (size_t k = 0; k < schedule->n_due; k++) {
        schedule->parts[schedule->due[k]].due = true;
        schedule_touch(schedule, schedule->due[k]);
    }
}

/* Brings a part to the target, with the events that it has there. */
static bool finish(Schedule *schedule, uint32_t i, double target)
{
    Part *part = &schedule->parts[i];
    bool event;
    while (part->t < target) {
        if (!schedule_step(schedule, i, target, &event))
            return false;
        if (!event)
            continue;
        if (part->t < target - schedule_instant(schedule, i, target))
            return schedule_refuse(schedule, i,
                                   "stopped at t = %.12g s for an event that it had not announced, on the way to "
                                   "%.12g s.",
                                   part->t, target);
        part->due = true;
        schedule_touch(schedule, i);
        if (!schedule_iterate(schedule, target))
            return false;
    }
    return true;
}

/* Handles events up to the target; those at the target are pending then if they are to be left. */
static ScheduleEnd come(Schedule *schedule, double target, bool leaves)
{
    double instant = schedule->t;
    while (schedule->end == SCHEDULE_GOING) {
        if (schedule->work >= schedule->enough)
            return SCHEDULE_GOING;
        if (!schedule_next_instant(schedule, target, &instant))
            break;
        if (schedule->n_due == 0 && schedule->work < schedule->enough)
            return SCHEDULE_REACHED;
        schedule_touch_due(schedule);
        if (leaves && schedule->n_due > 0 &&
            target - instant <= schedule_instant(schedule, schedule->due[0], instant))
            return SCHEDULE_REACHED;
        if (!schedule_iterate(schedule, instant))
            break;
    }
    return schedule->end;
}

ScheduleEnd schedule_approach(Schedule *schedule, double target, size_t work)
{
    schedule->enough = schedule->work + work;
    ScheduleEnd end = come(schedule, target, true);
    if (end == SCHEDULE_REACHED)
        schedule->t = target;
    return end;
}

ScheduleEnd schedule_advance(Schedule *schedule, double target, size_t work)
{
    schedule->enough = schedule->work + work;
    if (schedule->finished == 0) {
        ScheduleEnd end = come(schedule, target, false);
        if (end != SCHEDULE_REACHED)
            return end;
    }
    for (; schedule->end == SCHEDULE_GOING && schedule->finished < schedule->n_parts; schedule->finished++)
        if (!finish(schedule, (uint32_t)schedule->finished, target))
            return schedule->end;
    if (schedule->end != SCHEDULE_GOING)
        return schedule->end;
    schedule->finished = 0;
    schedule->t = target;
    return SCHEDULE_REACHED;
}
