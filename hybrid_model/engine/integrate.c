/* The flow: Dormand-Prince 5(4) with error control and interpolation.

   J. R. Dormand, P. J. Prince, "A family of embedded Runge-Kutta formulae", 1980; starting step and
   interpolation after E. Hairer, S. P. Norsett, G. Wanner, "Solving Ordinary Differential
   Equations I", sections II.4 and II.6. */
#include <math.h>
#include <string.h>

#include "parts.h"

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

/* The absolute part follows from the nominal value, or from the sizes of the states: see usual_sizes in
   hybrid_model/scales.py. */
static double scale(const Engine *engine, const Point *point, size_t i, double size)
{
    const Status *status = engine->status;
    const ModelScales *scales = &engine->model->scales;
    double nominal = engine->model->nominals[i], looser = status->relative_tolerance / RELATIVE_TOLERANCE;
    double part = fmax(status->floor, fmax(point->size[i], size)) / engine->largest;
    double usual = engine->largest * (part < scales->rounding_level ? 1.0 : sqrt(part));
    return scales->absolute * looser * (nominal > 0.0 ? nominal : fmin(usual, 1.0)) + status->relative_tolerance * size;
}

/* The error of the step in units of the tolerance, infinite if anything is not finite. */
static double step_error(Engine *engine, const Point *point, const Step *step, double h)
{
    double worst = 0.0;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double sum = 0.0;
        for (size_t s = 0; s < N_STAGES; s++)
            sum += ERROR_WEIGHT[s] * step->k[s][i];
        double error = fabs(h * sum) / scale(engine, point, i, fmax(fabs(step->x0[i]), fabs(step->x1[i])));
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

bool engine_step_begin(Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    Step *step = &engine->step;
    double t = *point->time;
    step->t0 = step->t1 = t;
    step->x0 = point->x;
    step->has_dense = false;
    if (!engine_rates(engine, t, point->x, point->z, step->k[0]))
        return false;
    for (size_t i = 0; i < m->n_states; i++)
        if (!isfinite(step->k[0][i]))
            return engine_fail(
                engine, ENDED_NOT_FINITE,
                "The derivative of '%s' is %g at t = %.17g where '%s' = %.17g; derivatives must be finite. "
                "Remedy: check the flow map and the parameters.",
                NAME_AT(m->names, m->state_names[i]), step->k[0][i], t, NAME_AT(m->names, m->state_names[i]),
                point->x[i]);
    return true;
}

static bool step_too_small(Engine *engine, const Point *point, double h, bool finite)
{
    const char *name = NAME_AT(engine->model->names, engine->model->state_names[engine->suspect]);
    double value = point->x[engine->suspect];
    if (!finite)
        return engine_fail(
            engine, ENDED_NOT_FINITE,
            "'%s' = %.17g does not stay finite beyond t = %.17g. Remedy: check the flow map for a division "
            "by zero or a finite escape time, or keep the state in a flow set.",
            name, value, *point->time);
    return engine_fail(
        engine, ENDED_FAILED,
        "The solver needs steps below %.3g s at t = %.17g, where '%s' = %.17g changes too fast for its "
        "tolerance. Remedy: declare a discontinuity of the flow map as a time event, or scale the state.",
        h, *point->time, name, value);
}

/* The proposal for the step after one of the length `used` where `h` was possible. */
static double next_step(double h, double used, double error, bool rejected)
{
    const double most = 10.0;
    /* A step cut short by the limit says little about the next one, and no root need be taken. */
    if (used * most <= h)
        return h;
    double growth = error > 0.0 ? fmin(most, 0.9 * pow(error, -0.2)) : most;
    double proposal = used * (rejected ? fmin(1.0, growth) : fmax(0.2, growth));
    return used < h ? fmax(h, proposal) : proposal;
}

bool engine_step_accept(Engine *engine, const Point *point, double limit)
{
    Step *step = &engine->step;
    double t0 = *point->time, remaining = limit - t0, h = *point->step;
    bool rejected = false;
    if (h <= 0.0 && !engine_first_step(engine, point, limit, &h))
        return false;
    for (;;) {
        /* The last two steps share what remains, so that no sliver is left. */
        bool whole = h >= remaining;
        double used = whole ? remaining : 2.0 * h > remaining ? 0.5 * remaining : h;
        step->t1 = whole ? limit : t0 + used;
        used = step->t1 - t0;
        if (!stages(engine, point->z, t0, step->t1, step->x0, step->k, step->x1) ||
            !engine_rates(engine, step->t1, step->x1, point->z, step->k[N_STAGES - 1]))
            return false;
        engine->largest = engine_largest_state(engine, point, step->x1);
        double error = step_error(engine, point, step, used);
        if (error <= 1.0) {
            *point->step = next_step(h, used, error, rejected);
            step->has_dense = false;
            return true;
        }
        h = used * (isfinite(error) ? fmax(0.1, 0.9 * pow(error, -0.2)) : 0.1);
        rejected = true;
        if (h >= 16.0 * engine_time_ulp(t0) && t0 + h > t0)
            continue;
        if (!isfinite(error) || !engine_raise_floor(engine, point, limit))
            return step_too_small(engine, point, h, isfinite(error));
        if (!engine_first_step(engine, point, limit, &h))
            return false;
    }
}

void engine_step_commit(Engine *engine, const Point *point)
{
    Step *step = &engine->step;
    double *last = step->k[N_STAGES - 1];
    *point->time = step->t1;
    memcpy(point->x, step->x1, engine->model->n_states * sizeof(double));
    engine_note_sizes(engine, point);
    /* The last stage is the first one of the next step. */
    step->k[N_STAGES - 1] = step->k[0];
    step->k[0] = last;
    step->t0 = step->t1;
    step->has_dense = false;
}

bool engine_step_probe(Engine *engine, const Point *point, double t)
{
    engine->probe_k[0] = engine->step.k[0];
    return stages(engine, point->z, engine->step.t0, t, engine->step.x0, engine->probe_k, engine->probe_x);
}
