/* Jumps: which one is due, what it does, and how many there may be: lines 6 to 9 of docs/semantics.md. */
#include <math.h>
#include <string.h>

#include "parts.h"

bool engine_ticked(const Engine *engine, size_t jump)
{
    return engine->ticked[jump] != 0;
}

void engine_clear_ticks(Engine *engine)
{
    memset(engine->ticked, 0, engine->model->n_jumps);
}

size_t engine_jumps_taken(const Engine *engine)
{
    return (size_t)engine->status->jumps_taken;
}

/* Says what the jump (n_jumps: the start map) has made of state i against the rule. */
static bool refused(Engine *engine, Ending ending, size_t jump, size_t i, double t, const char *rule)
{
    const Model *m = engine->model;
    bool starts = jump == m->n_jumps;
    const char *state = NAME_AT(m->names, engine_state_name(m, i));
    if (starts)
        return engine_fail(engine, ending, "%s = %.17g at the start: %s", state, engine->reset.x[i], rule);
    return engine_fail(engine, ending, "%s = %.17g after jump '%s' at t = %.9g s: %s", state, engine->reset.x[i],
                       NAME_AT(m->names, m->jumps[jump].name), t, rule);
}

static bool is_integer(double value)
{
    return value == floor(value) && value >= INT32_MIN && value <= INT32_MAX;
}

/* Copies the new state in engine->reset into the point if all of it is finite, and whole where it must be; it comes
   from a jump, or (n_jumps) from the start map. */
static bool accept_state(Engine *engine, size_t jump, const Point *point)
{
    const Model *m = engine->model;
    for (size_t i = 0; i < m->n_states + m->n_discrete; i++)
        if (!isfinite(engine->reset.x[i]))
            return refused(engine, ENDED_NOT_FINITE, jump, i, *point->time,
                           "states must stay finite numbers. Remedy: check that map and the parameters.");
    for (size_t i = 0; i < m->n_discrete; i++)
        if (m->whole[i] && !is_integer(engine->reset.z[i]))
            return refused(engine, ENDED_FAILED, jump, m->n_states + i, *point->time,
                           "it is declared integer and must stay a whole number from -2147483648 to 2147483647. "
                           "Remedy: round it in that map, or declare it without integer.");
    engine_watch_factors(engine, point, engine->reset.z);
    engine_copy(point->x, engine->reset.x, m->n_states + m->n_discrete);
    engine_note_sizes(engine, point);
    engine_begin_anew(engine, point);
    return true;
}

bool engine_apply_start(Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    if (!engine_evaluate(engine, m->start, *point->time, point->x, point->z, engine->reset.x, engine->reset.z))
        return engine_fail(engine, ENDED_FAILED, "The start values of '%s' could not be evaluated.", m->name);
    return accept_state(engine, m->n_jumps, point);
}

static bool evaluate_reset(Engine *engine, size_t jump, const Point *point)
{
    engine_bind(engine, point->time, point->x, point->z, engine->reset.x, engine->reset.z);
    return engine->model->reset(jump, engine->arg, engine->res, engine->iw, engine->w) == 0;
}

/* Times follow from discrete states and parameters alone; whether those are the same as when they were evaluated last,
   bit by bit. */
static bool times_are_there(const Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    return engine->has_times && memcmp(engine->times_of, point->z, m->n_discrete * sizeof(double)) == 0 &&
           memcmp(engine->times_of + m->n_discrete, engine->p, m->n_parameters * sizeof(double)) == 0;
}

bool engine_evaluate_times(Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    if (m->n_times == 0 || times_are_there(engine, point))
        return true;
    engine->has_times = false;
    if (!engine_evaluate(engine, m->times, *point->time, point->x, point->z, engine->times, NULL))
        return engine_fail(engine, ENDED_FAILED, "The event times of '%s' could not be evaluated at t = %.17g.",
                           m->name, *point->time);
    for (size_t j = 0; j < m->n_jumps; j++)
        if (m->jumps[j].kind == JUMP_ON_TIME && isnan(engine->times[m->jumps[j].index]))
            return engine_fail(engine, ENDED_NOT_FINITE,
                               "the time of jump '%s' is not a number at t = %.9g s; a time event needs a time "
                               "(infinity: never). Remedy: check its expression and the parameters.",
                               NAME_AT(m->names, m->jumps[j].name), *point->time);
    engine_copy(engine->times_of, point->z, m->n_discrete);
    engine_copy(engine->times_of + m->n_discrete, engine->p, m->n_parameters);
    engine->has_times = true;
    return true;
}

/* Line 8: the jump of a time event must move its time on, though not yet past the present. */
static bool moved_on(Engine *engine, size_t jump, double was, const Point *point)
{
    if (!engine_evaluate_times(engine, point))
        return false;
    double now = engine->times[engine->model->jumps[jump].index];
    return now > was ||
           engine_fail(engine, ENDED_FAILED,
                       "The time event '%s' was due at %.17g s and after its jump is due at %.17g s. Remedy: "
                       "let its jump map move its time on.",
                       NAME_AT(engine->model->names, engine->model->jumps[jump].name), was, now);
}

/* Counts a jump of the live point, breakpoints of the flow as well; false if it uses up those that a run may have. */
static bool within_budget(Engine *engine)
{
    engine->statistics.jumps++;
    return (double)engine->statistics.jumps < engine->options.most_jumps ||
           engine_fail(engine, ENDED_JUMPS, "%llu jumps by t = %.9g s.", (unsigned long long)engine->statistics.jumps,
                       *engine->live.time);
}

bool engine_apply_reset(Engine *engine, size_t jump, const Point *point)
{
    const ModelJump *entry = &engine->model->jumps[jump];
    double was = entry->kind == JUMP_ON_TIME ? engine->times[entry->index] : 0.0;
    if (!evaluate_reset(engine, jump, point))
        return engine_fail(engine, ENDED_FAILED, "The jump map of '%s' could not be evaluated at t = %.17g.",
                           NAME_AT(engine->model->names, entry->name), *point->time);
    if (point == &engine->live)
        engine_note_jump(engine, jump);
    if (point == &engine->live && !engine_record_jump(engine, jump))
        return false;
    if (!accept_state(engine, jump, point) || (entry->kind == JUMP_ON_TIME && !moved_on(engine, jump, was, point)))
        return false;
    return point != &engine->live || within_budget(engine);
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
bool engine_take_internal_jumps(Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    size_t n = m->n_jumps, visible, last = n, repeats = 0, all = 0;
    for (;;) {
        if (!engine_evaluate_times(engine, point))
            return false;
        size_t internal = first_internal(engine, point);
        if (internal == n)
            return true;
        if (!engine_first_enabled(engine, point, &visible))
            return false;
        if (visible < internal)
            return true;
        repeats = internal == last ? repeats + 1 : 1;
        last = internal;
        /* Those that enable each other in turn have an end as well. */
        if ((double)repeats > engine->options.jumps_at_once ||
            (double)++all > engine->options.jumps_at_once * (double)m->n_times)
            return engine_too_many_at_once(engine, internal, repeats > 1 ? repeats : all, *point->time);
        if (!engine_apply_reset(engine, internal, point))
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
    if (!engine_evaluate_flow_set(engine, *point->time, point->x, point->z, &margin))
        return false;
    if (margin > point->level[engine->model->n_margins])
        return true;
    *over = margin < -engine_flow_border(engine, point, *point->time, point->x);
    /* On the border, up to rounding, it depends on where the flow leads. */
    return *over || (engine_step_begin(engine, point) && engine_leads_out(engine, point, margin, over));
}

/* Line 6. */
bool engine_first_enabled(Engine *engine, const Point *point, size_t *jump)
{
    const Model *m = engine->model;
    bool open = !m->flow_priority, asked = open;
    *jump = m->n_jumps;
    if (!engine_evaluate_margins(engine, *point->time, point->x, point->z))
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

/* Counts a visible jump; false if there are too many (line 9). */
static bool count_jump(Engine *engine, size_t jump)
{
    engine->status->jumps_time = *engine->live.time;
    engine->status->jumps_taken++;
    return engine_zeno_record(engine, jump);
}

/* Lines 7 to 9. */
static bool take_jump(Engine *engine, size_t jump)
{
    engine_changed(engine);
    bool going = engine_apply_reset(engine, jump, &engine->live) && engine_take_internal_jumps(engine, &engine->live);
    /* The last jump of a budget has happened. */
    if (!going && engine->problem != ENDED_JUMPS)
        return engine_end_run(engine);
    if (engine->model->jumps[jump].kind == JUMP_ON_STATE)
        engine->live.level[engine->model->jumps[jump].index] = engine->live.level[engine->model->n_margins] = 0.0;
    engine->ticked[jump] = 1;
    if (engine->jump_hook)
        engine->jump_hook(engine->jump_context, *engine->live.time, jump);
    return (going && count_jump(engine, jump)) || engine_end_run(engine);
}

bool engine_start(Engine *engine)
{
    engine_changed(engine);
    return engine_apply_start(engine, &engine->live) && engine_record_jump(engine, engine->model->n_jumps) &&
           engine_take_internal_jumps(engine, &engine->live);
}

size_t engine_pending(Engine *engine)
{
    size_t jump;
    engine_catch_up(engine);
    if (engine->status->ending != ENDED_NOT || !engine_evaluate_times(engine, &engine->live) ||
        !engine_first_enabled(engine, &engine->live, &jump))
        return engine->model->n_jumps;
    return jump;
}

bool engine_jump(Engine *engine, bool *states_changed)
{
    size_t jump, n = engine->model->n_states;
    *states_changed = false;
    engine_catch_up(engine);
    if (engine->status->ending != ENDED_NOT)
        return false;
    if (!engine_take_internal_jumps(engine, &engine->live) || !engine_first_enabled(engine, &engine->live, &jump))
        return engine_end_run(engine);
    if (jump == engine->model->n_jumps)
        return true;
    engine_copy(engine->dense_x, engine->live.x, n);
    bool taken = take_jump(engine, jump);
    for (size_t i = 0; i < n; i++)
        *states_changed = *states_changed || engine->dense_x[i] != engine->live.x[i];
    return taken;
}

bool engine_jump_all(Engine *engine)
{
    while (engine->status->ending == ENDED_NOT) {
        size_t jump;
        if (!engine_take_internal_jumps(engine, &engine->live) || !engine_first_enabled(engine, &engine->live, &jump))
            return engine_end_run(engine);
        if (jump == engine->model->n_jumps)
            return true;
        take_jump(engine, jump);
    }
    return false;
}
