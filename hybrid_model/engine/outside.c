/* What an importer asks that integrates by itself, outside the engine. */
#include <math.h>

#include "parts.h"

bool engine_next_time_event(Engine *engine, bool breakpoints, double *event_time)
{
    engine_catch_up(engine);
    if (engine->status->ending != ENDED_NOT || !engine_evaluate_times(engine, &engine->live))
        return false;
    *event_time = engine_next_time(engine, &engine->live, true, breakpoints);
    return isfinite(*event_time);
}

bool engine_arrive(Engine *engine)
{
    double next;
    double *now = engine->live.time;
    engine_leave_segment(engine);
    engine->view = VIEW_NONE;
    if (!engine_evaluate_times(engine, &engine->live))
        return false;
    next = engine_next_time(engine, &engine->live, true, true);
    if (next - *now <= engine->model->scales.roundings * engine_time_ulp(next))
        *now = next;
    return engine_raise_levels_here(engine, &engine->live);
}

bool engine_may_flow(Engine *engine)
{
    const Point *live = &engine->live;
    double margin;
    bool out;
    engine_leave_segment(engine);
    if (engine->status->ending != ENDED_NOT)
        return false;
    if (!engine->model->has_flow_set)
        return true;
    if (!engine_evaluate_flow_set(engine, *live->time, live->x, live->z, &margin))
        return engine_end_run(engine);
    if (margin >= 0.0 || margin >= -engine_flow_border(engine, live, *live->time, live->x))
        return true;
    if (!engine_step_begin(engine, live) || !engine_leads_out(engine, live, margin, &out))
        return engine_end_run(engine);
    if (!out)
        return true;
    engine_blocked(engine, *live->time, live->x, live->z, margin);
    return engine_end_run(engine);
}
