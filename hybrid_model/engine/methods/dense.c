/* The interpolation of a step, and a step that is kept to read times within it. */
#include "method.h"

void engine_interpolate_nested(const double *of, size_t n_terms, size_t n, double a, double *x)
{
    (void)n_terms;
    double b = 1.0 - a;
    for (size_t i = 0; i < n; i++) {
        double inner = of[2 * n + i] + a * (of[3 * n + i] + b * of[4 * n + i]);
        x[i] = of[i] + a * (of[n + i] + b * inner);
    }
}

void engine_straight_nested(const double *x0, const double *x1, size_t n, double *of)
{
    for (size_t i = 0; i < n; i++) {
        of[i] = x0[i];
        of[n + i] = x1[i] - x0[i];
        of[2 * n + i] = of[3 * n + i] = of[4 * n + i] = 0.0;
    }
}

const double *engine_step_vectors(Engine *engine)
{
    if (!engine->step.has_vectors)
        engine->method->prepare(engine);
    engine->step.has_vectors = true;
    return engine->step.vectors;
}

void engine_step_dense(Engine *engine, double t)
{
    const Step *step = &engine->step;
    double a = (t - step->t0) / (step->t1 - step->t0);
    const double *vectors = engine_step_vectors(engine);
    engine->method->interpolate(vectors, step->n_terms, engine->model->n_states, a, engine->dense_x);
}

void engine_segment_keep(Engine *engine)
{
    Status *status = engine->status;
    engine_copy(engine->segment, engine_step_vectors(engine), engine->method->n_vectors * engine->model->n_states);
    status->segment_terms = engine->step.n_terms;
    status->segment_begin = engine->step.t0;
    status->segment_end = engine->step.t1;
    status->has_segment = true;
}
