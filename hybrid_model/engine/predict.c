/* Looking ahead to the next event, and following what was seen as far as it carries. */
#include <float.h>
#include <math.h>

#include "parts.h"

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

bool engine_predict(Engine *engine, double limit, double *event_time)
{
    Status *status = engine->status;
    double now = *engine->live.time;
    size_t budget = look_ahead_steps(engine);
    status->prediction = PREDICTION_NONE;
    if (status->ending != ENDED_NOT)
        return false;
    double horizon = isfinite(limit) ? limit : look_ahead_limit(engine);
    engine_copy_point(engine, &engine->live, &engine->predicted);
    FlowEnd end = engine_flow(engine, &engine->predicted, fmin(limit, horizon), true, &budget);
    bool renew = end == FLOW_BUDGET || (end == FLOW_REACHED && limit > horizon);
    /* A problem ahead is reported when its time is reached; it may never be, if an input changes. */
    status->prediction = end == FLOW_EVENT ? PREDICTION_EVENT : renew ? PREDICTION_RENEWAL : PREDICTION_QUIET;
    /* Without an event ahead the limit is announced, where nothing happens: that too is knowledge. */
    *event_time = *engine->predicted.time;
    return *event_time > now;
}

bool engine_foresees(const Engine *engine)
{
    return engine->status->prediction == PREDICTION_EVENT;
}

void engine_look_ahead(Engine *engine)
{
    Status *status = engine->status;
    double event, now = *engine->live.time;
    if (status->settled && status->prediction == PREDICTION_NONE && engine->model->predictable && !engine->hook &&
        engine->record == RECORD_NOTHING) {
        double limit = now + STEPS_AHEAD * (engine->target - now);
        engine_predict(engine, fmin(limit, fmax(status->stop_time, engine->target)), &event);
        /* Nobody has been told to come back where the budget ended: up to there it is quiet. */
        if (status->prediction == PREDICTION_RENEWAL)
            status->prediction = PREDICTION_QUIET;
    }
    status->settled = true;
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
    if (engine_first_enabled(engine, &engine->live, &before) && !breakpoint_until(engine, target) &&
        engine_flow(engine, &engine->shown, target, false, &budget) == FLOW_REACHED &&
        engine_first_enabled(engine, &engine->shown, &after) && before == after)
        engine_copy_point(engine, &engine->shown, &engine->live);
}

/* Follows the solver's own steps to the target where nothing is to happen up to `quiet_until`: a target within
   a step is read from its interpolation.  False if a step fails; the live point is then at the start of that step. */
static bool follow_steps(Engine *engine, double target, double quiet_until)
{
    Status *status = engine->status;
    while (!status->has_segment || target >= status->segment_end) {
        if (status->has_segment)
            engine_segment_read(engine, status->segment_end);
        status->has_segment = false;
        if (!engine_take_internal_jumps(engine, &engine->live))
            return false;
        if (*engine->live.time >= target)
            return true;
        engine_clear_levels(engine, &engine->live);
        double limit = fmin(quiet_until, engine_next_time(engine, &engine->live, false, true));
        if (*engine->live.step > 0.0)
            limit = fmin(limit, *engine->live.time + SEGMENT_PART * *engine->live.step);
        if (!engine_step_begin(engine, &engine->live) || !engine_step_accept(engine, &engine->live, limit))
            return false;
        engine_segment_keep(engine);
    }
    engine_segment_read(engine, target);
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

Progress engine_follow_prediction(Engine *engine, EventPolicy policy, size_t *budget, FlowEnd *end)
{
    double event = *engine->predicted.time, target = engine->target;
    Prediction prediction = (Prediction)engine->status->prediction;
    bool quiet = prediction == PREDICTION_QUIET;
    if (prediction == PREDICTION_NONE)
        return NOT_PREDICTED;
    if (quiet ? target <= event
              : target < event - 4.0 * engine_time_ulp(event) && !reached_with(engine, policy, event)) {
        /* A hook wants to see each step, so none may go beyond the target. */
        if (engine->hook || !follow_steps(engine, target, event))
            *end = engine_flow(engine, &engine->live, target, false, budget);
        return ON_THE_WAY;
    }
    engine->status->has_segment = false;
    engine->status->prediction = PREDICTION_NONE;
    if (quiet)
        return NOT_PREDICTED;
    engine_copy_point(engine, &engine->predicted, &engine->live);
    return AT_PREDICTED_EVENT;
}
