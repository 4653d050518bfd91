/* The first time in a window of a step at which a guard is crossed, or the flow set left.

   The interpolation of the step is searched for brackets (rises.c).  The time is then polished on the
   solver's own step from t0, so that time and state belong together; it is the end of the bracket at
   which the margin is >= 0.  The flow set's margin is treated as one more guard, which is crossed on
   leaving. */
#include <math.h>

#include "method.h"
#include "search.h"

/* First move of a bracket's end where the interpolation and the step disagree, as a part of the step. */
#define FIRST_STRIDE 1e-11

/* By Chandrupatla's method: inverse quadratic interpolation where it is safe, bisection elsewhere.
   (T. R. Chandrupatla, Advances in Engineering Software 28, 1997.) */
void engine_refine_bracket(Search *search, Path path, double wide, size_t row, Bracket *bracket)
{
    double a = bracket->a, fa = bracket->value_a, b = bracket->b, fb = bracket->value_b, fraction = fa / (fa - fb);
    for (int i = 0; i < 200 && fb != 0.0 && !search->failed; i++) {
        /* Zero may lie between: the floats at the nearer end do not decide alone. */
        double width = engine_larger(2.0 * engine_larger(engine_time_ulp(a), engine_time_ulp(b)), wide);
        if (b - a <= width)
            break;
        double least = 0.5 * width / (b - a);
        double t = a + engine_smaller(engine_larger(fraction, least), 1.0 - least) * (b - a);
        if (!(t > a && t < b))
            break;
        double f = engine_look_at(search, path, t, row);
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
        fraction = f >= 0.0 ? 1.0 - part : part;
        if (!isfinite(fraction) || fraction <= 0.0 || fraction >= 1.0)
            fraction = 0.5;
    }
    *bracket = (Bracket){a, fa, b, fb};
}

/* Makes a bracket of the interpolation one of the solver's own step.  Where the two disagree on the
   sign at an end, the end goes outward until they agree; they do at the ends of the step.  False if the
   step has no rise there. */
static bool confirm(Search *search, size_t row, Bracket *bracket)
{
    const Step *step = &search->engine->step;
    double a = bracket->a, b = bracket->b;
    double stride = fmax(FIRST_STRIDE * (step->t1 - step->t0), 4.0 * engine_time_ulp(b));
    double fa = engine_look_at(search, ON_STEP, a, row), fb = engine_look_at(search, ON_STEP, b, row);
    for (; fa >= 0.0 && !search->failed; stride *= 2.0) {
        b = a, fb = fa;
        a = fmax(a - stride, step->t0);
        fa = engine_look_at(search, ON_STEP, a, row);
        if (fa >= 0.0 && engine_look_at(search, ON_INTERPOLATION, a, row) >= 0.0)
            return false;
    }
    for (; fb < 0.0 && !search->failed; stride *= 2.0) {
        a = b, fa = fb;
        b = fmin(b + stride, step->t1);
        fb = engine_look_at(search, ON_STEP, b, row);
        if (fb < 0.0 && engine_look_at(search, ON_INTERPOLATION, b, row) < 0.0)
            return false;
    }
    *bracket = (Bracket){a, fa, b, fb};
    return !search->failed;
}

/* Shrinks a bracket of the interpolation to the width at which a crossing is located on the solver's own step, where
   each look costs a step: by far the most of them are spared.  False if the step has no rise there. */
static bool locate_on_step(Search *search, size_t row, Bracket *bracket)
{
    const Step *step = &search->engine->step;
    if (!search->engine->method->is_exact) {
        engine_refine_bracket(search, ON_INTERPOLATION, FIRST_STRIDE * (step->t1 - step->t0), row, bracket);
        if (search->failed || !confirm(search, row, bracket))
            return false;
    }
    engine_refine_bracket(search, ON_STEP, 0.0, row, bracket);
    return !search->failed;
}

/* The first crossing of one row that begins before `latest`. */
static bool first_crossing(Search *search, size_t row, double latest, double *t)
{
    Rises rises;
    Bracket bracket;
    engine_begin_rises(&rises, search, row, 0.0);
    while (engine_next_rise(&rises, latest, &bracket))
        if (locate_on_step(search, row, &bracket)) {
            *t = bracket.b;
            return true;
        }
    return false;
}

bool engine_first_guard(Search *search, double *t)
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
    bool found = locate_on_step(search, search->exit_row, &bracket);
    search->level += beyond;
    *t = bracket.b;
    return found;
}

double engine_last_inside(Search *search, double t)
{
    Rises rises;
    Bracket next, bracket = {.b = -INFINITY};
    engine_begin_rises_of_step(&rises, search, search->exit_row, 0.0);
    while (engine_next_rise(&rises, t, &next) && next.a < t)
        bracket = next;
    if (search->failed || !isfinite(bracket.b))
        return -INFINITY;
    return locate_on_step(search, search->exit_row, &bracket) ? bracket.b : (double)NAN;
}

/* Whether the rise in the bracket comes after `latest`. */
static bool rises_later(Search *search, const Bracket *bracket, double latest)
{
    return bracket->a >= latest ||
           (bracket->b > latest && engine_look_at(search, ON_STEP, latest, search->exit_row) < 0.0);
}

bool engine_first_exit(Search *search, double latest, double *t)
{
    const Step *step = &search->engine->step;
    Rises rises;
    Bracket far;
    engine_begin_rises(&rises, search, search->exit_row, 0.0);
    if (engine_sample(search, 0, search->exit_row) <= 0.0 &&
        (!engine_next_rise(&rises, latest, &far) || rises_later(search, &far, latest)))
        return false;
    double border = engine_flow_border(search->engine, search->point, step->t1, step->x1);
    double beyond = search->level < -border ? border : border + search->level;
    *t = search->begin;
    if (engine_sample(search, 0, search->exit_row) > beyond)
        return true;
    engine_begin_rises(&rises, search, search->exit_row, beyond);
    if (!engine_next_rise(&rises, INFINITY, &far))
        return false;
    if (!search->engine->model->flow_priority)
        return exit_beyond(search, beyond, far, t);
    /* Back to the crossing that leads there; those before it came back inside. */
    double crossing = engine_last_inside(search, far.b);
    *t = isfinite(crossing) ? crossing : step->t0;
    return !search->failed && !isnan(crossing);
}
