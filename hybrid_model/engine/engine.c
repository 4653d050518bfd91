/* The engine proper: the flow through time events, prediction, and advancing to a target. */
#include "engine.h"

#include <float.h>
#include <math.h>

#include "parts.h"

/* The next time event after the point; visible ones only if asked for.  Times that differ by rounding
   only are one, the latest of them. */
static double next_time(Engine *engine, const Point *point, bool visible, bool internal)
{
    const Model *m = engine->model;
    double first = INFINITY, next = -INFINITY;
    for (int round = 0; round < 2; round++)
        for (size_t j = 0; j < m->n_jumps; j++) {
            const ModelJump *entry = &m->jumps[j];
            double time = engine->times[entry->index];
            if (entry->kind != JUMP_ON_TIME || !(entry->internal ? internal : visible) || !(time > *point->time))
                continue;
            if (round == 0)
                first = fmin(first, time);
            else if (time <= first + m->scales.roundings * time_ulp(first))
                next = fmax(next, time);
        }
    return isfinite(next) ? next : first;
}

/* Shows the hook the state on the way; false if it has changed something. */
static bool go_on(Engine *engine)
{
    double before = engine->target;
    engine->view = VIEW_NONE;
    engine->target = engine->hook(engine->hook_context, *engine->live.time, before);
    /* What it has read is of this time; the run goes on. */
    engine->view = VIEW_NONE;
    return *engine->live.step > 0.0 && engine->target >= before;
}

/* Flows to `limit` or to the end of a piece without time events, or to the first guard crossing on it.
   Guards that are simultaneous with one before the limit may put the event beyond it, within one
   instant, but never beyond the piece. */
static FlowEnd flow_piece(Engine *engine, const Point *point, double limit, double piece_end, bool locate,
                          size_t *budget)
{
    double end = fmin(limit, piece_end);
    double level = 0.0;
    clear_levels(engine, point);
    if (!step_begin(engine, point) || (locate && !flow_may_begin(engine, point, &level)))
        return FLOW_PROBLEM;
    if (*point->time == engine->status->start_time || largest_state(engine, point, point->x) <= DBL_MIN / engine->model->scales.absolute)
        raise_floor(engine, point, end);
    while (*point->time < end) {
        if (*budget == 0)
            return FLOW_BUDGET;
        --*budget;
        if (!step_accept(engine, point, end)) {
            bool reached = locate && engine->problem == ENDED_NOT_FINITE && reach_guard(engine, point, end);
            return reached ? FLOW_EVENT : FLOW_PROBLEM;
        }
        if (locate) {
            FlowEnd found = locate_event(engine, point, level, piece_end);
            if (found != FLOW_REACHED)
                return found;
            if (engine->step.t1 >= end && !raise_levels(engine, point, engine->step.t1))
                return FLOW_PROBLEM;
        }
        step_commit(engine, point);
        if (point == &engine->live && engine->hook && *point->time < end && !go_on(engine))
            return FLOW_CHANGED;
    }
    return FLOW_REACHED;
}

/* Takes a guard that is crossed within one instant before a time event to that event's instant, where
   the order of the table decides and not rounding. */
static FlowEnd go_on_to(Engine *engine, const Point *point, double time_event, size_t *budget)
{
    const Model *m = engine->model;
    double *enabled = engine->enabled;
    if (!evaluate_margins(engine, *point->time, point->x, point->z))
        return FLOW_PROBLEM;
    for (size_t i = 0; i < m->n_margins; i++)
        enabled[i] = engine->margins[i] >= point->level[i] ? 1.0 : 0.0;
    FlowEnd result = flow_piece(engine, point, time_event, time_event, false, budget);
    if (result != FLOW_REACHED || !evaluate_margins(engine, *point->time, point->x, point->z))
        return result == FLOW_REACHED ? FLOW_PROBLEM : result;
    for (size_t i = 0; i < m->n_margins; i++)
        if (enabled[i] > 0.0)
            point->level[i] = fmin(0.0, engine->margins[i]);
    return FLOW_REACHED;
}

/* Flows to `limit` through the breakpoints on the way; with `locate` it stops at the first visible event. */
static FlowEnd flow(Engine *engine, const Point *point, double limit, bool locate, size_t *budget)
{
    for (;;) {
        size_t jump = engine->model->n_jumps;
        if (!take_internal_jumps(engine, point) || (locate && !first_enabled(engine, point, &jump)))
            return FLOW_PROBLEM;
        if (jump < engine->model->n_jumps)
            return FLOW_EVENT;
        if (*point->time >= limit)
            return FLOW_REACHED;
        double piece_end = next_time(engine, point, locate, true);
        FlowEnd result = flow_piece(engine, point, limit, piece_end, locate, budget);
        bool near = piece_end <= limit && piece_end - *point->time <= one_instant(engine, piece_end);
        if (result == FLOW_EVENT && near && *point->time < piece_end)
            result = go_on_to(engine, point, piece_end, budget);
        /* At an event the loop begins anew: a breakpoint of the same instant may come before it. */
        if (result != FLOW_REACHED && result != FLOW_EVENT)
            return result;
    }
}

static bool too_many_steps(Engine *engine)
{
    return problem(engine, ENDED_FAILED,
                   "More than %d solver steps in one advance; at t = %.17g s the flow of '%s' is too fast for it. "
                   "Remedy: use shorter communication steps, or look for a stiff or oscillating state.",
                   ADVANCE_STEPS, *engine->live.time, engine->model->name);
}

/* How far a look ahead goes: a call of the importer's must come back in a fraction of a second, also where one
   step of the solver is a matter of thousands of states and margins. */
static size_t look_ahead_steps(const Model *m)
{
    size_t size = 1 + m->n_states + m->n_margins + m->n_times, steps = LOOK_AHEAD_WORK / size;
    return steps > LOOK_AHEAD_STEPS ? LOOK_AHEAD_STEPS : steps < LEAST_STEPS_AHEAD ? LEAST_STEPS_AHEAD : steps;
}

/* How far a look ahead goes that has no limit: far beyond all that the run has shown of its time scale. */
static double look_ahead_limit(Engine *engine)
{
    double step, now = *engine->live.time, span = fabs(now);
    if (step_begin(engine, &engine->live) && first_step(engine, &engine->live, INFINITY, &step))
        span = fmax(span, step);
    span *= LOOK_AHEAD_TIMES;
    if (evaluate_times(engine, &engine->live)) {
        double next = next_time(engine, &engine->live, true, true);
        span = isfinite(next) ? fmax(span, LOOK_AHEAD_EVENTS * (next - now)) : span;
    }
    /* Nothing is known of a run at rest. */
    return now + (span > LOOK_AHEAD_TIMES * DBL_MIN ? span : LOOK_AHEAD_TIMES);
}

bool engine_predict(Engine *engine, double limit, double *event_time)
{
    Status *status = engine->status;
    double now = *engine->live.time;
    size_t budget = look_ahead_steps(engine->model);
    status->prediction = PREDICTION_NONE;
    if (status->ending != ENDED_NOT)
        return false;
    double horizon = isfinite(limit) ? limit : look_ahead_limit(engine);
    copy_point(engine, &engine->live, &engine->predicted);
    FlowEnd end = flow(engine, &engine->predicted, fmin(limit, horizon), true, &budget);
    bool renew = end == FLOW_BUDGET || (end == FLOW_REACHED && limit > horizon);
    /* A problem ahead is reported when its time is reached; it may never be, if an input changes. */
    status->prediction = end == FLOW_EVENT ? PREDICTION_EVENT : renew ? PREDICTION_RENEWAL : PREDICTION_QUIET;
    /* Without an event ahead the limit is announced, where nothing happens: that too is knowledge. */
    *event_time = *engine->predicted.time;
    return *event_time > now;
}

bool engine_next_time_event(Engine *engine, bool breakpoints, double *event_time)
{
    if (engine->status->ending != ENDED_NOT || !evaluate_times(engine, &engine->live))
        return false;
    *event_time = next_time(engine, &engine->live, true, breakpoints);
    return isfinite(*event_time);
}

bool engine_arrive(Engine *engine)
{
    double next;
    double *now = engine->live.time;
    engine->view = VIEW_NONE;
    if (!evaluate_times(engine, &engine->live))
        return false;
    next = next_time(engine, &engine->live, true, true);
    if (next - *now <= engine->model->scales.roundings * time_ulp(next))
        *now = next;
    return raise_levels_here(engine, &engine->live);
}

bool engine_may_flow(Engine *engine)
{
    const Point *live = &engine->live;
    double margin;
    bool out;
    if (engine->status->ending != ENDED_NOT)
        return false;
    if (!engine->model->has_flow_set)
        return true;
    if (!evaluate_flow_set(engine, *live->time, live->x, live->z, &margin))
        return end_run(engine);
    if (margin >= 0.0 || margin >= -flow_border(engine, live, *live->time, live->x))
        return true;
    if (!step_begin(engine, live) || !leads_out(engine, live, margin, &out))
        return end_run(engine);
    if (!out)
        return true;
    blocked(engine, *live->time, live->x, live->z, margin);
    return end_run(engine);
}

/* Whether a breakpoint is due at the live point or comes up to `target`; the times must be there. */
static bool breakpoint_until(const Engine *engine, double target)
{
    const Model *m = engine->model;
    for (size_t j = 0; j < m->n_jumps; j++)
        if (m->jumps[j].kind == JUMP_ON_TIME && m->jumps[j].internal && engine->times[m->jumps[j].index] <= target)
            return true;
    return false;
}

/* The target lies a rounding or less than an instant behind the event: go there if the event is
   still due then and no breakpoint lies between; otherwise the point stays at the event. */
static void flow_past_event(Engine *engine, double target)
{
    size_t before, after, budget = LOOK_AHEAD_STEPS;
    copy_point(engine, &engine->live, &engine->shown);
    engine->view = VIEW_NONE;
    if (first_enabled(engine, &engine->live, &before) && !breakpoint_until(engine, target) &&
        flow(engine, &engine->shown, target, false, &budget) == FLOW_REACHED &&
        first_enabled(engine, &engine->shown, &after) && before == after)
        copy_point(engine, &engine->shown, &engine->live);
}

/* Follows the solver's own steps to the target where nothing is to happen up to `quiet_until`: a target within
   a step is read from its interpolation.  False if a step fails; the live point is then at the start of that step. */
static bool follow_steps(Engine *engine, double target, double quiet_until)
{
    Status *status = engine->status;
    while (!status->has_segment || target >= status->segment_end) {
        if (status->has_segment)
            segment_read(engine, status->segment_end);
        status->has_segment = false;
        if (!take_internal_jumps(engine, &engine->live))
            return false;
        if (*engine->live.time >= target)
            return true;
        clear_levels(engine, &engine->live);
        double limit = fmin(quiet_until, next_time(engine, &engine->live, false, true));
        if (*engine->live.step > 0.0)
            limit = fmin(limit, *engine->live.time + SEGMENT_PART * *engine->live.step);
        if (!step_begin(engine, &engine->live) || !step_accept(engine, &engine->live, limit))
            return false;
        segment_keep(engine);
    }
    segment_read(engine, target);
    return true;
}

typedef enum { ON_THE_WAY, AT_PREDICTED_EVENT, NOT_PREDICTED } Progress;

/* Where events are taken inside, a guard that is crossed a little behind the target is reached with it: rounding
   does not decide.  Time events have their times. */
static bool reached_with(Engine *engine, EventPolicy policy, double event)
{
    bool inside = policy == EVENTS_INSIDE || policy == EVENTS_STOP_AFTER;
    return inside && engine->status->prediction == PREDICTION_EVENT &&
           engine->target >= event - one_instant(engine, event) && evaluate_times(engine, &engine->live) &&
           next_time(engine, &engine->live, true, false) > event;
}

/* Uses the prediction, if there is one, as far as it carries. */
static Progress follow_prediction(Engine *engine, EventPolicy policy, size_t *budget, FlowEnd *end)
{
    double event = *engine->predicted.time, target = engine->target;
    Prediction prediction = (Prediction)engine->status->prediction;
    bool quiet = prediction == PREDICTION_QUIET;
    if (prediction == PREDICTION_NONE)
        return NOT_PREDICTED;
    if (quiet ? target <= event : target < event - 4.0 * time_ulp(event) && !reached_with(engine, policy, event)) {
        /* A hook wants to see each step, so none may go beyond the target. */
        if (engine->hook || !follow_steps(engine, target, event))
            *end = flow(engine, &engine->live, target, false, budget);
        return ON_THE_WAY;
    }
    engine->status->has_segment = false;
    engine->status->prediction = PREDICTION_NONE;
    if (quiet)
        return NOT_PREDICTED;
    copy_point(engine, &engine->predicted, &engine->live);
    return AT_PREDICTED_EVENT;
}

static Advance advance_locating(Engine *engine, double start, EventPolicy policy, size_t *budget)
{
    for (;;) {
        FlowEnd end = flow(engine, &engine->live, engine->target, true, budget);
        bool at_target = *engine->live.time >= engine->target;
        if (end == FLOW_REACHED)
            return ADVANCE_REACHED;
        if (end == FLOW_CHANGED)
            continue;
        if (end == FLOW_BUDGET)
            too_many_steps(engine);
        if (end != FLOW_EVENT) {
            end_run(engine);
            return ADVANCE_ENDED;
        }
        if (policy == EVENTS_STOP || (policy == EVENTS_INSIDE_BEFORE_END && at_target))
            return at_target ? ADVANCE_EVENT_AT_TARGET : ADVANCE_EVENT_BEFORE;
        /* Every round costs budget, so that jumps without progress end as well. */
        *budget -= *budget > 0;
        if (!engine_jump_all(engine))
            return ADVANCE_ENDED;
        /* A jump of its own is no surprise. */
        engine->status->settled = true;
        double now = *engine->live.time;
        if (policy == EVENTS_STOP_AFTER && now > start && engine->target - now > one_instant(engine, now))
            return ADVANCE_EVENT_BEFORE;
    }
}

/* Looks ahead where that saves work: after a step in which nothing came from outside, for as many more. */
static void look_ahead(Engine *engine)
{
    Status *status = engine->status;
    double event, now = *engine->live.time;
    if (status->settled && status->prediction == PREDICTION_NONE && engine->model->predictable && !engine->hook) {
        double limit = now + STEPS_AHEAD * (engine->target - now);
        engine_predict(engine, fmin(limit, fmax(status->stop_time, engine->target)), &event);
        /* Nobody has been told to come back where the budget ended: up to there it is quiet. */
        if (status->prediction == PREDICTION_RENEWAL)
            status->prediction = PREDICTION_QUIET;
    }
    status->settled = true;
}

double engine_target(const Engine *engine)
{
    return engine->target;
}

bool engine_foresees(const Engine *engine)
{
    return engine->status->prediction == PREDICTION_EVENT;
}

void engine_set_jump_hook(Engine *engine, JumpHook hook, void *context)
{
    engine->jump_hook = hook;
    engine->jump_context = context;
}

void engine_set_hook(Engine *engine, StepHook hook, void *context)
{
    engine->hook = hook;
    engine->hook_context = context;
}

Advance engine_advance(Engine *engine, double target, EventPolicy policy)
{
    size_t budget = ADVANCE_STEPS;
    double start = *engine->live.time;
    FlowEnd end = FLOW_REACHED;
    if (engine->status->ending != ENDED_NOT)
        return ADVANCE_ENDED;
    engine->status->jumps_taken = 0;
    engine_clear_ticks(engine);
    engine->view = VIEW_NONE;
    engine->target = target;
    /* With a hook the solver makes no steps beyond the target. */
    if (engine->hook)
        engine->status->has_segment = false;
    look_ahead(engine);
    Progress progress = follow_prediction(engine, policy, &budget, &end);
    if (progress == ON_THE_WAY && end == FLOW_REACHED)
        return ADVANCE_REACHED;
    if (progress == ON_THE_WAY && end != FLOW_CHANGED) {
        if (end == FLOW_BUDGET)
            too_many_steps(engine);
        end_run(engine);
        return ADVANCE_ENDED;
    }
    if (progress == AT_PREDICTED_EVENT && (policy == EVENTS_STOP || policy == EVENTS_INSIDE_BEFORE_END)) {
        double event = *engine->live.time;
        bool at_target = target <= event + one_instant(engine, event);
        if (at_target && target > event)
            flow_past_event(engine, target);
        if (at_target)
            return ADVANCE_EVENT_AT_TARGET;
        if (policy == EVENTS_STOP)
            return ADVANCE_EVENT_BEFORE;
    }
    return advance_locating(engine, start, policy, &budget);
}
