/* Difference quotients where the chain rule has none.

   The root of max(h, 0) has the derivative 0 at h < 0, but the chain rule makes it infinity times zero.  Where a
   derivative comes out as no number, the map is looked at on both sides of the point; if both show one slope, that is
   the derivative. */
#include <math.h>
#include <string.h>

#include "parts.h"

/* Part of the variables' sizes by which they are moved, and of the slope by which both sides may differ. */
#define MOVE 1e-6
#define AGREEMENT 1e-4

static const double *value_of(const Engine *engine, size_t bank)
{
    const Point *at = &engine->shown;
    const double *const values[MODEL_N_ARG] = {at->time, at->x, at->z, engine->u, engine->p};
    return values[bank];
}

static size_t length_of(const Model *m, size_t bank)
{
    const size_t lengths[MODEL_N_ARG] = {1, m->n_states, m->n_discrete, m->n_inputs, m->n_parameters};
    return lengths[bank];
}

/* The step along a direction that moves no variable by more than a small part of its size. */
static double step_along(const Engine *engine, double *const direction[MODEL_N_ARG])
{
    double step = INFINITY;
    for (size_t bank = 0; bank < MODEL_N_ARG; bank++)
        for (size_t i = 0; i < length_of(engine->model, bank); i++) {
            double value = fabs(value_of(engine, bank)[i]), seed = fabs(direction[bank][i]);
            double size = bank == 1 ? engine_state_size(engine, &engine->shown, i, value) : value;
            if (seed > 0.0)
                step = fmin(step, MOVE * (size > 0.0 ? size : 1.0) / seed);
        }
    return step;
}

/* Rates and outputs at the point moved along a direction by `step`, one after the other. */
static bool values_along(Engine *engine, double *const direction[MODEL_N_ARG], double step, double *result)
{
    const Model *m = engine->model;
    double *moved = engine->seeds[1];
    for (size_t bank = 0; bank < MODEL_N_ARG; bank++) {
        engine->arg[bank] = moved;
        for (size_t i = 0; i < length_of(m, bank); i++)
            *moved++ = value_of(engine, bank)[i] + step * direction[bank][i];
    }
    const double *place[MODEL_N_ARG];
    memcpy(place, engine->arg, sizeof place);
    engine->res[0] = result;
    if (m->n_states > 0 && m->flow(engine->arg, engine->res, engine->iw, engine->w, 0) != 0)
        return false;
    memcpy(engine->arg, place, sizeof place);
    engine->res[0] = result + m->n_states;
    return m->n_outputs == 0 || m->outputs(engine->arg, engine->res, engine->iw, engine->w, 0) == 0;
}

/* The slope of element i of rates and outputs; not a number where the two sides differ. */
static double slope_of(const Engine *engine, double here, size_t i, double step)
{
    size_t n = engine->model->n_states + engine->model->n_outputs;
    double ahead = (engine->slopes[i] - here) / step, behind = (here - engine->slopes[n + i]) / step;
    bool agree = fabs(ahead - behind) <= AGREEMENT * fmax(fabs(ahead), fabs(behind));
    return agree ? 0.5 * (ahead + behind) : (double)NAN;
}

/* Looks at both sides of the point; false if the maps cannot be evaluated there. */
static bool look_along(Engine *engine, double *const direction[MODEL_N_ARG], double *step)
{
    size_t n = engine->model->n_states + engine->model->n_outputs;
    *step = step_along(engine, direction);
    return isfinite(*step) && values_along(engine, direction, *step, engine->slopes) &&
           values_along(engine, direction, -*step, engine->slopes + n);
}

static bool any_is_no_number(const double *values, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (isnan(values[i]))
            return true;
    return false;
}

/* Rates and outputs at the point itself; false if they cannot be evaluated. */
static bool values_here(Engine *engine, const double **rates, const double **outputs)
{
    *rates = engine_values(engine, engine->view, BANK_DERIVATIVE);
    *outputs = engine_values(engine, engine->view, BANK_OUTPUT);
    return *rates && *outputs;
}

bool engine_mend_slopes(Engine *engine, double *const direction[MODEL_N_ARG], double *rates, double *outputs)
{
    const Model *m = engine->model;
    const double *rates_here, *outputs_here;
    double step;
    if (!any_is_no_number(rates, m->n_states) && !any_is_no_number(outputs, m->n_outputs))
        return true;
    if (!values_here(engine, &rates_here, &outputs_here))
        return false;
    if (!look_along(engine, direction, &step))
        return true;
    for (size_t i = 0; i < m->n_states; i++)
        if (isnan(rates[i]))
            rates[i] = slope_of(engine, rates_here[i], i, step);
    for (size_t i = 0; i < m->n_outputs; i++)
        if (isnan(outputs[i]))
            outputs[i] = slope_of(engine, outputs_here[i], m->n_states + i, step);
    return true;
}

/* The weighted sum of all slopes along a direction. */
static double weighted_slopes(const Engine *engine, double *const seeds[N_SEEDS], const double *rates,
                              const double *outputs, double step)
{
    const Model *m = engine->model;
    double sum = 0.0;
    for (size_t i = 0; i < m->n_states + m->n_outputs; i++) {
        bool rate = i < m->n_states;
        size_t k = rate ? i : i - m->n_states;
        double weight = seeds[rate ? SEED_RATES : SEED_OUTPUTS][k];
        if (weight != 0.0)
            sum += weight * slope_of(engine, rate ? rates[k] : outputs[k], i, step);
    }
    return sum;
}

bool engine_mend_sensitivities(Engine *engine, double *const seeds[N_SEEDS])
{
    const Model *m = engine->model;
    const double *rates, *outputs;
    double *direction[MODEL_N_ARG], step;
    bool mended = true;
    for (size_t bank = 0; bank < MODEL_N_ARG; bank++)
        mended = mended && !any_is_no_number(seeds[bank], length_of(m, bank));
    if (mended)
        return true;
    if (!values_here(engine, &rates, &outputs))
        return false;
    double *unit = engine->unit;
    memset(unit, 0, engine_seed_count(m) * sizeof(double));
    for (size_t bank = 0, at = 0; bank < MODEL_N_ARG; at += length_of(m, bank++))
        direction[bank] = unit + at;
    for (size_t bank = 0; bank < MODEL_N_ARG; bank++)
        for (size_t i = 0; i < length_of(m, bank); i++) {
            if (!isnan(seeds[bank][i]))
                continue;
            direction[bank][i] = 1.0;
            if (look_along(engine, direction, &step))
                seeds[bank][i] = weighted_slopes(engine, seeds, rates, outputs, step);
            direction[bank][i] = 0.0;
        }
    return true;
}
