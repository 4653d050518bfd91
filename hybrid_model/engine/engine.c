/* A run from one target to the next: the algorithm of docs/semantics.md, whose lines are named here and in jumps.c,
   flow.c and locate.c, and what a prediction spares of it. */
#include "parts.h"

static bool too_many_steps(Engine *engine)
{
    return engine_fail(engine, ENDED_FAILED,
                       "More than %.0f solver steps in one advance; at t = %.17g s the flow of '%s' is too fast for "
                       "it. Remedy: use shorter communication steps, or look for a stiff or oscillating state.",
                       engine->options.steps_at_once, *engine->live.time, engine->model->name);
}

/* The run is over where a flow cannot go on. */
static Advance end_with(Engine *engine, FlowEnd end)
{
    if (end == FLOW_BUDGET && engine->options.pauses != 0.0)
        return ADVANCE_PAUSED;
    if (end == FLOW_BUDGET)
        too_many_steps(engine);
    engine_end_run(engine);
    return ADVANCE_ENDED;
}

/* At an event that was predicted, where the importer takes it: at the target, if that is the same instant. */
static bool stays_at_event(Engine *engine, EventPolicy policy, Advance *advance)
{
    double event = *engine->live.time, target = engine->target;
    bool at_target = target <= event + engine_one_instant(engine, event);
    if (at_target && target > event)
        engine_flow_past_event(engine, target);
    *advance = at_target ? ADVANCE_EVENT_AT_TARGET : ADVANCE_EVENT_BEFORE;
    return at_target || policy == EVENTS_STOP;
}

/* Whether steps may go beyond the target: nobody wants to see them or to keep them. */
static bool looks_ahead(const Engine *engine)
{
    return !engine->hook && engine->record == RECORD_NOTHING;
}

/* Lines 2 to 5: flow to the first event (10 to 18) and jump (6 to 9) in turn, to the target.  With `ahead` nothing from
   outside is expected soon, and looking ahead saves work. */
static Advance run(Engine *engine, EventPolicy policy, bool ahead)
{
    size_t budget = (size_t)engine->options.steps_at_once;
    double start = *engine->live.time;
    bool outside = policy == EVENTS_STOP || policy == EVENTS_INSIDE_BEFORE_END;
    Advance advance;
    for (;;) {
        bool foreseen = false;
        FlowEnd end = engine_flow_on(engine, policy, ahead, &budget, &foreseen);
        double now = *engine->live.time;
        bool at_target = now >= engine->target;
        if (end == FLOW_REACHED) /* line 4 */
            return ADVANCE_REACHED;
        if (end == FLOW_CHANGED)
            continue;
        if (end != FLOW_EVENT)
            return end_with(engine, end);
        if (outside && foreseen && stays_at_event(engine, policy, &advance))
            return advance;
        if (!foreseen && (policy == EVENTS_STOP || (policy == EVENTS_INSIDE_BEFORE_END && at_target)))
            return at_target ? ADVANCE_EVENT_AT_TARGET : ADVANCE_EVENT_BEFORE;
        /* Every round costs budget, so that jumps without progress end as well. */
        budget -= budget > 0;
        if (!engine_jump_all(engine)) /* line 3 */
            return ADVANCE_ENDED;
        /* A jump of its own is no surprise. */
        engine->status->settled = true;
        ahead = looks_ahead(engine);
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

bool engine_advance_quietly(Engine *engine, double target)
{
    Status *status = engine->status;
    if (!status->has_segment || !(target < status->segment_quiet) || status->jumps_taken > 0)
        return false;
    engine->target = *engine->live.time = target;
    engine->view = VIEW_NONE;
    status->behind = true;
    return true;
}

Advance engine_advance(Engine *engine, double target, EventPolicy policy)
{
    Status *status = engine->status;
    if (engine_advance_quietly(engine, target))
        return ADVANCE_REACHED;
    engine->target = target;
    engine->view = VIEW_NONE;
    if (status->ending != ENDED_NOT)
        return ADVANCE_ENDED;
    engine_catch_up(engine);
    status->jumps_taken = 0;
    engine_clear_ticks(engine);
    if (engine->hook)
        engine_leave_segment(engine);
    bool ahead = status->settled && looks_ahead(engine);
    status->settled = true;
    return run(engine, policy, ahead);
}
