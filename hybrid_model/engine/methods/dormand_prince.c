/* Dormand-Prince 8(5, 3) with its interpolation of order 7: the method for flows of which nothing more is known.

   P. J. Prince, J. R. Dormand, "High order embedded Runge-Kutta formulae", 1981; the error estimate and the
   interpolation after E. Hairer, S. P. Norsett, G. Wanner, "Solving Ordinary Differential Equations I", sections II.5
   and II.6 ("DOP853").  At the tolerances of the engine its steps are some ten times as long as those of order 5. */
#include "dormand_prince.h"

#include <math.h>

#include "method.h"

/* Steps are few and long, so their errors add up and do not cancel as those of many do: they are taken for so many
   times as large, which makes steps a fifth shorter. */
#define STRICTER 4.0

/* Where in step->k the rates of a stage are: those at the end come last, as with all methods. */
static size_t place(size_t stage)
{
    return stage < END ? stage : stage == END ? N_STAGES - 1 : stage - 1;
}

/* The weighted sum of the first `n` stages, for state i. */
static double weigh(double *const *k, const double *weights, size_t n, size_t i)
{
    double sum = 0.0;
    for (size_t s = 0; s < n; s++)
        if (weights[s] != 0.0)
            sum += weights[s] * k[place(s)][i];
    return sum;
}

/* The argument of a stage, or with END the end of the step. */
static void go_to_stage(const Engine *engine, double h, size_t stage, double *const *k, double *x)
{
    for (size_t i = 0; i < engine->model->n_states; i++)
        x[i] = engine->step.x0[i] + h * weigh(k, TABLE[stage], stage, i);
}

/* Stages 1 up to the end of a step from the start of the present one to t1, but for the rates there; stage 0 must be
   there. */
static bool stages(Engine *engine, const double *z, double t1, double *const *k, double *x)
{
    double t0 = engine->step.t0, h = t1 - t0;
    for (size_t s = 1; s < END; s++) {
        go_to_stage(engine, h, s, k, x);
        if (!engine_rates(engine, NODE[s] == 1.0 ? t1 : t0 + NODE[s] * h, x, z, k[s]))
            return false;
    }
    go_to_stage(engine, h, END, k, x);
    return true;
}

/* The error of the step in units of the tolerance, infinite if anything is not finite: the difference to the solution
   of order 5, made smaller where that to the one of order 3 shows by how much orders differ. */
static double step_error(Engine *engine, const Point *point, double h)
{
    const Step *step = &engine->step;
    double fifth = 0.0, third = 0.0;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double scale = engine_error_scale(engine, point, i, fmax(fabs(step->x0[i]), fabs(step->x1[i])));
        double error = fabs(h * weigh(step->k, FIFTH, STEP_STAGES, i)) / scale;
        if (!isfinite(error) || !isfinite(step->x1[i])) {
            engine->suspect = i;
            return INFINITY;
        }
        if (error > fifth) {
            fifth = error;
            engine->suspect = i;
        }
        third = fmax(third, fabs(h * weigh(step->k, THIRD, STEP_STAGES, i)) / scale);
    }
    double ratio = fifth > 0.0 ? 0.1 * third / fifth : 0.0;
    return STRICTER * fifth / sqrt(1.0 + ratio * ratio);
}

/* The stages that the interpolation needs besides; not finite rates there make an infinite error. */
static bool dense_stages(Engine *engine, const double *z, double *error)
{
    Step *step = &engine->step;
    double h = step->t1 - step->t0;
    for (size_t s = END + 1; s < ALL_STAGES; s++) {
        go_to_stage(engine, h, s, step->k, engine->probe_x);
        if (!engine_rates(engine, step->t0 + NODE[s] * h, engine->probe_x, z, step->k[place(s)]))
            return false;
        for (size_t i = 0; i < engine->model->n_states; i++)
            if (!isfinite(step->k[place(s)][i])) {
                engine->suspect = i;
                *error = INFINITY;
            }
    }
    return true;
}

static bool trial(Engine *engine, const Point *point, double *error)
{
    Step *step = &engine->step;
    if (!stages(engine, point->z, step->t1, step->k, step->x1) ||
        !engine_rates(engine, step->t1, step->x1, point->z, step->k[N_STAGES - 1]))
        return false;
    engine->largest = engine_largest_state(engine, point, step->x1);
    *error = step_error(engine, point, step->t1 - step->t0);
    return !(*error <= 1.0) || dense_stages(engine, point->z, error);
}

static bool probe(Engine *engine, const Point *point, double t)
{
    engine->probe_k[0] = engine->step.k[0];
    return stages(engine, point->z, t, engine->probe_k, engine->probe_x);
}

/* The vectors are the state at the start, its change, two of what the rates at both ends differ from that, and four
   more. */
static void prepare(Engine *engine)
{
    const Step *step = &engine->step;
    size_t n = engine->model->n_states;
    double h = step->t1 - step->t0, *of = step->vectors;
    for (size_t i = 0; i < n; i++) {
        double change = step->x1[i] - step->x0[i];
        of[i] = step->x0[i];
        of[n + i] = change;
        of[2 * n + i] = h * step->k[0][i] - change;
        of[3 * n + i] = change - h * step->k[N_STAGES - 1][i] - of[2 * n + i];
        for (size_t d = 0; d < 4; d++)
            of[(4 + d) * n + i] = h * weigh(step->k, DENSE[d], ALL_STAGES, i);
    }
}

/* |h lambda| for the eigenvalue of the Jacobian that shows in the last two stages, both of which are at the end of the
   step: E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", section IV.2. */
static double stiffness(const Engine *engine, const Point *point)
{
    const Step *step = &engine->step;
    double rates = 0.0, states = 0.0;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double size = fmax(fabs(step->x0[i]), fabs(step->x1[i]));
        double between = weigh(step->k, TABLE[END], END, i) - weigh(step->k, TABLE[END - 1], END - 1, i);
        double scale = engine_error_scale(engine, point, i, size);
        double change = (step->k[N_STAGES - 1][i] - step->k[END - 1][i]) / scale;
        rates += change * change;
        states += between / scale * (between / scale);
    }
    return states > 0.0 ? sqrt(rates / states) : 0.0;
}

const Method engine_dormand_prince = {
    .n_vectors = NESTED_VECTORS,
    .order = 8.0,
    /* The error of the interpolation is at most some ten times that of the step, and falls with the eighth power. */
    .segment_part = 0.75,
    .trial = trial,
    .probe = probe,
    .prepare = prepare,
    .interpolate = engine_interpolate_nested,
    .straight = engine_straight_nested,
    .stiffness = stiffness,
};
