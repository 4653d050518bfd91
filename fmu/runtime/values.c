/* Values that go in and out: setting, and the views that a reader is shown. */
#include <math.h>

#include "parts.h"

bool evaluate(Engine *engine, ModelFunction function, double t, const double *x, const double *z, double *first,
              double *second)
{
    /* The function may use the places behind its own for the functions that it calls. */
    engine->arg[0] = &t;
    engine->arg[1] = x;
    engine->arg[2] = z;
    engine->arg[3] = engine->u;
    engine->arg[4] = engine->p;
    engine->res[0] = first;
    engine->res[1] = second;
    return function(engine->arg, engine->res, engine->iw, engine->w, 0) == 0;
}

/* Something that the future depends on has changed. */
void changed(Engine *engine)
{
    *engine->live.step = 0.0;
    engine->status->prediction = PREDICTION_NONE;
    engine->view = VIEW_NONE;
}

void engine_set_tolerance(Engine *engine, double relative)
{
    /* Below 1e-13 rounding would decide about steps. */
    double tolerance = fmax(fmin(relative, RELATIVE_TOLERANCE), 1e-13);
    engine->status->relative_tolerance = tolerance;
    engine->status->absolute_tolerance = ABSOLUTE_TOLERANCE * (tolerance / RELATIVE_TOLERANCE);
}

void engine_set_time(Engine *engine, double t)
{
    *engine->live.time = t;
    changed(engine);
}

double engine_time(const Engine *engine)
{
    return *engine->live.time;
}

void engine_set(Engine *engine, Bank bank, size_t index, double value)
{
    double *values = bank == BANK_STATE      ? engine->live.x
                     : bank == BANK_DISCRETE ? engine->live.z
                     : bank == BANK_INPUT    ? engine->u
                                             : engine->p;
    if (values[index] == value)
        return;
    values[index] = value;
    changed(engine);
}

static bool show(Engine *engine, View view)
{
    const Point *shown = &engine->shown;
    size_t jump;
    copy_point(engine, &engine->live, shown);
    if (view == VIEW_START) {
        if (!evaluate(engine, engine->model->start, *shown->time, shown->x, shown->z, engine->reset.x,
                      engine->reset.z))
            return problem(engine, ENDED_FAILED, "The start values of '%s' could not be evaluated.",
                           engine->model->name);
        return accept_state(engine, "its start value", shown);
    }
    if (view == VIEW_PENDING && engine->status->ending == ENDED_NOT) {
        if (!take_internal_jumps(engine, shown) || !first_enabled(engine, shown, &jump))
            return false;
        if (jump < engine->model->n_jumps)
            return apply_reset(engine, jump, shown) && take_internal_jumps(engine, shown);
    }
    return true;
}

const double *engine_values(Engine *engine, View view, Bank bank)
{
    const Point *shown = &engine->shown;
    if (bank == BANK_INPUT)
        return engine->u;
    if (bank == BANK_PARAMETER)
        return engine->p;
    if (engine->view != view) {
        engine->view = VIEW_NONE;
        engine->has_outputs = false;
        if (!show(engine, view))
            return NULL;
        engine->view = view;
    }
    if (bank == BANK_STATE)
        return shown->x;
    if (bank == BANK_DISCRETE)
        return shown->z;
    if (!engine->has_outputs) {
        if (!evaluate(engine, engine->model->outputs, *shown->time, shown->x, shown->z, engine->outputs, NULL)) {
            problem(engine, ENDED_FAILED, "The outputs of '%s' could not be evaluated at t = %.17g.",
                    engine->model->name, *shown->time);
            return NULL;
        }
        engine->has_outputs = true;
    }
    return engine->outputs;
}
