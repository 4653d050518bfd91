/* The interpolation of a step, and a step that is kept to read times within it.  After E. Hairer, S. P. Norsett,
   G. Wanner, "Solving Ordinary Differential Equations I", section II.6. */
#include "parts.h"

static const double DENSE_WEIGHT[N_STAGES] = {-12715105075.0 / 11282082432.0,  0.0,
                                              87487479700.0 / 32700410799.0,   -10690763975.0 / 1880347072.0,
                                              701980252875.0 / 199316789632.0, -1453857185.0 / 822651844.0,
                                              69997945.0 / 29380423.0};

static void prepare_dense(Engine *engine)
{
    Step *step = &engine->step;
    double h = step->t1 - step->t0;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double change = step->x1[i] - step->x0[i], sum = 0.0;
        for (size_t s = 0; s < N_STAGES; s++)
            sum += DENSE_WEIGHT[s] * step->k[s][i];
        step->dense[0][i] = h * step->k[0][i] - change;
        step->dense[1][i] = change - h * step->k[N_STAGES - 1][i] - step->dense[0][i];
        step->dense[2][i] = h * sum;
    }
    step->has_dense = true;
}

void engine_step_dense(Engine *engine, double t)
{
    Step *step = &engine->step;
    if (!step->has_dense)
        prepare_dense(engine);
    double a = (t - step->t0) / (step->t1 - step->t0), b = 1.0 - a;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double inner = step->dense[0][i] + a * (step->dense[1][i] + b * step->dense[2][i]);
        engine->dense_x[i] = step->x0[i] + a * (step->x1[i] - step->x0[i] + b * inner);
    }
}

void engine_segment_keep(Engine *engine)
{
    Step *step = &engine->step;
    Status *status = engine->status;
    size_t n = engine->model->n_states;
    if (!step->has_dense)
        prepare_dense(engine);
    engine_copy(engine->segment[0], step->x0, n);
    for (size_t i = 0; i < n; i++)
        engine->segment[1][i] = step->x1[i] - step->x0[i];
    for (size_t k = 0; k < 3; k++)
        engine_copy(engine->segment[2 + k], step->dense[k], n);
    status->segment_begin = step->t0;
    status->segment_end = step->t1;
    status->has_segment = true;
}

void engine_segment_read(Engine *engine, double t)
{
    const Status *status = engine->status;
    double *const *of = engine->segment;
    double a = (t - status->segment_begin) / (status->segment_end - status->segment_begin), b = 1.0 - a;
    *engine->live.time = t;
    for (size_t i = 0; i < engine->model->n_states; i++)
        engine->live.x[i] = of[0][i] + a * (of[1][i] + b * (of[2][i] + a * (of[3][i] + b * of[4][i])));
    engine_note_sizes(engine, &engine->live);
}
