/* One instant: jumps in the order of the parts, signals travelling at once (rule 6). */
#include <math.h>
#include <string.h>

#include "schedule.h"

/* A part that something happens to at this instant looks ahead anew when it is over. */
static void note_touched(Schedule *schedule, uint32_t i)
{
    Part *part = &schedule->parts[i];
    if (!part->touched)
        schedule->touched[schedule->n_touched++] = i;
    part->touched = true;
}

void schedule_touch(Schedule *schedule, uint32_t i)
{
    Part *part = &schedule->parts[i];
    schedule->groups[part->group].copied = NOBODY;
    note_touched(schedule, i);
    if (!part->pending)
        pending_add(&schedule->pending, i);
    part->pending = true;
}

bool schedule_bring(Schedule *schedule, uint32_t i, double t, uint32_t sender)
{
    Part *part = &schedule->parts[i];
    bool event;
    double near = schedule_instant(schedule, i, t);
    if (part->t > t + near)
        return schedule_refuse(schedule, i,
                               "is at %.12g s already, and part number %u sends to it at t = %.12g s: it cannot return "
                               "to an earlier state.",
                               part->t, sender + 1, t);
    if (part->t >= t)
        return true;
    if (!schedule_step(schedule, i, t, &event))
        return false;
    if (part->t < t - near)
        return schedule_refuse(schedule, i,
                               "stopped at t = %.12g s for an event that it had not announced, on the way to %.12g s.",
                               part->t, t);
    return true;
}

/* The run is over, since an input was sent a value that is not finite; always false. */
static bool refuse_value(Schedule *schedule, uint32_t target, uint32_t input, double value)
{
    schedule->end = SCHEDULE_NOT_FINITE;
    schedule->culprit = target;
    schedule->wrong_input = input;
    schedule->wrong_value = value;
    return false;
}

/* Carries one signal over one wire; what arrives unchanged is no reception. */
static bool carry(Schedule *schedule, uint32_t sender, uint64_t wire, double value, double t)
{
    uint32_t target = schedule->wires.targets[wire], input = schedule->wires.inputs[wire];
    if (schedule_inputs(schedule, target)[input] == value)
        return true;
    if (schedule->only_finite && !isfinite(value))
        return refuse_value(schedule, target, input, value);
    if (!schedule->parts[target].touched && !schedule_bring(schedule, target, t, sender))
        return false;
    engine_set(schedule_at(schedule, target), BANK_INPUT, input, value);
    schedule_touch(schedule, target);
    return true;
}

/* Carries what has changed of a part's signals to their receivers. */
static bool send(Schedule *schedule, uint32_t i, double t, const double *values, const bool *changed)
{
    const Wires *wires = &schedule->wires;
    for (uint64_t wire = wires->first[i]; wire < wires->first[i + 1]; wire++) {
        uint32_t signal = wires->signals[wire];
        if (changed[signal] && !carry(schedule, i, wire, values[signal], t))
            return false;
    }
    return true;
}

bool schedule_receive(Schedule *schedule, uint32_t i, Bank bank, size_t index, double value)
{
    if (!schedule_bring(schedule, i, schedule->t, i))
        return false;
    engine_set(schedule_at(schedule, i), bank, index, value);
    schedule_touch(schedule, i);
    return true;
}

static bool keep(Schedule *schedule, uint32_t i, double t, uint32_t jump, const double *signals, size_t n)
{
    double own = schedule->parts[i].due;
    if (schedule->keeps == LOG_NOTHING || (schedule->keeps == LOG_INSTANTS && jump == NO_JUMP))
        return true;
    if (schedule->keeps == LOG_INSTANTS) {
        t = schedule->t;
        signals = &own;
        n = 1;
    }
    return log_event(&schedule->log, t, i, jump, signals, n) ||
           schedule_refuse(schedule, i, "leaves no memory for its event at t = %.12g s, after %zu others.", t,
                           schedule->log.count);
}

/* What follows from a jump of a part, or from what it has received: it is noted, and sent. */
static bool show(Schedule *schedule, uint32_t i, double t, uint32_t jump)
{
    const Group *group = &schedule->groups[schedule->parts[i].group];
    size_t n = group->n_signals;
    double *sent = group->sent + n * schedule->parts[i].member, *values = schedule->values;
    bool any = false;
    if (!schedule_signals(schedule, i, values))
        return false;
    for (size_t k = 0; k < n; k++) {
        /* Bit by bit: what is not a number is sent once. */
        schedule->changed[k] = memcmp(&values[k], &sent[k], sizeof(double)) != 0;
        any = any || schedule->changed[k];
    }
    engine_copy(sent, values, n);
    double now = engine_time(schedule_at(schedule, i));
    if ((any || jump != NO_JUMP) && !keep(schedule, i, now, jump, values, n))
        return false;
    return !any || send(schedule, i, t, sent, schedule->changed);
}

/* At most one jump of a part; whether another one is due. */
static bool jump(Schedule *schedule, uint32_t i, double t, bool *again)
{
    Engine *engine = schedule_at(schedule, i);
    schedule->acting = i;
    schedule->last_jump = NO_JUMP;
    bool going = engine_jump(engine, &schedule->states_changed);
    uint32_t taken = schedule->last_jump;
    *again = going && taken != NO_JUMP && engine_pending(engine) < engine->model->n_jumps;
    if (!going || engine->status->ending != ENDED_NOT) {
        /* The jump that the run has ended with has happened. */
        if (taken != NO_JUMP && schedule_signals(schedule, i, schedule->values) &&
            !keep(schedule, i, engine_time(engine), taken, schedule->values,
                  schedule->groups[schedule->parts[i].group].n_signals))
            return false;
        return schedule_over(schedule, i);
    }
    return show(schedule, i, t, taken);
}

bool schedule_update(Schedule *schedule, double t)
{
    uint32_t i = pending_take(&schedule->pending);
    Part *part = &schedule->parts[i];
    part->pending = false;
    schedule->groups[part->group].copied = NOBODY;
    bool again = false;
    if (++part->iterations > MOST_ITERATIONS)
        return schedule_refuse(schedule, i, "asks for more than %d event iterations at t = %.9g s.", MOST_ITERATIONS,
                               t);
    if (!jump(schedule, i, t, &again))
        return false;
    part->due = false;
    if (again)
        schedule_touch(schedule, i);
    return true;
}

bool schedule_close(Schedule *schedule)
{
    for (size_t k = 0; k < schedule->n_touched; k++) {
        Part *part = &schedule->parts[schedule->touched[k]];
        part->touched = part->due = false;
        part->iterations = 0;
        part->t_event = part->t;
        schedule_predict(schedule, schedule->touched[k]);
    }
    schedule->n_touched = 0;
    return schedule->end == SCHEDULE_GOING;
}

bool schedule_iterate(Schedule *schedule, double t)
{
    schedule->t = t;
    while (schedule->pending.count > 0)
        if (!schedule_update(schedule, t))
            return false;
    return schedule_close(schedule);
}
