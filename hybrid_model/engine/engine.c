/* The engine proper: the flow through time events, prediction, and advancing to a target. */
#include "parts.h"

static bool too_many_steps(Engine *engine)
{
    return engine_fail(engine, ENDED_FAILED,
                       "More than %d solver steps in one advance; at t = %.17g s the flow of '%s' is too fast for it. "
                       "Remedy: use shorter communication steps, or look for a stiff or oscillating state.",
                       ADVANCE_STEPS, *engine->live.time, engine->model->name);
}

static Advance advance_locating(Engine *engine, double start, EventPolicy policy, size_t *budget)
{
    for (;;) {
        FlowEnd end = engine_flow(engine, &engine->live, engine->target, true, budget);
        bool at_target = *engine->live.time >= engine->target;
        if (end == FLOW_REACHED)
            return ADVANCE_REACHED;
        if (end == FLOW_CHANGED)
            continue;
        if (end == FLOW_BUDGET)
            too_many_steps(engine);
        if (end != FLOW_EVENT) {
            engine_end_run(engine);
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
        if (policy == EVENTS_STOP_AFTER && now > start && engine->target - now > engine_one_instant(engine, now))
            return ADVANCE_EVENT_BEFORE;
    }
}

double engine_target(const Engine *engine)
{
    return engine->target;
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
    engine_look_ahead(engine);
    Progress progress = engine_follow_prediction(engine, policy, &budget, &end);
    if (progress == ON_THE_WAY && end == FLOW_REACHED)
        return ADVANCE_REACHED;
    if (progress == ON_THE_WAY && end != FLOW_CHANGED) {
        if (end == FLOW_BUDGET)
            too_many_steps(engine);
        engine_end_run(engine);
        return ADVANCE_ENDED;
    }
    if (progress == AT_PREDICTED_EVENT && (policy == EVENTS_STOP || policy == EVENTS_INSIDE_BEFORE_END)) {
        double event = *engine->live.time;
        bool at_target = target <= event + engine_one_instant(engine, event);
        if (at_target && target > event)
            engine_flow_past_event(engine, target);
        if (at_target)
            return ADVANCE_EVENT_AT_TARGET;
        if (policy == EVENTS_STOP)
            return ADVANCE_EVENT_BEFORE;
    }
    return advance_locating(engine, start, policy, &budget);
}
