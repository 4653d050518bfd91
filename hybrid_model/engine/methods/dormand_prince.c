/* Dormand-Prince 5(4) with its interpolation: the method for flows of which nothing more is known.

   J. R. Dormand, P. J. Prince, "A family of embedded Runge-Kutta formulae", 1980; the interpolation after E. Hairer,
   S. P. Norsett, G. Wanner, "Solving Ordinary Differential Equations I", section II.6. */
#include <math.h>

#include "method.h"

static const double NODE[N_STAGES] = {0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0};
/* The last row is also the step itself. */
static const double TABLE[N_STAGES][N_STAGES - 1] = {
    {0.0, 0.0, 0.0, 0.0, 0.0, 0.0},
    {0.2, 0.0, 0.0, 0.0, 0.0, 0.0},
    {3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0},
    {44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0},
    {19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0},
    {9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0},
    {35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0},
};
static const double ERROR_WEIGHT[N_STAGES] = {71.0 / 57600.0,      0.0,          -71.0 / 16695.0, 71.0 / 1920.0,
                                              -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0};

/* result = x0 + h * (sum of the first `n` stages with the weights). */
static void combine(size_t n_states, const double *x0, double h, const double *weights, double *const *k, size_t n,
                    double *result)
{
    for (size_t i = 0; i < n_states; i++) {
        double sum = 0.0;
        for (size_t j = 0; j < n; j++)
            sum += weights[j] * k[j][i];
        result[i] = x0[i] + h * sum;
    }
}

/* Stages 1 to 5 and the end of a step of h = t1 - t0; stage 0 must be there. */
static bool stages(Engine *engine, const double *z, double t0, double t1, const double *x0, double *const *k,
                   double *x1)
{
    size_t n_states = engine->model->n_states;
    double h = t1 - t0;
    for (size_t s = 1; s < N_STAGES - 1; s++) {
        combine(n_states, x0, h, TABLE[s], k, s, x1);
        double t = s == N_STAGES - 2 ? t1 : t0 + NODE[s] * h;
        if (!engine_rates(engine, t, x1, z, k[s]))
            return false;
    }
    combine(n_states, x0, h, TABLE[N_STAGES - 1], k, N_STAGES - 1, x1);
    return true;
}

/* The error of the step in units of the tolerance, infinite if anything is not finite. */
static double step_error(Engine *engine, const Point *point, double h)
{
    const Step *step = &engine->step;
    double worst = 0.0;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double sum = 0.0;
        for (size_t s = 0; s < N_STAGES; s++)
            sum += ERROR_WEIGHT[s] * step->k[s][i];
        double error = fabs(h * sum) / engine_error_scale(engine, point, i, fmax(fabs(step->x0[i]), fabs(step->x1[i])));
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

static const double DENSE_WEIGHT[N_STAGES] = {-12715105075.0 / 11282082432.0,  0.0,
                                              87487479700.0 / 32700410799.0,   -10690763975.0 / 1880347072.0,
                                              701980252875.0 / 199316789632.0, -1453857185.0 / 822651844.0,
                                              69997945.0 / 29380423.0};


static bool trial(Engine *engine, const Point *point, double *error)
{
    Step *step = &engine->step;
    if (!stages(engine, point->z, step->t0, step->t1, step->x0, step->k, step->x1) ||
        !engine_rates(engine, step->t1, step->x1, point->z, step->k[N_STAGES - 1]))
        return false;
    engine->largest = engine_largest_state(engine, point, step->x1);
    *error = step_error(engine, point, step->t1 - step->t0);
    return true;
}

static bool probe(Engine *engine, const Point *point, double t)
{
    engine->probe_k[0] = engine->step.k[0];
    return stages(engine, point->z, engine->step.t0, t, engine->step.x0, engine->probe_k, engine->probe_x);
}

/* The vectors are the state at the start, its change, and three of its curvature. */
static void prepare(Engine *engine)
{
    const Step *step = &engine->step;
    size_t n = engine->model->n_states;
    double h = step->t1 - step->t0, *of = step->vectors;
    for (size_t i = 0; i < n; i++) {
        double change = step->x1[i] - step->x0[i], sum = 0.0;
        for (size_t s = 0; s < N_STAGES; s++)
            sum += DENSE_WEIGHT[s] * step->k[s][i];
        of[i] = step->x0[i];
        of[n + i] = change;
        of[2 * n + i] = h * step->k[0][i] - change;
        of[3 * n + i] = change - h * step->k[N_STAGES - 1][i] - of[2 * n + i];
        of[4 * n + i] = h * sum;
    }
}

/* |h lambda| for the eigenvalue of the Jacobian that shows in the last two stages, both of which are at the end of the
   step: E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", section IV.2. */
static double stiffness(const Engine *engine, const Point *point)
{
    const Step *step = &engine->step;
    double rates = 0.0, states = 0.0;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double between = 0.0, size = fmax(fabs(step->x0[i]), fabs(step->x1[i]));
        for (size_t s = 0; s < N_STAGES - 1; s++)
            between += (TABLE[N_STAGES - 1][s] - TABLE[N_STAGES - 2][s]) * step->k[s][i];
        double scale = engine_error_scale(engine, point, i, size);
        double change = (step->k[N_STAGES - 1][i] - step->k[N_STAGES - 2][i]) / scale;
        rates += change * change;
        states += between / scale * (between / scale);
    }
    return states > 0.0 ? sqrt(rates / states) : 0.0;
}

const Method engine_dormand_prince = {
    .n_vectors = NESTED_VECTORS,
    .order = 5.0,
    .segment_part = NESTED_SEGMENT_PART,
    .trial = trial,
    .probe = probe,
    .prepare = prepare,
    .interpolate = engine_interpolate_nested,
    .straight = engine_straight_nested,
    .stiffness = stiffness,
};
