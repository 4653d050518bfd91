/* Looking ahead to the next event, and following what was seen as far as it carries. */
#include <float.h>
#include <math.h>

#include "method.h"

/* How far a look ahead goes: a call of the importer's must come back in a fraction of a second, also where one
   step of the solver is a matter of thousands of states and margins. */
static size_t look_ahead_steps(const Engine *engine)
{
    const Model *m = engine->model;
    const EngineOptions *options = &engine->options;
    double steps = options->look_ahead_work / (double)(1 + m->n_states + m->n_margins + m->n_times);
    return (size_t)fmin(fmax(steps, LEAST_STEPS_AHEAD), options->look_ahead_steps);
}

/* How far a look ahead goes that has no limit: far beyond all that the run has shown of its time scale. */
static double look_ahead_limit(Engine *engine)
{
    const Point *live = &engine->live;
    double step, now = *live->time, span = fabs(now), size = engine_largest_state(engine, live, live->x);
    if (engine_step_begin(engine, live) && engine_first_step(engine, live, INFINITY, size, &step))
        span = fmax(span, step);
    span *= LOOK_AHEAD_TIMES;
    if (engine_evaluate_times(engine, &engine->live)) {
        double next = engine_next_time(engine, &engine->live, true, true);
        span = isfinite(next) ? fmax(span, LOOK_AHEAD_EVENTS * (next - now)) : span;
    }
    /* Nothing is known of a run at rest. */
    return now + (span > LOOK_AHEAD_TIMES * DBL_MIN ? span : LOOK_AHEAD_TIMES);
}

/* Until when nothing happens where what is known ends at `known`, maybe with an event: a guard that is crossed a little
   behind a target may count as reached with it. */
static double quiet_until(const Engine *engine, double known)
{
    return known - fmax(4.0 * engine_time_ulp(known), engine_one_instant(engine, known));
}

/* Goes on from the predicted point over so many steps; whether that is ahead, and its time. */
static bool foresee(Engine *engine, double limit, size_t budget, double *event_time)
{
    double now = *engine->live.time, horizon = isfinite(limit) ? limit : look_ahead_limit(engine);
    FlowEnd end = engine_flow(engine, &engine->predicted, fmin(limit, horizon), true, &budget);
    engine->keeps = false;
    bool renew = end == FLOW_BUDGET || (end == FLOW_REACHED && limit > horizon);
    /* A problem ahead is reported when its time is reached; it may never be, if an input changes. */
    engine->status->prediction = end == FLOW_EVENT ? PREDICTION_EVENT : renew ? PREDICTION_RENEWAL : PREDICTION_QUIET;
    /* Without an event ahead the limit is announced, where nothing happens: that too is knowledge. */
    *event_time = *engine->predicted.time;
    /* A run that ends within an instant has no time to announce: rounding by rounding it would not get to its end. */
    return *event_time > now + (end == FLOW_PROBLEM ? engine_one_instant(engine, *event_time) : 0.0);
}

/* Looks ahead over so many steps; with `keep` the live point then moves along the first of them. */
static bool look_ahead(Engine *engine, double limit, size_t budget, bool keep, double *event_time)
{
    Status *status = engine->status;
    engine_leave_segment(engine);
    status->prediction = PREDICTION_NONE;
    if (status->ending != ENDED_NOT)
        return false;
    /* Along a step there is no breakpoint, so those that are due come before it. */
    engine->keeps = keep && engine->method->is_exact && engine_take_internal_jumps(engine, &engine->live);
    engine_copy_point(engine, &engine->live, &engine->predicted);
    bool ahead = foresee(engine, limit, budget, event_time);
    if (status->has_segment)
        status->segment_quiet = fmin(status->segment_end, quiet_until(engine, *engine->predicted.time));
    return ahead;
}

bool engine_predict(Engine *engine, double limit, double *event_time)
{
    return look_ahead(engine, limit, look_ahead_steps(engine), false, event_time);
}

bool engine_look_ahead(Engine *engine, double limit, double *event_time)
{
    return look_ahead(engine, limit, look_ahead_steps(engine), true, event_time);
}

bool engine_look_further(Engine *engine, double limit, double *event_time)
{
    if (engine->status->prediction != PREDICTION_RENEWAL)
        return engine_look_ahead(engine, limit, event_time);
    return foresee(engine, limit, look_ahead_steps(engine), event_time);
}

void engine_end_ahead(Engine *engine)
{
    engine_copy_point(engine, &engine->predicted, &engine->live);
    engine->view = VIEW_NONE;
    engine_end_run(engine);
}

bool engine_foresees(const Engine *engine)
{
    return engine->model->predictable && engine->status->prediction == PREDICTION_EVENT;
}

static void keep_segment(Engine *engine, double known)
{
    engine_segment_keep(engine);
    engine->status->segment_quiet = fmin(engine->status->segment_end, quiet_until(engine, known));
}

/* Looks ahead as far as one step of the solver goes, along which the live point then moves; false if it fails. */
static bool look_one_step_ahead(Engine *engine)
{
    Status *status = engine->status;
    const Point *ahead = &engine->predicted;
    double now = *engine->live.time, limit = now + STEPS_AHEAD * (engine->target - now);
    size_t budget = 1;
    if (!engine_take_internal_jumps(engine, &engine->live))
        return false;
    engine_copy_point(engine, &engine->live, ahead);
    *ahead->step *= engine->method->segment_part;
    engine->keeps = true;
    FlowEnd end = engine_flow(engine, ahead, fmin(limit, fmax(status->stop_time, engine->target)), true, &budget);
    engine->keeps = false;
    if (end == FLOW_PROBLEM) {
        status->has_segment = false;
        return false;
    }
    status->prediction = end == FLOW_EVENT ? PREDICTION_EVENT : PREDICTION_STEP;
    if (status->has_segment)
        status->segment_quiet = fmin(status->segment_end, quiet_until(engine, *ahead->time));
    return true;
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

void engine_flow_past_event(Engine *engine, double target)
{
    size_t before, after, budget = (size_t)engine->options.look_ahead_steps;
    engine_copy_point(engine, &engine->live, &engine->shown);
    engine->view = VIEW_NONE;
    if (engine_evaluate_times(engine, &engine->live) && engine_first_enabled(engine, &engine->live, &before) &&
        !breakpoint_until(engine, target) &&
        engine_flow(engine, &engine->shown, target, false, &budget) == FLOW_REACHED &&
        engine_first_enabled(engine, &engine->shown, &after) && before == after)
        engine_copy_point(engine, &engine->shown, &engine->live);
}

/* Follows the solver's own steps to the target where nothing is to happen up to there: a target within a step is read
   from its interpolation.  False if a step fails; the live point is then at the start of that step. */
static bool follow_steps(Engine *engine, double target)
{
    Status *status = engine->status;
    const Point *live = &engine->live;
    double known = *engine->predicted.time;
    while (!status->has_segment || target >= status->segment_end) {
        if (status->has_segment)
            engine_segment_move(engine, status->segment_end);
        engine_leave_segment(engine);
        if (!engine_take_internal_jumps(engine, live))
            return false;
        if (*live->time >= target)
            return true;
        engine_clear_levels(engine, live);
        double limit = fmin(known, engine_next_time(engine, live, false, true));
        limit = fmin(limit, *live->time + STEPS_AHEAD * (target - *live->time));
        if (*live->step > 0.0)
            limit = fmin(limit, *live->time + engine->method->segment_part * *live->step);
        if (!engine_step_begin(engine, live) || !engine_step_accept(engine, live, limit))
            return false;
        keep_segment(engine, known);
    }
    engine_segment_move(engine, target);
    return true;
}

/* Where events are taken inside, a guard that is crossed a little behind the target is reached with it: rounding
   does not decide.  Time events have their times. */
static bool reached_with(Engine *engine, EventPolicy policy, double event)
{
    bool inside = policy == EVENTS_INSIDE || policy == EVENTS_STOP_AFTER;
    return inside && engine->status->prediction == PREDICTION_EVENT &&
           engine->target >= event - engine_one_instant(engine, event) &&
           engine_evaluate_times(engine, &engine->live) && engine_next_time(engine, &engine->live, true, false) > event;
}

/* Whether the target comes before anything that is foreseen. */
static bool target_is_quiet(Engine *engine, EventPolicy policy)
{
    double known = *engine->predicted.time, target = engine->target;
    switch ((Prediction)engine->status->prediction) {
    case PREDICTION_STEP: return engine->status->has_segment && target < engine->status->segment_quiet;
    case PREDICTION_QUIET: return target <= known;
    default: return target < known - 4.0 * engine_time_ulp(known) && !reached_with(engine, policy, known);
    }
}

static bool target_is_near(const Engine *engine)
{
    double step = *engine->live.step;
    return !(step > 0.0) || engine->target - *engine->live.time <= STEPS_BELOW * step;
}

FlowEnd engine_flow_on(Engine *engine, EventPolicy policy, bool ahead, size_t *budget, bool *foreseen)
{
    Status *status = engine->status;
    const Point *live = &engine->live;
    for (; *budget > 0; --*budget) {
        if (status->prediction == PREDICTION_NONE &&
            !(ahead && target_is_near(engine) && look_one_step_ahead(engine)))
            break;
        if (target_is_quiet(engine, policy)) {
            /* A hook wants to see each step, so none may go beyond the target. */
            bool followed = !engine->hook && follow_steps(engine, engine->target);
            return followed ? FLOW_REACHED : engine_flow(engine, live, engine->target, false, budget);
        }
        Prediction prediction = (Prediction)status->prediction;
        status->prediction = PREDICTION_NONE;
        /* A crossing shortly behind the target is looked for from here: it may count as reached. */
        bool beyond = engine->target > *engine->predicted.time;
        if (prediction == PREDICTION_QUIET || (prediction == PREDICTION_STEP && !beyond))
            break;
        status->has_segment = false;
        engine_copy_point(engine, &engine->predicted, live);
        *foreseen = prediction != PREDICTION_STEP;
        /* A look ahead that has ended at a breakpoint has left it to whoever comes there. */
        if (prediction == PREDICTION_RENEWAL && !engine_take_internal_jumps(engine, live))
            return FLOW_PROBLEM;
        if (*foreseen)
            return FLOW_EVENT;
    }
    engine_leave_segment(engine);
    return engine_flow(engine, live, engine->target, true, budget);
}
