/* The first time in a step at which a guard is crossed, or the flow set left.

   The interpolation of the step is searched for brackets (rises.c).  The time is then polished on the
   solver's own step from t0, so that time and state belong together; it is the end of the bracket at
   which the margin is >= 0.  The flow set's margin is treated as one more guard, which is crossed on
   leaving. */
#include <float.h>
#include <math.h>

#include "search.h"

/* First move of a bracket's end where the interpolation and the step disagree, as a part of the step. */
#define FIRST_STRIDE 1e-11

/* Where a state is no number, that is the flow map's fault and not a margin's. */
static bool states_are_finite(Engine *engine, double t, const double *x)
{
    const Model *m = engine->model;
    for (size_t i = 0; i < m->n_states; i++)
        if (!isfinite(x[i]))
            return problem(engine, ENDED_NOT_FINITE,
                           "'%s' does not stay finite up to t = %.17g. Remedy: check its derivative for 0/0 or the root "
                           "of a negative number; trial steps look a little outside the flow set.",
                           NAME_AT(m->names, m->state_names[i]), t);
    return true;
}

bool look(Search *search, Path path, double t, double *rows)
{
    Engine *engine = search->engine;
    const Model *m = engine->model;
    const Step *step = &engine->step;
    const double *x = path == ON_STEP ? engine->probe_x : engine->dense_x;
    /* Both paths begin and end where the step does. */
    if (t == step->t0 || t == step->t1)
        x = t == step->t0 ? step->x0 : step->x1;
    else if (path == ON_INTERPOLATION)
        step_dense(engine, t);
    else if (!step_probe(engine, search->point, t))
        return !(search->failed = true);
    if (!states_are_finite(engine, t, x) || !evaluate_margins(engine, t, x, search->point->z))
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

bool try_to_look(Search *search, Path path, double t, double *rows)
{
    bool seen = look(search, path, t, rows);
    search->failed = false;
    return seen;
}

double look_at(Search *search, Path path, double t, size_t row)
{
    double *rows = search->engine->samples + N_SAMPLES * search->n_rows;
    return look(search, path, t, rows) ? rows[row] : 0.0;
}

/* By Chandrupatla's method: inverse quadratic interpolation where it is safe, bisection elsewhere.
   (T. R. Chandrupatla, Advances in Engineering Software 28, 1997.) */
void polish(Search *search, size_t row, Bracket *bracket)
{
    double a = bracket->a, fa = bracket->value_a, b = bracket->b, fb = bracket->value_b, fraction = 0.5;
    for (int i = 0; i < 200 && fb != 0.0 && !search->failed; i++) {
        /* Zero may lie between: the floats at the nearer end do not decide alone. */
        double width = 2.0 * fmax(time_ulp(a), time_ulp(b));
        if (b - a <= width)
            break;
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

double sample(const Search *search, size_t i, size_t row)
{
    return search->engine->samples[i * search->n_rows + row];
}

/* Makes a bracket of the interpolation one of the solver's own step.  Where the two disagree on the
   sign at an end, the end goes outward until they agree; they do at the ends of the step.  False if the
   step has no rise there. */
static bool confirm(Search *search, size_t row, Bracket *bracket)
{
    const Step *step = &search->engine->step;
    double a = bracket->a, b = bracket->b, stride = fmax(FIRST_STRIDE * (step->t1 - step->t0), 4.0 * time_ulp(b));
    double fa = look_at(search, ON_STEP, a, row), fb = look_at(search, ON_STEP, b, row);
    for (; fa >= 0.0 && !search->failed; stride *= 2.0) {
        b = a, fb = fa;
        a = fmax(a - stride, step->t0);
        fa = look_at(search, ON_STEP, a, row);
        if (fa >= 0.0 && look_at(search, ON_INTERPOLATION, a, row) >= 0.0)
            return false;
    }
    for (; fb < 0.0 && !search->failed; stride *= 2.0) {
        a = b, fa = fb;
        b = fmin(b + stride, step->t1);
        fb = look_at(search, ON_STEP, b, row);
        if (fb < 0.0 && look_at(search, ON_INTERPOLATION, b, row) < 0.0)
            return false;
    }
    *bracket = (Bracket){a, fa, b, fb};
    return !search->failed;
}

/* The first crossing of one row that begins before `latest`. */
static bool first_crossing(Search *search, size_t row, double latest, double *t)
{
    Rises rises;
    Bracket bracket;
    begin_rises(&rises, search, row, 0.0);
    while (next_rise(&rises, latest, &bracket))
        if (confirm(search, row, &bracket)) {
            polish(search, row, &bracket);
            *t = bracket.b;
            return !search->failed;
        }
    return false;
}

bool first_guard(Search *search, double *t)
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

/* The state is outside when it is so by more than the tolerance: rounding may keep it a little outside
   for as long as it likes. */
static bool exit_beyond(Search *search, double beyond, Bracket bracket, double *t)
{
    search->level -= beyond;
    bool found = confirm(search, search->exit_row, &bracket);
    if (found)
        polish(search, search->exit_row, &bracket);
    search->level += beyond;
    *t = bracket.b;
    return found && !search->failed;
}

double last_inside(Search *search, double t)
{
    Rises rises;
    Bracket next, bracket = {.b = -INFINITY};
    begin_rises(&rises, search, search->exit_row, 0.0);
    while (next_rise(&rises, t, &next) && next.a < t)
        bracket = next;
    if (search->failed || !isfinite(bracket.b))
        return -INFINITY;
    if (!confirm(search, search->exit_row, &bracket))
        return (double)NAN;
    polish(search, search->exit_row, &bracket);
    return bracket.b;
}

bool first_exit(Search *search, double *t)
{
    const Step *step = &search->engine->step;
    Rises rises;
    Bracket far;
    begin_rises(&rises, search, search->exit_row, 0.0);
    if (sample(search, 0, search->exit_row) <= 0.0 && !next_rise(&rises, INFINITY, &far))
        return false;
    double border = flow_border(search->engine, search->point, step->t1, step->x1);
    double beyond = search->level < -border ? border : border + search->level;
    *t = step->t0;
    if (sample(search, 0, search->exit_row) > beyond)
        return true;
    begin_rises(&rises, search, search->exit_row, beyond);
    if (!next_rise(&rises, INFINITY, &far))
        return false;
    if (!search->engine->model->flow_priority)
        return exit_beyond(search, beyond, far, t);
    /* Back to the crossing that leads there; those before it came back inside. */
    double crossing = last_inside(search, far.b);
    *t = isfinite(crossing) ? crossing : step->t0;
    return !search->failed && !isnan(crossing);
}
