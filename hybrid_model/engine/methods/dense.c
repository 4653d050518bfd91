/* The interpolation of a step, and a step that is kept to read times within it. */
#include "method.h"

void engine_interpolate_nested(const double *of, size_t n_terms, size_t n, double a, double *x)
{
    double b = 1.0 - a;
    for (size_t i = 0; i < n; i++) {
        double inner = 0.0;
        for (size_t k = n_terms; k-- > 1;)
            inner = (k % 2 == 1 ? a : b) * (of[k * n + i] + inner);
        x[i] = of[i] + inner;
    }
}

void engine_straight_nested(const double *x0, const double *x1, size_t n, double *of)
{
    for (size_t i = 0; i < n; i++) {
        of[i] = x0[i];
        of[n + i] = x1[i] - x0[i];
        for (size_t k = 2; k < NESTED_VECTORS; k++)
            of[k * n + i] = 0.0;
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
    double a = (t - step->begin) / (step->end - step->begin);
    const double *vectors = engine_step_vectors(engine);
    engine->method->interpolate(vectors, step->n_terms, engine->model->n_states, a, engine->dense_x);
}

void engine_segment_keep(Engine *engine)
{
    Status *status = engine->status;
    engine_copy(engine->segment, engine_step_vectors(engine), engine->method->n_vectors * engine->model->n_states);
    status->segment_terms = engine->step.n_terms;
    status->segment_begin = engine->step.begin;
    status->segment_span = engine->step.end - engine->step.begin;
    status->segment_end = engine->step.t1;
    status->has_segment = true;
}
