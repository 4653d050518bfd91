/* The flow of a point through time events, up to a time or to the first event: lines 10 to 15 of docs/semantics.md. */
#include <float.h>
#include <math.h>

#include "parts.h"

double engine_next_time(Engine *engine, const Point *point, bool visible, bool internal)
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
            else if (time <= first + m->scales.roundings * engine_time_ulp(first))
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
    double end = fmin(limit, piece_end), level = 0.0;
    if (!engine_step_begin(engine, point) || (locate && !engine_flow_may_begin(engine, point, &level))) /* line 10 */
        return FLOW_PROBLEM;
    engine_clear_levels(engine, point); /* line 11 */
    engine_begin_pace(point);
    if (*point->time == engine->status->start_time ||
        engine_largest_state(engine, point, point->x) <= DBL_MIN / engine->model->scales.absolute)
        engine_raise_floor(engine, point, end);
    while (*point->time < end) { /* lines 12 to 14 */
        if (*budget == 0)
            return FLOW_BUDGET;
        --*budget;
        if (!engine_step_accept(engine, point, end)) {
            bool reached = locate && engine->problem == ENDED_NOT_FINITE && engine_reach_guard(engine, point, end);
            return reached ? FLOW_EVENT : FLOW_PROBLEM;
        }
        FlowEnd found = locate ? engine_locate_event(engine, point, level, piece_end) : FLOW_REACHED;
        if (found == FLOW_SHORTER)
            continue;
        if (engine->keeps && point == &engine->predicted) {
            engine_segment_keep(engine);
            engine->keeps = false;
        }
        if (locate) {
            if (found != FLOW_REACHED)
                return found;
            if (engine->step.t1 >= end && !engine_raise_levels(engine, point, engine->step.t1)) /* line 15 */
                return FLOW_PROBLEM;
        }
        if (point == &engine->live && !engine_record_step(engine, engine->step.t1, engine->step.x1))
            return FLOW_PROBLEM;
        engine_step_commit(engine, point);
        if (point == &engine->live && engine->hook && *point->time < end && !go_on(engine))
            return FLOW_CHANGED;
    }
    return FLOW_REACHED;
}

/* Takes a guard that is crossed within one instant before a time event to that event's instant, where
   the order of the table decides and not rounding. */
static FlowEnd go_on_to(Engine *engine, const Point *point, double time_event)
{
    size_t budget = INSTANT_STEPS;
    const Model *m = engine->model;
    double *enabled = engine->enabled;
    if (!engine_evaluate_margins(engine, *point->time, point->x, point->z))
        return FLOW_PROBLEM;
    for (size_t i = 0; i < m->n_margins; i++)
        enabled[i] = engine->margins[i] >= point->level[i] ? 1.0 : 0.0;
    FlowEnd result = flow_piece(engine, point, time_event, time_event, false, &budget);
    if (result != FLOW_REACHED || !engine_evaluate_margins(engine, *point->time, point->x, point->z))
        return result == FLOW_REACHED ? FLOW_PROBLEM : result;
    for (size_t i = 0; i < m->n_margins; i++)
        if (enabled[i] > 0.0)
            point->level[i] = fmin(0.0, engine->margins[i]);
    return FLOW_REACHED;
}

FlowEnd engine_flow(Engine *engine, const Point *point, double limit, bool locate, size_t *budget)
{
    for (;;) {
        size_t jump = engine->model->n_jumps;
        if (!engine_take_internal_jumps(engine, point) || (locate && !engine_first_enabled(engine, point, &jump)))
            return FLOW_PROBLEM;
        if (jump < engine->model->n_jumps)
            return FLOW_EVENT;
        if (*point->time >= limit)
            return FLOW_REACHED;
        double piece_end = fmin(engine_next_time(engine, point, locate, true), engine->options.barrier); /* line 11 */
        FlowEnd result = flow_piece(engine, point, limit, piece_end, locate, budget);
        /* What happens at the breakpoint is for whoever goes on from there. */
        if (result == FLOW_REACHED && *budget == 0 && *point->time < limit)
            return FLOW_BUDGET;
        bool near = piece_end <= limit && piece_end - *point->time <= engine_one_instant(engine, piece_end);
        if (result == FLOW_EVENT && near && *point->time < piece_end) /* line 15 */
            result = go_on_to(engine, point, piece_end);
        /* At an event the loop begins anew: a breakpoint of the same instant may come before it. */
        if (result != FLOW_REACHED && result != FLOW_EVENT)
            return result;
    }
}
