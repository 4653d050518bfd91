/* A network behind the calls of an engine: its jumps and steps, one instant after the other. */
#include "assembled.h"

#include <math.h>

size_t assembled_pending(Assembled *assembled)
{
    uint32_t next;
    if (!assembled_settle(assembled, &next) || next == NOBODY)
        return assembled->whole->model->n_jumps;
    return assembled->of->places[next].jump + engine_pending(schedule_at(assembled->schedule, next));
}

bool assembled_jump(Assembled *assembled, bool *states_changed)
{
    Schedule *schedule = assembled->schedule;
    uint32_t next;
    *states_changed = false;
    if (!assembled_settle(assembled, &next))
        return false;
    if (next == NOBODY)
        return true;
    assembled->mirrored = false;
    bool going = schedule_update(schedule, schedule->t);
    *states_changed = schedule->states_changed;
    return going || assembled_over(assembled);
}

bool assembled_jump_all(Assembled *assembled)
{
    Schedule *schedule = assembled->schedule;
    if (assembled->whole->status->ending != ENDED_NOT)
        return false;
    assembled->mirrored = false;
    return schedule_iterate(schedule, schedule->t) || assembled_over(assembled);
}

bool assembled_predict(Assembled *assembled, double *event_time)
{
    Schedule *schedule = assembled->schedule;
    const Queue *queue = &schedule->queue;
    uint32_t next;
    if (!assembled_settle(assembled, &next))
        return false;
    while (queue->count > 0 && schedule->parts[queue->parts[0]].unsure && !schedule->parts[queue->parts[0]].far) {
        schedule_predict_further(schedule, queue->parts[0], engine_options(assembled->whole)->look_ahead_steps);
        if (schedule->end != SCHEDULE_GOING)
            return assembled_over(assembled);
    }
    /* Without an event the end is announced, where nothing happens. */
    *event_time = queue->count > 0 ? queue->times[queue->parts[0]] : schedule->stop;
    return isfinite(*event_time) && *event_time > schedule->t;
}

bool assembled_foresees(const Assembled *assembled)
{
    const Queue *queue = &assembled->schedule->queue;
    return queue->count > 0 && !assembled->schedule->parts[queue->parts[0]].unsure;
}

static void move(Assembled *assembled, double t)
{
    assembled->schedule->t = t;
    *assembled->whole->live.time = t;
    assembled->whole->view = VIEW_NONE;
    assembled->mirrored = false;
}

/* To the next instant with events, or to the target.  An event within roundings of the target is one at the target. */
static bool go_on(Assembled *assembled)
{
    Schedule *schedule = assembled->schedule;
    double target = assembled->target, instant = schedule->t;
    schedule->enough = SIZE_MAX;
    if (!schedule_next_instant(schedule, target + 4.0 * engine_time_ulp(target), &instant))
        return assembled_over(assembled);
    bool at_target = schedule->n_due == 0 || instant >= target ||
                     target - instant <= schedule_instant(schedule, schedule->due[0], instant);
    move(assembled, at_target ? target : instant);
    schedule_touch_due(schedule);
    return true;
}

static bool is_far(const Schedule *schedule, uint32_t part, double target)
{
    return target - schedule->t > schedule_instant(schedule, part, schedule->t);
}

Advance assembled_advance(Assembled *assembled, double target, EventPolicy policy)
{
    Schedule *schedule = assembled->schedule;
    double start = schedule->t;
    assembled->target = target;
    if (schedule->jumps > 0)
        engine_clear_ticks(assembled->whole);
    schedule->jumps = 0;
    for (;;) {
        uint32_t next;
        if (!assembled_settle(assembled, &next))
            return ADVANCE_ENDED;
        bool at_target = schedule->t >= assembled->target;
        if (next != NOBODY) {
            if (policy == EVENTS_STOP || (policy == EVENTS_INSIDE_BEFORE_END && at_target))
                return at_target ? ADVANCE_EVENT_AT_TARGET : ADVANCE_EVENT_BEFORE;
            if (!assembled_jump_all(assembled))
                return ADVANCE_ENDED;
            if (policy == EVENTS_STOP_AFTER && schedule->t > start && is_far(schedule, next, assembled->target))
                return ADVANCE_EVENT_BEFORE;
        } else if (at_target)
            return ADVANCE_REACHED;
        else {
            if (assembled->hook && schedule->t > start)
                assembled->target = assembled->hook(assembled->hook_context, schedule->t, assembled->target);
            if (schedule->t < assembled->target && !go_on(assembled))
                return ADVANCE_ENDED;
        }
    }
}

bool assembled_advance_quietly(Assembled *assembled, double target)
{
    const Schedule *schedule = assembled->schedule;
    const Queue *queue = &schedule->queue;
    if (schedule->pending.count > 0 || schedule->n_touched > 0 || schedule->jumps > 0 || assembled->hook ||
        assembled->whole->status->ending != ENDED_NOT)
        return false;
    if (queue->count > 0) {
        double next = queue->times[queue->parts[0]];
        if (!(target < next - 4.0 * engine_time_ulp(next)))
            return false;
    }
    assembled->target = target;
    move(assembled, target);
    return true;
}

double assembled_target(const Assembled *assembled)
{
    return assembled->target;
}

size_t assembled_jumps_taken(const Assembled *assembled)
{
    return assembled->schedule->jumps;
}
