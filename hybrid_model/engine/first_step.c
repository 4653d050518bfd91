/* The length of a first step, and the sizes of states that have shown none: only ratios of rates occur, so that no unit
   matters.  See hybrid_model/reference/first_step.py. */
#include <float.h>
#include <math.h>

#include "method.h"

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

/* The speed of the flow at a time with the states as they are, and in *turned how fast it turns back by itself
   (1/s). */
static double speed_at(Engine *engine, const Point *point, double t, double step, double *turned)
{
    size_t n = engine->model->n_states;
    double *rates = engine->probe_k[1], *after = engine->probe_k[2], *moved = engine->probe_x;
    if (!engine_rates(engine, t, point->x, point->z, rates))
        return 0.0;
    double speed = largest_of(n, rates, NULL);
    for (size_t i = 0; i < n; i++)
        moved[i] = point->x[i] + step * rates[i];
    if (!(speed > 0.0) || !isfinite(speed) || !engine_rates(engine, t, moved, point->z, after))
        return 0.0;
    *turned = largest_of(n, after, rates) / (speed * step);
    return isfinite(*turned) ? speed : 0.0;
}

bool engine_raise_floor(Engine *engine, const Point *point, double limit)
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
    if (!(engine_largest_state(engine, point, point->x) < scales->unknown * found))
        return false;
    status->floor = found;
    return true;
}

/* An Euler step shows how the derivative changes; the step is chosen so that its error is about the tolerance.  Only
   ratios occur, so that no unit matters: see hybrid_model/reference/first_step.py. */
bool engine_first_step(Engine *engine, const Point *point, double limit, double size, double *h)
{
    const ModelScales *scales = &engine->model->scales;
    Step *step = &engine->step;
    size_t n = engine->model->n_states;
    double t = *point->time, whole = limit - t, speed = largest_of(n, step->k[0], NULL);
    bool known = size > DBL_MIN / scales->absolute;
    double least =
        fmin(whole, scales->first_least * fmax(engine_time_ulp(t), isfinite(limit) ? engine_time_ulp(limit) : 0.0));
    double euler = speed > 0.0 && known ? scales->euler_part * size / speed : scales->blind_part * whole;
    *h = euler = isfinite(euler) ? fmax(least, fmin(euler, whole)) : least;
    if (!(speed > 0.0) || !isfinite(speed))
        return true;
    for (size_t i = 0; i < n; i++)
        step->x1[i] = point->x[i] + euler * step->k[0][i];
    if (!engine_rates(engine, t + euler, step->x1, point->z, step->k[1]))
        return false;
    double turned = largest_of(n, step->k[1], step->k[0]) / (speed * euler);
    if (!isfinite(turned))
        return true;
    double reach = fmax(known ? size : 0.0, speed * euler);
    double allowed = scales->euler_part * engine->options.relative_tolerance * reach / speed;
    double root = 1.0 / (engine->method->order + 1.0);
    double chosen = turned > 0.0 ? pow(allowed * turned, root) / turned : (double)INFINITY;
    *h = fmax(least, fmin(fmin(scales->first_growth * euler, chosen), whole));
    return true;
}
