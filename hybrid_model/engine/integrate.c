/* The flow: Dormand-Prince 5(4) with error control and interpolation.

   J. R. Dormand, P. J. Prince, "A family of embedded Runge-Kutta formulae", 1980; starting step and
   interpolation after E. Hairer, S. P. Norsett, G. Wanner, "Solving Ordinary Differential
   Equations I", sections II.4 and II.6. */
#include <float.h>
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
static const double ERROR_WEIGHT[N_STAGES] = {
    71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0};
static const double DENSE_WEIGHT[N_STAGES] = {-12715105075.0 / 11282082432.0, 0.0,
                                              87487479700.0 / 32700410799.0,  -10690763975.0 / 1880347072.0,
                                              701980252875.0 / 199316789632.0, -1453857185.0 / 822651844.0,
                                              69997945.0 / 29380423.0};

/* Of the starting step; see hybrid_model/reference/first_step.py. */
#define ORDER 5.0

double time_ulp(double t)
{
    double size = fabs(t);
    return nextafter(size, INFINITY) - size;
}

static bool derivative(Engine *engine, double t, const double *x, const double *z, double *result)
{
    if (engine->model->n_states == 0)
        return true;
    if (evaluate(engine, engine->model->flow, t, x, z, result, NULL))
        return true;
    return problem(engine, ENDED_FAILED, "The flow map of '%s' could not be evaluated at t = %.17g.",
                   engine->model->name, t);
}

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
        if (!derivative(engine, t, x1, z, k[s]))
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

double largest_state(const Engine *engine, const Point *point, const double *x)
{
    double largest = fmax(DBL_MIN / engine->model->scales.absolute, engine->status->floor);
    for (size_t i = 0; i < engine->model->n_states; i++)
        largest = fmax(largest, state_size(engine, point, i, x[i]));
    return largest;
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

/* The largest element of a vector, or of its difference from another one. */
static double largest_of(size_t n, const double *values, const double *minus)
{
    double largest = 0.0;
    for (size_t i = 0; i < n; i++) {
        double value = fabs(minus ? values[i] - minus[i] : values[i]);
        /* Not fmax: it passes over what is not a number. */
        largest = value <= largest ? largest : value;
    }
    return largest;
}

/* The speed of the flow at a time with the states as they are, and in *turned how fast it turns back by itself (1/s). */
static double speed_at(Engine *engine, const Point *point, double t, double step, double *turned)
{
    size_t n = engine->model->n_states;
    double *rates = engine->probe_k[1], *after = engine->probe_k[2], *moved = engine->probe_x;
    if (!derivative(engine, t, point->x, point->z, rates))
        return 0.0;
    double speed = largest_of(n, rates, NULL);
    for (size_t i = 0; i < n; i++)
        moved[i] = point->x[i] + step * rates[i];
    if (!(speed > 0.0) || !isfinite(speed) || !derivative(engine, t, moved, point->z, after))
        return 0.0;
    *turned = largest_of(n, after, rates) / (speed * step);
    return isfinite(*turned) ? speed : 0.0;
}

bool raise_floor(Engine *engine, const Point *point, double limit)
{
    const ModelScales *scales = &engine->model->scales;
    Status *status = engine->status;
    double turned, found = 0.0;
    for (size_t i = 0; i < N_REACH_AT && engine->model->n_states > 0; i++) {
        double span = scales->reach_at[i] * (limit - *point->time);
        if (!isfinite(span) || !(span > 0.0))
            continue;
        double speed = speed_at(engine, point, *point->time + span, scales->reach_step * span, &turned);
        found = fmax(found, speed > 0.0 ? speed * (turned * span > 1.0 ? 1.0 / turned : span) : 0.0);
    }
    if (!(largest_state(engine, point, point->x) < scales->unknown * found))
        return false;
    status->floor = found;
    return true;
}

/* An Euler step shows how the derivative changes; the step is chosen so that its error is about the tolerance.  Only
   ratios occur, so that no unit matters: see hybrid_model/reference/first_step.py. */
bool first_step(Engine *engine, const Point *point, double limit, double *h)
{
    const ModelScales *scales = &engine->model->scales;
    Step *step = &engine->step;
    size_t n = engine->model->n_states;
    double t = *point->time, whole = limit - t, speed = largest_of(n, step->k[0], NULL);
    double size = n > 0 ? largest_state(engine, point, point->x) : 0.0;
    bool known = size > DBL_MIN / scales->absolute;
    double least = fmin(whole, scales->first_least * fmax(time_ulp(t), isfinite(limit) ? time_ulp(limit) : 0.0));
    double euler = speed > 0.0 && known ? scales->euler_part * size / speed : scales->blind_part * whole;
    *h = euler = isfinite(euler) ? fmax(least, fmin(euler, whole)) : least;
    if (!(speed > 0.0) || !isfinite(speed))
        return true;
    for (size_t i = 0; i < n; i++)
        step->x1[i] = point->x[i] + euler * step->k[0][i];
    if (!derivative(engine, t + euler, step->x1, point->z, step->k[1]))
        return false;
    double turned = largest_of(n, step->k[1], step->k[0]) / (speed * euler);
    if (!isfinite(turned))
        return true;
    double reach = fmax(known ? size : 0.0, speed * euler);
    double allowed = scales->euler_part * engine->status->relative_tolerance * reach / speed;
    double chosen = turned > 0.0 ? pow(allowed * turned, 1.0 / (ORDER + 1.0)) / turned : (double)INFINITY;
    *h = fmax(least, fmin(fmin(scales->first_growth * euler, chosen), whole));
    return true;
}

bool step_begin(Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    Step *step = &engine->step;
    double t = *point->time;
    step->t0 = step->t1 = t;
    step->x0 = point->x;
    step->has_dense = false;
    if (!derivative(engine, t, point->x, point->z, step->k[0]))
        return false;
    for (size_t i = 0; i < m->n_states; i++)
        if (!isfinite(step->k[0][i]))
            return problem(engine, ENDED_NOT_FINITE,
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
        return problem(engine, ENDED_NOT_FINITE,
                       "'%s' = %.17g does not stay finite beyond t = %.17g. Remedy: check the flow map for a division "
                       "by zero or a finite escape time, or keep the state in a flow set.",
                       name, value, *point->time);
    return problem(engine, ENDED_FAILED,
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

bool step_accept(Engine *engine, const Point *point, double limit)
{
    Step *step = &engine->step;
    double t0 = *point->time, remaining = limit - t0, h = *point->step;
    bool rejected = false;
    if (h <= 0.0 && !first_step(engine, point, limit, &h))
        return false;
    for (;;) {
        /* The last two steps share what remains, so that no sliver is left. */
        bool whole = h >= remaining;
        double used = whole ? remaining : 2.0 * h > remaining ? 0.5 * remaining : h;
        step->t1 = whole ? limit : t0 + used;
        used = step->t1 - t0;
        if (!stages(engine, point->z, t0, step->t1, step->x0, step->k, step->x1) ||
            !derivative(engine, step->t1, step->x1, point->z, step->k[N_STAGES - 1]))
            return false;
        engine->largest = largest_state(engine, point, step->x1);
        double error = step_error(engine, point, step, used);
        if (error <= 1.0) {
            *point->step = next_step(h, used, error, rejected);
            step->has_dense = false;
            return true;
        }
        h = used * (isfinite(error) ? fmax(0.1, 0.9 * pow(error, -0.2)) : 0.1);
        rejected = true;
        if (h >= 16.0 * time_ulp(t0) && t0 + h > t0)
            continue;
        if (!isfinite(error) || !raise_floor(engine, point, limit))
            return step_too_small(engine, point, h, isfinite(error));
        if (!first_step(engine, point, limit, &h))
            return false;
    }
}

void step_commit(Engine *engine, const Point *point)
{
    Step *step = &engine->step;
    double *last = step->k[N_STAGES - 1];
    *point->time = step->t1;
    memcpy(point->x, step->x1, engine->model->n_states * sizeof(double));
    note_sizes(engine, point);
    /* The last stage is the first one of the next step. */
    step->k[N_STAGES - 1] = step->k[0];
    step->k[0] = last;
    step->t0 = step->t1;
    step->has_dense = false;
}

bool step_probe(Engine *engine, const Point *point, double t)
{
    engine->probe_k[0] = engine->step.k[0];
    return stages(engine, point->z, engine->step.t0, t, engine->step.x0, engine->probe_k, engine->probe_x);
}

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

void segment_keep(Engine *engine)
{
    Step *step = &engine->step;
    Status *status = engine->status;
    size_t n = engine->model->n_states;
    if (!step->has_dense)
        prepare_dense(engine);
    copy_values(engine->segment[0], step->x0, n);
    for (size_t i = 0; i < n; i++)
        engine->segment[1][i] = step->x1[i] - step->x0[i];
    for (size_t k = 0; k < 3; k++)
        copy_values(engine->segment[2 + k], step->dense[k], n);
    status->segment_begin = step->t0;
    status->segment_end = step->t1;
    status->has_segment = true;
}

void segment_read(Engine *engine, double t)
{
    const Status *status = engine->status;
    double *const *of = engine->segment;
    double a = (t - status->segment_begin) / (status->segment_end - status->segment_begin), b = 1.0 - a;
    *engine->live.time = t;
    for (size_t i = 0; i < engine->model->n_states; i++)
        engine->live.x[i] = of[0][i] + a * (of[1][i] + b * (of[2][i] + a * (of[3][i] + b * of[4][i])));
    note_sizes(engine, &engine->live);
}

void step_dense(Engine *engine, double t)
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
