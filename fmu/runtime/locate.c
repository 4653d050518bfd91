/* The trigger rule and the location of events on one step of the solver.

   A guard is crossed on (t0, t1] when its margin goes from negative to zero or above.  The step is
   looked at in N_SAMPLES places of the interpolation; two crossings between neighbouring places are
   found where the samples show a maximum.  The time is then polished on the solver's own step from
   t0, so that time and state belong together; it is the end of the bracket at which the margin is
   >= 0.  The flow set's margin is treated as one more guard, which is crossed on leaving. */
#include <float.h>
#include <math.h>

#include "parts.h"

static const double SAMPLE[N_SAMPLES] = {0.0,       1e-3,      1.0 / 9.0, 2.0 / 9.0, 3.0 / 9.0, 4.0 / 9.0,
                                         5.0 / 9.0, 6.0 / 9.0, 7.0 / 9.0, 8.0 / 9.0, 0.999,     1.0};

typedef struct {
    double a, value_a;        /* negative */
    double b, value_b;        /* zero or above */
} Bracket;

/* What locating needs to know of the present step.  Rows are the jumps' margins, then the exit. */
typedef struct {
    Engine *engine;
    const Point *point;
    double level;             /* the margin of the flow set that is to be kept */
    double piece_end;         /* the flow may be probed up to here */
    size_t n_rows, exit_row;
    bool failed;
} Search;

typedef enum { ON_INTERPOLATION, ON_STEP } Path;

double event_tolerance(double t)
{
    return fmax(EVENT_TOLERANCE, 8.0 * time_ulp(t));
}

bool evaluate_margins(Engine *engine, double t, const double *x, const double *z)
{
    const Model *m = engine->model;
    if (m->n_margins == 0)
        return true;
    if (!evaluate(engine, m->margins, t, x, z, engine->margins, NULL))
        return problem(engine, ENDED_FAILED, "The jump sets of '%s' could not be evaluated at t = %.17g.", m->name, t);
    for (size_t i = 0; i < m->n_margins; i++)
        if (isnan(engine->margins[i]))
            return problem(engine, ENDED_NOT_FINITE,
                           "The jump margin '%s' is not a number at t = %.17g; margins must be numbers. Remedy: check "
                           "the jump set for 0/0 or the root of a negative number.",
                           m->margin_names[i], t);
    return true;
}

bool evaluate_flow_set(Engine *engine, double t, const double *x, const double *z, double *margin)
{
    const char *name = engine->model->name;
    if (!evaluate(engine, engine->model->flow_set, t, x, z, margin, NULL))
        return problem(engine, ENDED_FAILED, "The flow set of '%s' could not be evaluated at t = %.17g.", name, t);
    if (isnan(*margin))
        return problem(engine, ENDED_NOT_FINITE,
                       "The margin of the flow set of '%s' is not a number at t = %.17g; margins must be numbers. "
                       "Remedy: check the flow set for 0/0 or the root of a negative number.",
                       name, t);
    return true;
}

static bool blocked(Engine *engine, double t, const double *x, const double *z, double margin)
{
    char values[MESSAGE_SIZE / 2];
    return problem(engine, ENDED_BLOCKED,
                   "Blocked: at t = %.17g the state is outside the flow set (margin %.6g < 0) and no jump is enabled; "
                   "%s. Remedy: extend the flow set or the jump set so that one of them holds the state.",
                   t, margin, describe_state(engine, x, z, values, sizeof values));
}

bool flow_may_begin(Engine *engine, const Point *point, double *level)
{
    double margin, later, t = *point->time;
    *level = 0.0;
    if (!engine->model->has_flow_set)
        return true;
    if (!evaluate_flow_set(engine, t, point->x, point->z, &margin))
        return false;
    *level = fmin(0.0, margin);
    if (margin >= -EVENT_TOLERANCE)
        return true;
    double soon = t + event_tolerance(t);
    if (!step_probe(engine, point, soon) || !evaluate_flow_set(engine, soon, engine->probe_x, point->z, &later))
        return false;
    return later >= 0.0 || blocked(engine, t, point->x, point->z, margin);
}

/* Fills `rows` with the margins at a time of the step. */
static bool look(Search *search, Path path, double t, double *rows)
{
    Engine *engine = search->engine;
    const Model *m = engine->model;
    const double *x = path == ON_STEP ? engine->probe_x : engine->dense_x;
    if (path == ON_STEP && !step_probe(engine, search->point, t))
        return !(search->failed = true);
    if (path == ON_INTERPOLATION)
        step_dense(engine, t);
    if (!evaluate_margins(engine, t, x, search->point->z))
        return !(search->failed = true);
    for (size_t i = 0; i < m->n_margins; i++)
        rows[i] = engine->margins[i];
    if (m->has_flow_set) {
        double margin;
        if (!evaluate_flow_set(engine, t, x, search->point->z, &margin))
            return !(search->failed = true);
        /* Zero is inside the flow set, so it is not yet an exit. */
        double outside = search->level - margin;
        rows[search->exit_row] = outside == 0.0 ? -DBL_MIN : outside;
    }
    return true;
}

/* The value of one row; a failure is noted in the search and ends every loop on it. */
static double look_at(Search *search, Path path, double t, size_t row)
{
    double *rows = search->engine->samples + N_SAMPLES * search->n_rows;
    return look(search, path, t, rows) ? rows[row] : 0.0;
}

/* Shrinks the bracket by Chandrupatla's method: inverse quadratic interpolation where it is safe,
   bisection elsewhere.  (T. R. Chandrupatla, Advances in Engineering Software 28, 1997.) */
static void polish(Search *search, size_t row, Bracket *bracket)
{
    double a = bracket->a, fa = bracket->value_a, b = bracket->b, fb = bracket->value_b, fraction = 0.5;
    double width = fmax(LOCATION_TOLERANCE, 2.0 * time_ulp(b));
    for (int i = 0; i < 200 && b - a > width && fb != 0.0 && !search->failed; i++) {
        double t = a + fraction * (b - a);
        if (t <= a || t >= b)
            break;
        double f = look_at(search, ON_STEP, t, row);
        /* newest, the opposite end, and the end that the newest replaces */
        double x1 = t, f1 = f, x2, f2, x3, f3;
        if (f >= 0.0) {
            x2 = a, f2 = fa, x3 = b, f3 = fb;
            b = t, fb = f;
        } else {
            x2 = b, f2 = fb, x3 = a, f3 = fa;
            a = t, fa = f;
        }
        double xi = (x1 - x2) / (x3 - x2), phi = (f1 - f2) / (f3 - f2), part = 0.5;
        if (phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi)
            part = f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2);
        double least = 0.5 * width / (b - a);
        part = fmin(fmax(part, least), 1.0 - least);
        fraction = f >= 0.0 ? 1.0 - part : part;
        if (!isfinite(fraction) || fraction <= 0.0 || fraction >= 1.0)
            fraction = 0.5;
    }
    *bracket = (Bracket){a, fa, b, fb};
}

static double sample_time(const Step *step, size_t i)
{
    return i + 1 == N_SAMPLES ? step->t1 : step->t0 + SAMPLE[i] * (step->t1 - step->t0);
}

static double sample(const Search *search, size_t i, size_t row)
{
    return search->engine->samples[i * search->n_rows + row];
}

/* Whether three samples with a maximum in the middle, all negative, may reach zero between them. */
static bool may_touch_zero(const Search *search, size_t middle, size_t row)
{
    double f0 = sample(search, middle - 1, row), f1 = sample(search, middle, row), f2 = sample(search, middle + 1, row);
    if (!(f0 < 0.0 && f1 < 0.0 && f2 < 0.0) || f1 < f0 || f1 < f2 || (f1 == f0 && f1 == f2))
        return false;
    double left = SAMPLE[middle] - SAMPLE[middle - 1], right = SAMPLE[middle + 1] - SAMPLE[middle];
    double rise = (f1 - f0) / left, fall = (f2 - f1) / right;
    double bend = (fall - rise) / (left + right), slope = (rise * right + fall * left) / (left + right);
    /* The parabola through them rises slope^2 / (-4 bend) above the middle; be generous with it. */
    return f1 + 8.0 * slope * slope / (-4.0 * bend) + (f1 - fmin(f0, f2)) >= 0.0;
}

/* Golden-section search for a place between the neighbours of sample `middle` where the row is >= 0. */
static bool find_touch(Search *search, size_t middle, size_t row, double *where)
{
    static const double GOLDEN = 0.61803398874989485;
    const Step *step = &search->engine->step;
    double a = sample_time(step, middle - 1), b = sample_time(step, middle + 1);
    double left = b - GOLDEN * (b - a), right = a + GOLDEN * (b - a);
    double f_left = look_at(search, ON_INTERPOLATION, left, row), f_right = look_at(search, ON_INTERPOLATION, right, row);
    for (int i = 0; i < 60 && !search->failed; i++) {
        if (f_left >= 0.0 || f_right >= 0.0) {
            *where = f_left >= 0.0 ? left : right;
            return true;
        }
        if (b - a <= 1e-9 * (step->t1 - step->t0))
            return false;
        if (f_left >= f_right) {
            b = right, right = left, f_right = f_left;
            left = b - GOLDEN * (b - a);
            f_left = look_at(search, ON_INTERPOLATION, left, row);
        } else {
            a = left, left = right, f_left = f_right;
            right = a + GOLDEN * (b - a);
            f_right = look_at(search, ON_INTERPOLATION, right, row);
        }
    }
    return false;
}

/* Makes a bracket of the interpolation one of the solver's own step: widens it where the two disagree. */
static bool confirm(Search *search, size_t row, size_t first, double b, Bracket *bracket)
{
    const Step *step = &search->engine->step;
    size_t low = first, high = first + 1;
    double a = sample_time(step, low);
    double fa = look_at(search, ON_STEP, a, row), fb = look_at(search, ON_STEP, b, row);
    while (fa >= 0.0 && low > 0 && !search->failed) {
        b = a, fb = fa;
        a = sample_time(step, --low);
        fa = low == 0 ? sample(search, 0, row) : look_at(search, ON_STEP, a, row);
    }
    while (fb < 0.0 && high < N_SAMPLES && !search->failed) {
        double next = sample_time(step, high++);
        if (next <= b)
            continue;
        a = b, fa = fb, b = next;
        fb = look_at(search, ON_STEP, b, row);
    }
    *bracket = (Bracket){a, fa, b, fb};
    return !search->failed && fa < 0.0 && fb >= 0.0;
}

/* The first crossing of one row that begins before `latest`. */
static bool first_crossing(Search *search, size_t row, double latest, double *t)
{
    const Step *step = &search->engine->step;
    for (size_t i = 0; i + 1 < N_SAMPLES && sample_time(step, i) <= latest && !search->failed; i++) {
        double b = sample_time(step, i + 1);
        bool crossed = sample(search, i, row) < 0.0 && sample(search, i + 1, row) >= 0.0;
        if (!crossed && i + 2 < N_SAMPLES && may_touch_zero(search, i + 1, row))
            crossed = find_touch(search, i + 1, row, &b);
        Bracket bracket;
        if (crossed && confirm(search, row, i, b, &bracket)) {
            polish(search, row, &bracket);
            *t = bracket.b;
            return !search->failed;
        }
    }
    return false;
}

/* The first guard crossing on the step; with flow priority guards are not looked at inside the flow set. */
static bool first_guard(Search *search, double *t)
{
    const Engine *engine = search->engine;
    const Model *m = engine->model;
    double best = INFINITY, found;
    for (size_t row = 0; row < m->n_margins && !m->flow_priority; row++)
        if (engine->is_guard[row] && first_crossing(search, row, best, &found) && found < best)
            best = found;
    *t = best;
    return isfinite(best);
}

/* The time at which the flow set is left, if the step leaves it by more than the tolerance. */
static bool first_exit(Search *search, double *t)
{
    const Step *step = &search->engine->step;
    double beyond = search->level < -EVENT_TOLERANCE ? EVENT_TOLERANCE : EVENT_TOLERANCE + search->level;
    size_t row = search->exit_row, outside = 0;
    while (outside < N_SAMPLES && sample(search, outside, row) <= beyond)
        outside++;
    if (outside == N_SAMPLES)
        return false;
    /* Back to the crossing that leads there; those before it came back inside. */
    while (outside > 0 && sample(search, outside - 1, row) >= 0.0)
        outside--;
    *t = step->t0;
    if (outside == 0)
        return true;
    Bracket bracket;
    if (!confirm(search, row, outside - 1, sample_time(step, outside), &bracket))
        return false;
    polish(search, row, &bracket);
    *t = bracket.b;
    return true;
}

/* The time within the event tolerance after `from` at which guards that are negative there cross, the
   first or the last of them.  `from` itself if there is none. */
static double crossing_soon_after(Search *search, double from, bool want_first)
{
    Engine *engine = search->engine;
    const Model *m = engine->model;
    double until = fmin(from + event_tolerance(from), search->piece_end), chosen = from;
    double *now = engine->samples, *then = engine->samples + search->n_rows;
    if (until <= from || !look(search, ON_STEP, from, now) || !look(search, ON_STEP, until, then))
        return from;
    for (size_t row = 0; row < m->n_margins && !search->failed; row++) {
        if (!engine->is_guard[row] || now[row] >= 0.0 || then[row] < 0.0)
            continue;
        Bracket bracket = {from, now[row], until, then[row]};
        polish(search, row, &bracket);
        if (chosen == from || (want_first ? bracket.b < chosen : bracket.b > chosen))
            chosen = bracket.b;
    }
    return chosen;
}

/* Simultaneous guards share the latest of their times, unless one of them is negative again there. */
static double common_time(Search *search, double first)
{
    Engine *engine = search->engine;
    double latest = crossing_soon_after(search, first, false);
    double *now = engine->samples, *then = engine->samples + search->n_rows;
    if (latest == first || search->failed || !look(search, ON_STEP, first, now) || !look(search, ON_STEP, latest, then))
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
    if (!step_probe(engine, point, t))
        return FLOW_PROBLEM;
    *point->time = t;
    *point->step = 0.0;
    for (size_t i = 0; i < engine->model->n_states; i++)
        point->x[i] = engine->probe_x[i];
    return FLOW_EVENT;
}

/* Leaving the flow set is an event if a guard is crossed with it, and blocks the run otherwise. */
static FlowEnd leave_flow_set(Search *search, double t)
{
    Engine *engine = search->engine;
    const Point *point = search->point;
    double *rows = engine->samples, margin, when = t;
    bool enabled = false;
    if (!look(search, ON_STEP, t, rows))
        return FLOW_PROBLEM;
    for (size_t row = 0; row < engine->model->n_margins; row++)
        enabled = enabled || (engine->is_guard[row] && rows[row] >= 0.0);
    if (!enabled)
        when = crossing_soon_after(search, t, true);
    if (search->failed)
        return FLOW_PROBLEM;
    if (enabled || when > t)
        return move_to(search, common_time(search, when));
    if (move_to(search, t) == FLOW_PROBLEM || !evaluate_flow_set(engine, t, point->x, point->z, &margin))
        return FLOW_PROBLEM;
    blocked(engine, t, point->x, point->z, margin);
    return FLOW_PROBLEM;
}

bool raise_levels(Engine *engine, const Point *point, double t)
{
    const Model *m = engine->model;
    Search search = {.engine = engine, .point = point, .level = 0.0, .piece_end = t,
                     .n_rows = m->n_margins + 1, .exit_row = m->n_margins, .failed = false};
    double *now = engine->samples, *then = engine->samples + search.n_rows;
    if (m->n_margins == 0 || m->flow_priority)
        return true;
    if (!look(&search, ON_STEP, t, now) || !look(&search, ON_STEP, t + event_tolerance(t), then))
        return false;
    for (size_t row = 0; row < m->n_margins; row++)
        if (engine->is_guard[row] && now[row] < 0.0 && then[row] >= 0.0)
            point->level[row] = now[row];
    return true;
}

FlowEnd locate_event(Engine *engine, const Point *point, double level, double piece_end)
{
    const Model *m = engine->model;
    Search search = {.engine = engine, .point = point, .level = level, .piece_end = piece_end,
                     .n_rows = m->n_margins + 1, .exit_row = m->n_margins, .failed = false};
    if (m->n_margins == 0 && !m->has_flow_set)
        return FLOW_REACHED;
    for (size_t i = 0; i < N_SAMPLES; i++) {
        /* The ends of the step are exact, the rest is interpolated. */
        Path path = i + 1 == N_SAMPLES ? ON_STEP : ON_INTERPOLATION;
        if (!look(&search, path, sample_time(&engine->step, i), engine->samples + i * search.n_rows))
            return FLOW_PROBLEM;
    }
    double guard = INFINITY, leaving = INFINITY;
    bool has_guard = first_guard(&search, &guard);
    bool leaves = m->has_flow_set && !search.failed && first_exit(&search, &leaving);
    if (search.failed)
        return FLOW_PROBLEM;
    if (has_guard && (!leaves || guard <= leaving + event_tolerance(leaving))) {
        guard = common_time(&search, guard);
        if (search.failed || (guard + event_tolerance(guard) > piece_end && !raise_levels(engine, point, guard)))
            return FLOW_PROBLEM;
        return move_to(&search, guard);
    }
    return leaves ? leave_flow_set(&search, leaving) : FLOW_REACHED;
}
