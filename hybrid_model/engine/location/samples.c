/* Margins along the present step: on the interpolation, or on the solver's own step from its start. */
#include <float.h>
#include <math.h>

#include "method.h"
#include "search.h"

static bool not_finite(Engine *engine, double t, size_t i)
{
    const Model *m = engine->model;
    return engine_fail(engine, ENDED_NOT_FINITE,
                       "'%s' does not stay finite up to t = %.17g. Remedy: check its derivative for 0/0 or the root "
                       "of a negative number; trial steps look a little outside the flow set.",
                       NAME_AT(m->names, m->state_names[i]), t);
}

/* Where a state is no number, that is the flow map's fault and not a margin's. */
static inline bool states_are_finite(Engine *engine, double t, const double *x)
{
    for (size_t i = 0; i < engine->model->n_states; i++)
        if (!isfinite(x[i]))
            return not_finite(engine, t, i);
    return true;
}

/* The states at a time of the step; NULL, and the search has failed, if they cannot be had. */
static const double *states_at(Search *search, Path path, double t)
{
    Engine *engine = search->engine;
    const Step *step = &engine->step;
    const double *x = path == ON_STEP ? engine->probe_x : engine->dense_x;
    /* Both paths begin and end where the step does. */
    if (t == step->t0 || t == step->t1)
        x = t == step->t0 ? step->x0 : step->x1;
    else if (path == ON_INTERPOLATION)
        engine_step_dense(engine, t);
    else if (!engine_step_probe(engine, search->point, t))
        x = NULL;
    if (x && states_are_finite(engine, t, x))
        return x;
    search->failed = true;
    return NULL;
}

/* By how much the state is outside the flow set. */
static bool look_outside(Search *search, double t, const double *x, double *outside)
{
    double margin;
    if (!engine_evaluate_flow_set(search->engine, t, x, search->point->z, &margin))
        return !(search->failed = true);
    *outside = search->level - margin;
    /* Zero is inside the flow set, so it is not yet an exit. */
    if (*outside == 0.0)
        *outside = -DBL_MIN;
    return true;
}

bool engine_look(Search *search, Path path, double t, double *rows)
{
    Engine *engine = search->engine;
    const double *x = states_at(search, path, t);
    if (!x)
        return false;
    if (!engine_evaluate_margins(engine, t, x, search->point->z))
        return !(search->failed = true);
    engine_copy(rows, engine->margins, engine->model->n_margins);
    return !engine->model->has_flow_set || look_outside(search, t, x, &rows[search->exit_row]);
}

/* The states at all samples of a window at once. */
static void states_at_samples(Engine *engine, const double *times, double *states)
{
    const Step *step = &engine->step;
    size_t n = engine->model->n_states;
    const double *vectors = engine_step_vectors(engine);
    double parts[N_SAMPLES], span = step->end - step->begin;
    for (size_t i = 0; i < N_SAMPLES; i++)
        parts[i] = (times[i] - step->begin) / span;
    engine->method->interpolate_samples(vectors, step->n_terms, n, parts + 1, states + n);
    if (times[0] == step->t0)
        engine_copy(states, step->x0, n);
    else
        engine->method->interpolate(vectors, step->n_terms, n, parts[0], states);
    if (times[N_SAMPLES - 1] == step->t1)
        engine_copy(states + (N_SAMPLES - 1) * n, step->x1, n);
}

/* False where a margin cannot be evaluated, or is not a number. */
static bool margins_at(Engine *engine, const double *t, const double *x, const double *z, double *margins)
{
    const Model *m = engine->model;
    engine_bind(engine, t, x, z, margins, NULL);
    if (m->n_margins > 0 && m->margins(engine->arg, engine->res, engine->iw, engine->w, 0) != 0)
        return false;
    for (size_t i = 0; i < m->n_margins; i++)
        if (isnan(margins[i]))
            return false;
    return true;
}

bool engine_look_at_samples(Search *search, const double *times, double *rows)
{
    Engine *engine = search->engine;
    const Model *m = engine->model;
    double *states = engine->sampled_x;
    if (engine->method->interpolate_samples)
        states_at_samples(engine, times, states);
    for (size_t i = 0; i < N_SAMPLES; i++, rows += search->n_rows, states += m->n_states) {
        if (!engine->method->interpolate_samples || m->has_flow_set) {
            if (!engine_look(search, ON_INTERPOLATION, times[i], rows))
                return false;
            continue;
        }
        if (!states_are_finite(engine, times[i], states) ||
            (!margins_at(engine, &times[i], states, search->point->z, rows) &&
             !engine_evaluate_margins(engine, times[i], states, search->point->z)))
            return !(search->failed = true);
    }
    return true;
}

bool engine_try_to_look(Search *search, Path path, double t, double *rows)
{
    bool seen = engine_look(search, path, t, rows);
    search->failed = false;
    return seen;
}

double engine_look_at(Search *search, Path path, double t, size_t row)
{
    Engine *engine = search->engine;
    double outside = 0.0;
    const double *x = states_at(search, path, t);
    if (!x)
        return 0.0;
    if (row == search->exit_row)
        return look_outside(search, t, x, &outside) ? outside : 0.0;
    if (engine_evaluate_margins(engine, t, x, search->point->z))
        return engine->margins[row];
    search->failed = true;
    return 0.0;
}
