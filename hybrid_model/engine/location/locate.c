/* The event that ends a flow on one step of the solver: lines 16 to 18 of docs/semantics.md.

   A guard is crossed on (t0, t1] when its margin goes from negative to zero or above.  Crossings
   close enough are one instant, the latest of them; a flow that ends shortly before
   a crossing counts as having reached it. */
#include <float.h>
#include <math.h>

#include "method.h"
#include "search.h"

/* So many instants before an event an importer may stop. */
#define IMPORTER_INSTANTS 50.0
/* A margin may swing that many times faster than the rates of an exact step before one window shows too little. */
#define NARROWINGS 1024.0
/* Two events that happen to be close say little of the next one. */
#define MOST_SHORTENING 0.1

static Search search_at(Engine *engine, const Point *point, double level, double piece_end)
{
    size_t n = engine->model->n_margins;
    return (Search){engine, point, level, piece_end, .n_rows = n + 1, .exit_row = n};
}

/* No flow is looked at beyond it. */
static double last_time(const Search *search)
{
    return fmin(search->piece_end, search->engine->status->stop_time);
}

/* The time within one instant after `from` at which guards that are negative there cross, the
   first or the last of them.  `from` itself if there is none. */
static double crossing_soon_after(Search *search, double from, bool want_first)
{
    Engine *engine = search->engine;
    const Model *m = engine->model;
    double until = fmin(from + engine_one_instant(engine, from), last_time(search)), chosen = from;
    double *now = engine->samples, *then = engine->samples + search->n_rows;
    if (until <= from || !engine_look(search, ON_STEP, from, now) || !engine_try_to_look(search, ON_STEP, until, then))
        return from;
    for (size_t row = 0; row < m->n_margins && !search->failed; row++) {
        if (!engine->is_guard[row] || now[row] >= 0.0 || then[row] < 0.0)
            continue;
        Bracket bracket = {from, now[row], until, then[row]};
        engine_refine_bracket(search, ON_STEP, 0.0, row, &bracket);
        if (chosen == from || (want_first ? bracket.b < chosen : bracket.b > chosen))
            chosen = bracket.b;
    }
    return chosen;
}

/* Simultaneous guards share the latest of their times, unless one of them is negative again there. */
static double common_time(Search *search, double first)
{
    Engine *engine = search->engine;
    if (engine->n_guards < 2)
        return first;
    double latest = crossing_soon_after(search, first, false);
    double *now = engine->samples, *then = engine->samples + search->n_rows;
    if (latest == first || search->failed || !engine_look(search, ON_STEP, first, now) ||
        !engine_look(search, ON_STEP, latest, then))
        return first;
    for (size_t row = 0; row < engine->model->n_margins; row++)
        if (engine->is_guard[row] && now[row] >= 0.0 && then[row] < 0.0)
            return first;
    return latest;
}

static FlowEnd move_to(Search *search, double t)
{
    Engine *engine = search->engine;
    const Point *point = search->point;
    /* Where the step ends, its guards were looked at with its own end. */
    if (t == engine->step.t1)
        engine_copy(engine->probe_x, engine->step.x1, engine->model->n_states);
    else if (!engine_step_probe(engine, point, t))
        return FLOW_PROBLEM;
    if (point == &engine->live && !engine_record_step(engine, t, engine->probe_x))
        return FLOW_PROBLEM;
    double interval = t - engine->status->jumps_time, before = engine->status->stride;
    *point->time = t;
    engine_begin_anew(engine, point);
    /* Events often come at equal intervals, or at shorter and shorter ones. */
    if (engine->method->remembers)
        interval = fmax(interval, MOST_SHORTENING * before);
    engine->status->stride = fmin(engine->status->stride, interval);
    for (size_t i = 0; i < engine->model->n_states; i++)
        point->x[i] = engine->probe_x[i];
    engine_note_sizes(engine, point);
    return FLOW_EVENT;
}

/* Leaving the flow set is an event if a guard is crossed with it, and blocks the run otherwise. */
static FlowEnd leave_flow_set(Search *search, double t)
{
    Engine *engine = search->engine;
    const Point *point = search->point;
    double *rows = engine->samples, margin, when = t;
    bool enabled = false;
    if (!engine_look(search, ON_STEP, t, rows))
        return FLOW_PROBLEM;
    for (size_t row = 0; row < engine->model->n_margins; row++)
        enabled = enabled || (engine->is_guard[row] && rows[row] >= 0.0);
    if (!enabled)
        when = crossing_soon_after(search, t, true);
    if (search->failed)
        return FLOW_PROBLEM;
    if (enabled || when > t)
        return move_to(search, common_time(search, when));
    double crossing = engine_last_inside(search, t);
    if (isfinite(crossing))
        t = crossing;
    if (search->failed || move_to(search, t) == FLOW_PROBLEM ||
        !engine_evaluate_flow_set(engine, t, point->x, point->z, &margin))
        return FLOW_PROBLEM;
    engine_blocked(engine, t, point->x, point->z, margin);
    return FLOW_PROBLEM;
}

/* The margins of the jumps one instant after x at t, in `then`; past the end of the run time itself stands still, and
   what time alone changes goes on as it did.  False if they cannot be told. */
static bool look_one_instant_on(Engine *engine, const Point *point, double t, const double *x, double ahead,
                                double *then)
{
    const Model *m = engine->model;
    double soon = fmin(t + ahead, engine->status->stop_time);
    double before = fmax(t - (t + ahead - soon), engine->status->start_time);
    double *rates = engine->probe_k[1], *moved = engine->dense_x;
    if (m->n_states > 0 && !engine_evaluate(engine, m->flow, t, x, point->z, rates, NULL))
        return false;
    for (size_t i = 0; i < m->n_states; i++) {
        moved[i] = x[i] + ahead * rates[i];
        if (!isfinite(moved[i]))
            return false;
    }
    if (!engine_evaluate_margins(engine, soon, moved, point->z))
        return false;
    engine_copy(then, engine->margins, m->n_margins);
    if (soon >= t + ahead || !(before < t))
        return true;
    if (!engine_evaluate_margins(engine, t, x, point->z))
        return false;
    for (size_t i = 0; i < m->n_margins; i++)
        then[i] += engine->margins[i];
    if (!engine_evaluate_margins(engine, before, x, point->z))
        return false;
    for (size_t i = 0; i < m->n_margins; i++)
        then[i] -= engine->margins[i];
    return true;
}

/* Guards that are crossed within one instant after t count as crossed. */
static bool raise_guards(Engine *engine, const Point *point, double t, double ahead)
{
    const Model *m = engine->model;
    Search search = search_at(engine, point, 0.0, t);
    const Step *step = &engine->step;
    double *now = engine->samples, *then = engine->samples + search.n_rows;
    if (m->n_margins == 0)
        return true;
    if (!engine_look(&search, ON_STEP, t, now))
        return false;
    const double *x = t == step->t0 ? step->x0 : t == step->t1 ? step->x1 : engine->probe_x;
    if (!look_one_instant_on(engine, point, t, x, ahead, then))
        return true;
    for (size_t row = 0; row < m->n_margins; row++)
        if (engine->is_guard[row] && now[row] < 0.0 && then[row] >= 0.0)
            point->level[row] = now[row];
    return true;
}

/* A flow set that would be left within one instant after t, at the state x, counts as left where flow has priority. */
static bool raise_exit(Engine *engine, const Point *point, double t, const double *x, double ahead)
{
    const Model *m = engine->model;
    double now, earlier = fmax(t - ahead, engine->status->start_time);
    if (!m->flow_priority || !m->has_flow_set)
        return true;
    if (!engine_evaluate_flow_set(engine, t, x, point->z, &now))
        return false;
    double before = now;
    if (earlier < t && engine_step_probe(engine, point, earlier) &&
        engine_evaluate(engine, m->flow_set, earlier, engine->probe_x, point->z, &before, NULL) && now > 0.0 &&
        now + (now - before) * ahead / (t - earlier) < 0.0)
        point->level[m->n_margins] = now;
    return true;
}

bool engine_raise_levels(Engine *engine, const Point *point, double t)
{
    const Step *step = &engine->step;
    double ahead = engine_one_instant(engine, t);
    const double *x = t == step->t0 ? step->x0 : t == step->t1 ? step->x1 : engine->probe_x;
    return raise_guards(engine, point, t, ahead) && raise_exit(engine, point, t, x, ahead);
}

bool engine_raise_levels_here(Engine *engine, const Point *point)
{
    /* An importer that integrates by itself locates less finely. */
    double t = *point->time, ahead = IMPORTER_INSTANTS * engine_one_instant(engine, t);
    engine_note_sizes(engine, point);
    /* An importer may locate an event a little behind its guard, where the flow map need not be defined. */
    return !engine_step_begin(engine, point) ||
           (raise_guards(engine, point, t, ahead) && raise_exit(engine, point, t, point->x, ahead));
}

bool engine_reach_guard(Engine *engine, const Point *point, double limit)
{
    const Model *m = engine->model;
    double t = *point->time, ahead = engine_one_instant(engine, t);
    double earlier = fmax(t - ahead, engine->status->start_time);
    double wait = fmin(m->scales.overshoot * engine_time_ulp(t), limit - t), *now = engine->samples;
    const double *rates = engine->step.k[0];
    size_t nearest = m->n_margins;
    if (m->flow_priority || !(earlier < t) || !engine_evaluate_margins(engine, t, point->x, point->z))
        return false;
    engine_copy(now, engine->margins, m->n_margins);
    for (size_t i = 0; i < m->n_states; i++)
        engine->probe_x[i] = point->x[i] - (t - earlier) * rates[i];
    if (!engine_evaluate_margins(engine, earlier, engine->probe_x, point->z))
        return false;
    for (size_t row = 0; row < m->n_margins; row++) {
        double slope = (now[row] - engine->margins[row]) / (t - earlier);
        if (engine->is_guard[row] && now[row] < 0.0 && -now[row] <= wait * slope) {
            wait = -now[row] / slope;
            nearest = row;
        }
    }
    if (nearest == m->n_margins)
        return false;
    double end = fmax(t + wait, nextafter(t, INFINITY));
    for (size_t i = 0; i < m->n_states; i++)
        engine->probe_x[i] = point->x[i] + (end - t) * rates[i];
    if (point == &engine->live && !engine_record_line(engine, end, engine->probe_x))
        return false;
    *point->time = end;
    engine_copy(point->x, engine->probe_x, m->n_states);
    *point->step = 0.0;
    engine_note_sizes(engine, point);
    if (!engine_evaluate_margins(engine, *point->time, point->x, point->z))
        return false;
    engine_clear_levels(engine, point);
    point->level[nearest] = fmin(0.0, engine->margins[nearest]);
    return true;
}

/* A margin that is now 0 and now 1 along the step says no and yes, and is never outside its set. */
static bool refuse_indicators(Engine *engine, const Search *search)
{
    const Model *m = engine->model;
    for (size_t row = 0; row < search->n_rows - !m->has_flow_set; row++) {
        size_t zeros = 0, ones = 0;
        for (size_t i = 0; i < N_SAMPLES && zeros + ones == i; i++) {
            double margin = row == search->exit_row ? -engine_sample(search, i, row) : engine_sample(search, i, row);
            zeros += margin == 0.0 || margin == DBL_MIN;
            ones += margin == 1.0;
        }
        if (zeros > 0 && ones > 0 && zeros + ones == N_SAMPLES)
            return engine_fail(
                engine, ENDED_FAILED,
                "The margin of %s%s%s is 0 or 1 along the flow, up to t = %.9g s, as if it said no or yes. "
                "Remedy: return a number that is zero or above inside the set and negative outside.",
                row == search->exit_row ? "the flow set" : "jump '",
                row == search->exit_row ? "" : NAME_AT(m->names, m->margin_names[row]),
                row == search->exit_row ? "" : "'", search->end);
    }
    return true;
}

/* A flow that began outside by rounding, and has come inside, is held to the set itself. */
static void hold_to_set(Search *search)
{
    double *exits = search->engine->samples + search->exit_row;
    bool inside = false;
    for (size_t i = 0; i < N_SAMPLES; i++)
        inside = inside || search->level - engine_sample(search, i, search->exit_row) >= 0.0;
    if (!inside || !(search->level < 0.0))
        return;
    for (size_t i = 0; i < N_SAMPLES; i++)
        exits[i * search->n_rows] -= search->level;
    search->level = 0.0;
}

/* A polynomial over a step that leads far beyond the event has the rounding of states there: the step is made again, no
   longer than the event asks for. */
static bool is_too_long(const Search *search, double event)
{
    const Step *step = &search->engine->step;
    const double far = 10.0, least = 1e3;
    double wait = event - step->t0;
    if (!search->engine->method->is_exact || step->is_known || !(far * wait < step->t1 - step->t0) ||
        wait < least * engine_time_ulp(step->t0))
        return false;
    *search->point->step = 2.0 * wait;
    return true;
}

/* Looks for the first event in the window; CHANGED where a narrower one would tell more, if it may be narrowed. */
static FlowEnd locate_in_window(Search *search, bool may_narrow)
{
    Engine *engine = search->engine;
    double times[N_SAMPLES];
    for (size_t i = 0; i < N_SAMPLES; i++)
        times[i] = engine_sample_time(search->begin, search->end, i);
    if (!engine_look_at_samples(search, times, engine->samples))
        return FLOW_PROBLEM;
    if (!refuse_indicators(engine, search))
        return FLOW_PROBLEM;
    if (engine->model->has_flow_set)
        hold_to_set(search);
    double guard = INFINITY, leaving = INFINITY; /* lines 16 and 17 */
    bool has_guard = engine_first_guard(search, &guard);
    /* An exit within one instant before a guard, or after it, gives way. */
    double latest = has_guard ? guard - engine_one_instant(engine, guard) : (double)INFINITY;
    bool leaves = engine->model->has_flow_set && !search->failed && engine_first_exit(search, latest, &leaving);
    if (search->failed)
        return FLOW_PROBLEM;
    if (search->unsettled && may_narrow)
        return FLOW_CHANGED;
    if (is_too_long(search, fmin(guard, leaving)))
        return FLOW_SHORTER;
    if (has_guard && (!leaves || guard <= leaving + engine_one_instant(engine, leaving))) {
        guard = common_time(search, guard); /* line 18 */
        if (search->failed || (guard + engine_one_instant(engine, guard) > last_time(search) &&
                               !engine_raise_levels(engine, search->point, guard)))
            return FLOW_PROBLEM;
        return move_to(search, guard);
    }
    return leaves ? leave_flow_set(search, leaving) : FLOW_REACHED;
}

FlowEnd engine_locate_event(Engine *engine, const Point *point, double level, double piece_end)
{
    const Model *m = engine->model;
    const Step *step = &engine->step;
    Search search = search_at(engine, point, level, piece_end);
    if (m->n_margins == 0 && !m->has_flow_set)
        return FLOW_REACHED;
    double widest = (step->t1 - step->t0) / (double)step->n_windows, narrowest = widest / NARROWINGS, width = widest;
    if (!engine->method->is_exact)
        narrowest = widest;
    search.begin = step->t0;
    while (search.begin < step->t1) {
        double level_before = search.level;
        search.end = step->t1 - search.begin <= 1.5 * width ? step->t1 : search.begin + width;
        search.unsettled = false;
        FlowEnd found = locate_in_window(&search, width > narrowest);
        if (found == FLOW_CHANGED) {
            search.level = level_before;
            width *= 0.5;
        } else if (found != FLOW_REACHED) {
            return found;
        } else {
            /* What no narrower window settles is rounding. */
            if (search.unsettled)
                width = narrowest = widest;
            search.begin = search.end;
        }
    }
    return FLOW_REACHED;
}
