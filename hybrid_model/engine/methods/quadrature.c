/* Flows whose rates depend on no state, or only on states that are quadratures themselves: integrals of polynomials
   through the rates at Chebyshev nodes, exact up to rounding.

   Rates that depend on no state give the states of the first level; with those known, the rates of the second level are
   functions of time, and so on (model->quadratures levels: h' = v, v' = -g has two).  Each level costs the rates at the
   nodes.  A step is as long as the coefficients of the rates fall to the tolerance on it. */
#include <math.h>

#include "chebyshev.h"
#include "method.h"

/* The grids that are tried, coarse to fine, by their strides among the finest nodes. */
#define COARSE 2
#define FINE 1
/* An error on the coarse grid (in units of the tolerance) from which on the finer one is no hope: coefficients fall
   like a geometric sequence or faster, so what the finer one leaves is about the square of that. */
#define HOPELESS 1e9

/* The time of a node of the step from t0 to t1. */
static double node_time(double t0, double t1, size_t j)
{
    return j == FINEST ? t1 : t0 + engine_node(j) * (t1 - t0);
}

/* Makes the series of the states from t0 to t1; the rates of the first level are there at the first node, and at
   every `known`th one. */
static bool make_series(Engine *engine, const double *z, const double *x0, double t0, double t1, size_t stride,
                        size_t known, double *series, size_t *n_terms)
{
    const Quadrature *q = &engine->quadrature;
    size_t n = engine->model->n_states, levels = engine->model->quadratures;
    for (size_t level = 1; level <= levels; level++) {
        for (size_t j = stride; j <= FINEST; j += stride)
            if ((level > 1 || j % known != 0) &&
                !engine_rates(engine, node_time(t0, t1, j), level > 1 ? q->states + j * n : x0, z, q->rates + j * n))
                return false;
        *n_terms = engine_integrate_series(n, stride, t1 - t0, x0, q->rates, series, q->tails);
        if (level < levels)
            engine_series_at_nodes(series, *n_terms, n, stride, q->states);
    }
    return true;
}

/* The error of the series in units of the tolerance, infinite where anything is not finite. */
static double series_error(Engine *engine, const Point *point)
{
    const Step *step = &engine->step;
    const double *tails = engine->quadrature.tails;
    double worst = 0.0;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double error = tails[i] / engine_error_scale(engine, point, i, fmax(fabs(step->x0[i]), fabs(step->x1[i])));
        if (!isfinite(error) || !isfinite(step->x1[i])) {
            engine->suspect = i;
            return INFINITY;
        }
        if (error > worst) {
            worst = error;
            engine->suspect = i;
        }
    }
    return worst;
}

static bool trial(Engine *engine, const Point *point, double *error)
{
    const Quadrature *q = &engine->quadrature;
    Step *step = &engine->step;
    size_t n = engine->model->n_states;
    engine_copy(q->rates, step->k[0], n);
    for (size_t stride = COARSE, known = FINEST + 1;; known = stride, stride /= 2) {
        if (!make_series(engine, point->z, step->x0, step->t0, step->t1, stride, known, step->vectors,
                         &step->n_terms))
            return false;
        engine_series_at_end(step->vectors, step->n_terms, n, step->x0, step->x1);
        engine->largest = engine_largest_state(engine, point, step->x1);
        *error = series_error(engine, point);
        step->n_windows = COARSE / stride;
        if (stride == FINE)
            break;
        bool done = *error <= 1.0 || *error > HOPELESS;
        if (done) {
            *error *= *error * engine->options.relative_tolerance;
            break;
        }
    }
    engine_copy(step->k[N_STAGES - 1], q->rates + FINEST * n, n);
    return true;
}

/* Outside the step, or before there is one, a coarse series goes there from the nearer end. */
static bool probe(Engine *engine, const Point *point, double t)
{
    const Step *step = &engine->step;
    const Quadrature *q = &engine->quadrature;
    size_t n = engine->model->n_states;
    if (t >= step->t0 && t <= step->t1 && step->t0 < step->t1) {
        double part = (t - step->begin) / (step->end - step->begin);
        engine_series_at(step->vectors, step->n_terms, n, part, engine->probe_x);
        return true;
    }
    size_t n_terms;
    bool after = t > step->t1 && step->t0 < step->t1;
    const double *from = after ? step->x1 : step->x0;
    double start = after ? step->t1 : step->t0;
    if (step->has_rates[after])
        engine_copy(q->rates, step->k[after ? N_STAGES - 1 : 0], n);
    else if (!engine_rates(engine, start, from, point->z, q->rates))
        return false;
    if (!make_series(engine, point->z, from, start, t, COARSE, FINEST + 1, q->series, &n_terms))
        return false;
    engine_series_at_end(q->series, n_terms, n, from, engine->probe_x);
    return true;
}

/* The series of the accepted step are there. */
static void prepare(Engine *engine)
{
    (void)engine;
}

const Method engine_quadrature = {
    .n_vectors = N_SERIES,
    .order = FINEST + 1.0,
    .is_exact = true,
    .remembers = true,
    .segment_part = 1.0,
    .knows = engine_knows_factors,
    .known = engine_step_of_factors,
    .trial = trial,
    .probe = probe,
    .prepare = prepare,
    .interpolate = engine_series_at,
    .interpolate_samples = engine_series_at_samples,
    .straight = engine_straight_series,
};
