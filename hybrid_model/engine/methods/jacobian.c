/* The derivatives of the flow with respect to states and time, which methods for stiff flows need. */
#include <math.h>
#include <string.h>

#include "method.h"

/* A column: the derivative along the direction of one state, or of time where there is none. */
static bool column(Engine *engine, const Point *point, const double *time_seed, const double *state_seed,
                   double *result)
{
    const Model *m = engine->model;
    const double *zeros = engine->seeds[1];
    const double *const given[] = {time_seed, state_seed, zeros, zeros, zeros};
    engine_bind(engine, point->time, point->x, point->z, result, NULL);
    memcpy(engine->arg + MODEL_N_ARG, given, sizeof given);
    return m->forward(engine->arg, engine->res, engine->iw, engine->w, 0) == 0;
}

/* The same matrix by derivatives along each direction, which FMUs of all models have. */
static bool columns(Engine *engine, const Point *point, Implicit *of)
{
    size_t n = engine->model->n_states;
    double one = 1.0, *zeros = engine->seeds[1], *direction = of->matrix;
    memset(zeros, 0, engine_seed_count(engine->model) * sizeof(double));
    memset(direction, 0, n * sizeof(double));
    for (size_t i = 0; i < n; i++) {
        direction[i] = 1.0;
        if (!column(engine, point, zeros, direction, of->jacobian + i * n))
            return false;
        direction[i] = 0.0;
    }
    return column(engine, point, &one, zeros, of->drift);
}

/* The root of max(h, 0) has no derivative that the chain rule finds at h = 0.  Any number will do for one point: the
   error that the method estimates sees what is missing. */
static void clear_undefined(double *values, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(values[i]))
            values[i] = 0.0;
}

bool engine_jacobian(Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    Implicit *of = &engine->implicit;
    size_t n = m->n_states;
    if (of->has_jacobian)
        return true;
    engine->statistics.jacobians++;
    bool found = m->jacobian ? engine_evaluate(engine, m->jacobian, *point->time, point->x, point->z, of->jacobian,
                                               of->drift)
                             : columns(engine, point, of);
    if (!found)
        return engine_fail(engine, ENDED_FAILED,
                           "The Jacobian of the flow of '%s' could not be evaluated at t = %.17g.", m->name,
                           *point->time);
    clear_undefined(of->jacobian, n * n);
    clear_undefined(of->drift, n);
    of->has_jacobian = true;
    of->factorized_for = 0.0;
    return true;
}
