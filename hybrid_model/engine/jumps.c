/* Jumps: which one is enabled, what it does, and how many there may be. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "parts.h"

bool engine_ticked(const Engine *engine, size_t clock)
{
    return engine->ticked[clock] != 0;
}

void engine_clear_ticks(Engine *engine)
{
    memset(engine->ticked, 0, engine->model->n_clocks);
}

size_t engine_jumps_taken(const Engine *engine)
{
    return (size_t)engine->status->jumps_taken;
}

/* Says which state the jump (n_jumps: the start map) has made a number that it must not be. */
static bool not_finite(Engine *engine, size_t jump, size_t i, double t)
{
    const Model *m = engine->model;
    bool starts = jump == m->n_jumps;
    return problem(engine, ENDED_NOT_FINITE,
                   "'%s' becomes %g at t = %.17g by %s%s%s; states must be finite. Remedy: check that map and the "
                   "parameters.",
                   NAME_AT(m, state_name(m, i)), engine->reset.x[i], t,
                   starts ? "its start value" : "the jump map of '",
                   starts ? "" : NAME_AT(m, m->jumps[jump].name), starts ? "" : "'");
}

bool accept_state(Engine *engine, size_t jump, const Point *point)
{
    const Model *m = engine->model;
    for (size_t i = 0; i < m->n_states + m->n_discrete; i++)
        if (!isfinite(engine->reset.x[i]))
            return not_finite(engine, jump, i, *point->time);
    copy_values(point->x, engine->reset.x, m->n_states + m->n_discrete);
    note_sizes(engine, point);
    *point->step = 0.0;
    return true;
}

static bool evaluate_reset(Engine *engine, size_t jump, const Point *point)
{
    engine->arg[0] = point->time;
    engine->arg[1] = point->x;
    engine->arg[2] = point->z;
    engine->arg[3] = engine->u;
    engine->arg[4] = engine->p;
    engine->res[0] = engine->reset.x;
    engine->res[1] = engine->reset.z;
    return engine->model->reset(jump, engine->arg, engine->res, engine->iw, engine->w) == 0;
}

bool apply_reset(Engine *engine, size_t jump, const Point *point)
{
    if (evaluate_reset(engine, jump, point))
        return accept_state(engine, jump, point);
    return problem(engine, ENDED_FAILED, "The jump map of '%s' could not be evaluated at t = %.17g.",
                   NAME_AT(engine->model, engine->model->jumps[jump].name), *point->time);
}

bool evaluate_times(Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    if (m->n_times == 0)
        return true;
    if (!evaluate(engine, m->times, *point->time, point->x, point->z, engine->times, NULL))
        return problem(engine, ENDED_FAILED, "The event times of '%s' could not be evaluated at t = %.17g.", m->name,
                       *point->time);
    for (size_t j = 0; j < m->n_jumps; j++)
        if (m->jumps[j].kind == JUMP_ON_TIME && isnan(engine->times[m->jumps[j].index]))
            return problem(engine, ENDED_NOT_FINITE,
                           "The time of '%s' is not a number at t = %.17g; a time event needs a time (infinity: "
                           "never). Remedy: check its expression and the parameters.",
                           NAME_AT(m, m->jumps[j].name), *point->time);
    return true;
}

static size_t time_jumps_allowed(const Engine *engine)
{
    return JUMPS_AT_ONE_TIME * engine->model->n_times;
}

static bool stuck_in_time(Engine *engine, size_t jump, double t)
{
    return problem(engine, ENDED_ZENO,
                   "Zeno: time events, the last of them '%s', were taken more than %zu times at t = %.17g s; the next "
                   "time must lie after the present one. Remedy: let the jump map move the time on past it; where a run "
                   "starts later than its clock, declare the clock's state with computed=True and let start_map give "
                   "the next time to come.",
                   NAME_AT(engine->model, engine->model->jumps[jump].name), time_jumps_allowed(engine), t);
}

/* The first breakpoint of the flow that is due, n_jumps if there is none. */
static size_t first_internal(const Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    size_t j = 0;
    while (j < m->n_jumps && !(m->jumps[j].kind == JUMP_ON_TIME && m->jumps[j].internal &&
                               engine->times[m->jumps[j].index] <= *point->time))
        j++;
    return j;
}

/* Takes the breakpoints that are due, up to the first visible jump in the order of the table: a jump
   of the same instant that comes before a breakpoint sees the state before it. */
bool take_internal_jumps(Engine *engine, const Point *point)
{
    size_t n = engine->model->n_jumps, visible;
    for (size_t repeats = 0;; repeats++) {
        if (!evaluate_times(engine, point))
            return false;
        size_t internal = first_internal(engine, point);
        if (internal == n)
            return true;
        if (!first_enabled(engine, point, &visible))
            return false;
        if (visible < internal)
            return true;
        if (repeats == time_jumps_allowed(engine))
            return stuck_in_time(engine, internal, *point->time);
        if (!apply_reset(engine, internal, point))
            return false;
    }
}

/* Whether a jump on the state may be taken where flow has priority: outside the flow set, or where
   the flow leaves it at once. */
static bool flow_is_over(Engine *engine, const Point *point, bool *over)
{
    double margin;
    *over = false;
    if (!engine->model->has_flow_set)
        return true;
    if (!evaluate_flow_set(engine, *point->time, point->x, point->z, &margin))
        return false;
    if (margin > point->level[engine->model->n_margins])
        return true;
    *over = margin < -flow_border(engine, point, *point->time, point->x);
    /* On the border, up to rounding, it depends on where the flow leads. */
    return *over || (step_begin(engine, point) && leads_out(engine, point, margin, over));
}

/* The first enabled visible jump at the point, n_jumps if there is none. */
bool first_enabled(Engine *engine, const Point *point, size_t *jump)
{
    const Model *m = engine->model;
    bool open = !m->flow_priority, asked = open;
    *jump = m->n_jumps;
    if (!evaluate_times(engine, point) || !evaluate_margins(engine, *point->time, point->x, point->z))
        return false;
    for (size_t j = 0; j < m->n_jumps; j++) {
        const ModelJump *entry = &m->jumps[j];
        bool due = entry->kind == JUMP_ON_TIME ? !entry->internal && engine->times[entry->index] <= *point->time
                                               : engine->margins[entry->index] >= point->level[entry->index];
        if (due && entry->kind == JUMP_ON_STATE && !asked) {
            if (!flow_is_over(engine, point, &open))
                return false;
            asked = true;
        }
        if (due && (entry->kind == JUMP_ON_TIME || open)) {
            *jump = j;
            return true;
        }
    }
    return true;
}

static void tick(Engine *engine, size_t jump)
{
    for (size_t c = 0; c < engine->model->n_clocks; c++)
        if (engine->model->clock_jump[c] == jump)
            engine->ticked[c] = 1;
}

/* Counts a visible jump; false if there are too many. */
static bool count_jump(Engine *engine, size_t jump)
{
    Status *status = engine->status;
    double t = *engine->live.time;
    if (status->jumps_time != t) {
        status->jumps_time = t;
        status->time_jumps_there = 0;
    }
    status->jumps_taken++;
    if (engine->model->jumps[jump].kind == JUMP_ON_TIME)
        return ++status->time_jumps_there <= time_jumps_allowed(engine) || stuck_in_time(engine, jump, t);
    return zeno_record(engine, jump);
}

static bool take_jump(Engine *engine, size_t jump)
{
    changed(engine);
    if (!apply_reset(engine, jump, &engine->live) || !take_internal_jumps(engine, &engine->live))
        return end_run(engine);
    if (engine->model->jumps[jump].kind == JUMP_ON_STATE)
        engine->live.level[engine->model->jumps[jump].index] = 0.0;
    engine->live.level[engine->model->n_margins] = 0.0;
    tick(engine, jump);
    if (engine->jump_hook)
        engine->jump_hook(engine->jump_context, *engine->live.time, jump);
    return count_jump(engine, jump) || end_run(engine);
}

bool engine_start(Engine *engine)
{
    changed(engine);
    if (!evaluate(engine, engine->model->start, *engine->live.time, engine->live.x, engine->live.z, engine->reset.x,
                  engine->reset.z))
        return problem(engine, ENDED_FAILED, "The start values of '%s' could not be evaluated.", engine->model->name);
    return accept_state(engine, engine->model->n_jumps, &engine->live) && take_internal_jumps(engine, &engine->live);
}

size_t engine_pending(Engine *engine)
{
    size_t jump;
    if (engine->status->ending != ENDED_NOT || !first_enabled(engine, &engine->live, &jump))
        return engine->model->n_jumps;
    return jump;
}

bool engine_jump(Engine *engine, bool *states_changed)
{
    size_t jump, n = engine->model->n_states;
    *states_changed = false;
    if (engine->status->ending != ENDED_NOT)
        return false;
    if (!take_internal_jumps(engine, &engine->live) || !first_enabled(engine, &engine->live, &jump))
        return end_run(engine);
    if (jump == engine->model->n_jumps)
        return true;
    copy_values(engine->dense_x, engine->live.x, n);
    bool taken = take_jump(engine, jump);
    for (size_t i = 0; i < n; i++)
        *states_changed = *states_changed || engine->dense_x[i] != engine->live.x[i];
    return taken;
}

bool engine_jump_all(Engine *engine)
{
    while (engine->status->ending == ENDED_NOT) {
        size_t jump;
        if (!take_internal_jumps(engine, &engine->live) || !first_enabled(engine, &engine->live, &jump))
            return end_run(engine);
        if (jump == engine->model->n_jumps)
            return true;
        take_jump(engine, jump);
    }
    return false;
}
