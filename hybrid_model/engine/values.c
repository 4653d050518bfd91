/* Values at a point: maps evaluated there, how large states have been, and setting from outside. */
#include <float.h>
#include <math.h>

#include "method.h"

double engine_state_size(const Engine *engine, const Point *point, size_t i, double x)
{
    double nominal = engine->model->nominals[i];
    return nominal > 0.0 ? nominal : engine_larger(fabs(x), point->size[i]);
}

double engine_largest_state(const Engine *engine, const Point *point, const double *x)
{
    double largest = engine_larger(DBL_MIN / engine->model->scales.absolute, engine->status->floor);
    for (size_t i = 0; i < engine->model->n_states; i++)
        largest = engine_larger(engine_state_size(engine, point, i, x[i]), largest);
    return largest;
}

double engine_left_by_rounding(const Engine *engine, size_t i, double h)
{
    const Rounding *of = &engine->rounding;
    return engine->model->scales.left_by_rounding * of->rates[i] * h / (1.0 + h * of->turned[i]);
}

/* The absolute part follows from the nominal value, or from the sizes of the states: see usual_sizes in
   hybrid_model/scales.py. */
static double wanted_scale(const Engine *engine, const Point *point, size_t i, double size)
{
    const EngineOptions *options = &engine->options;
    const ModelScales *scales = &engine->model->scales;
    double relative = engine_larger(options->relative_tolerance, engine->method->finest_tolerance);
    double nominal = engine->model->nominals[i], looser = relative / RELATIVE_TOLERANCE;
    if (options->absolute_tolerance > 0.0)
        return options->absolute_tolerance + relative * size;
    double shown = engine_larger(engine_larger(size, point->size[i]), engine->status->floor) / engine->largest;
    double usual = engine->largest * (shown < scales->rounding_level ? 1.0 : sqrt(shown));
    double part = scales->absolute * looser * (nominal > 0.0 ? nominal : engine_smaller(usual, 1.0));
    return part + relative * size;
}

double engine_error_scale(const Engine *engine, const Point *point, size_t i, double size)
{
    double wanted = wanted_scale(engine, point, i, size), h = engine->step.t1 - engine->step.t0;
    return engine->rounding.decides ? fmax(wanted, engine_left_by_rounding(engine, i, h)) : wanted;
}

void engine_note_sizes(const Engine *engine, const Point *point)
{
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double size = fabs(point->x[i]);
        if (size > point->size[i])
            point->size[i] = size;
    }
}

void engine_begin_anew(const Engine *engine, const Point *point)
{
    /* Who only looks leaves no trace. */
    if (*point->step > 0.0 && point->step != engine->shown.step)
        engine->status->stride = engine->method->segment_part * *point->step;
    *point->step = 0.0;
}

void engine_clear_levels(const Engine *engine, const Point *point)
{
    for (size_t i = 0; i <= engine->model->n_margins; i++)
        point->level[i] = 0.0;
}

bool engine_rates(Engine *engine, double t, const double *x, const double *z, double *result)
{
    if (engine->model->n_states == 0)
        return true;
    engine->statistics.evaluations++;
    if (engine_evaluate(engine, engine->model->flow, t, x, z, result, NULL))
        return true;
    return engine_fail(engine, ENDED_FAILED, "The flow map of '%s' could not be evaluated at t = %.17g.",
                       engine->model->name, t);
}

void engine_leave_segment(Engine *engine)
{
    if (!engine->status->has_segment)
        return;
    engine_catch_up(engine);
    engine_note_sizes(engine, &engine->live);
    engine->status->has_segment = false;
}

/* Something that the future depends on has changed. */
void engine_changed(Engine *engine)
{
    engine_leave_segment(engine);
    engine_begin_anew(engine, &engine->live);
    engine->status->prediction = PREDICTION_NONE;
    engine->status->settled = false;
    engine->view = VIEW_NONE;
}

void engine_set_tolerance(Engine *engine, double relative)
{
    /* Above the greatest event times would suffer. */
    const double greatest = 1e-10;
    engine->options.relative_tolerance = fmax(fmin(1e-3 * relative, greatest), RELATIVE_TOLERANCE);
}

void engine_set_span(Engine *engine, double start, double stop)
{
    Status *status = engine->status;
    engine_set_time(engine, start);
    status->start_time = status->jumps_time = start;
    status->stop_time = stop;
}

void engine_set_time(Engine *engine, double t)
{
    engine_leave_segment(engine);
    *engine->live.time = t;
    engine_clear_levels(engine, &engine->live);
    engine_changed(engine);
}

double engine_time(const Engine *engine)
{
    return *engine->live.time;
}

void engine_set(Engine *engine, Bank bank, size_t index, double value)
{
    engine_catch_up(engine);
    double *values = bank == BANK_STATE      ? engine->live.x
                     : bank == BANK_DISCRETE ? engine->live.z
                     : bank == BANK_INPUT    ? engine->u
                                             : engine->p;
    if (values[index] == value)
        return;
    engine_leave_segment(engine);
    values[index] = value;
    engine_note_factors(engine, bank, index);
    /* Guards that were reached by rounding were so in the state before. */
    if (bank == BANK_STATE)
        engine_clear_levels(engine, &engine->live);
    engine_changed(engine);
}

void engine_set_states(Engine *engine, const double *x)
{
    engine_leave_segment(engine);
    engine_copy(engine->live.x, x, engine->model->n_states);
    engine_clear_levels(engine, &engine->live);
    engine_changed(engine);
}
