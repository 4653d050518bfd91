/* Values that go in and out: setting, and the views that a reader is shown. */
#include <math.h>

#include "parts.h"

double state_size(const Engine *engine, const Point *point, size_t i, double x)
{
    double nominal = engine->model->nominals[i];
    return nominal > 0.0 ? nominal : fmax(point->size[i], fabs(x));
}

void note_sizes(const Engine *engine, const Point *point)
{
    for (size_t i = 0; i < engine->model->n_states; i++)
        point->size[i] = fmax(point->size[i], fabs(point->x[i]));
}

void clear_levels(const Engine *engine, const Point *point)
{
    for (size_t i = 0; i <= engine->model->n_margins; i++)
        point->level[i] = 0.0;
}

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
    engine->status->settled = false;
    engine->status->has_segment = false;
    engine->view = VIEW_NONE;
}

void engine_set_tolerance(Engine *engine, double relative)
{
    /* Below the least rounding would decide about steps; above the greatest event times would suffer. */
    double tolerance = fmax(fmin(1e-3 * relative, RELATIVE_TOLERANCE_MOST), RELATIVE_TOLERANCE);
    engine->status->relative_tolerance = tolerance;
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
    *engine->live.time = t;
    clear_levels(engine, &engine->live);
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
    /* Guards that were reached by rounding were so in the state before. */
    if (bank == BANK_STATE)
        clear_levels(engine, &engine->live);
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
        return accept_state(engine, engine->model->n_jumps, shown);
    }
    if (view == VIEW_PENDING && engine->status->ending == ENDED_NOT) {
        if (!take_internal_jumps(engine, shown) || !first_enabled(engine, shown, &jump))
            return false;
        if (jump < engine->model->n_jumps)
            return apply_reset(engine, jump, shown) && take_internal_jumps(engine, shown);
    }
    return true;
}

void engine_set_states(Engine *engine, const double *x)
{
    copy_values(engine->live.x, x, engine->model->n_states);
    clear_levels(engine, &engine->live);
    changed(engine);
}

bool hold_view(Engine *engine, View view)
{
    if (engine->view == view)
        return true;
    engine->view = VIEW_NONE;
    engine->has_outputs = engine->has_rates = engine->has_indicators = false;
    if (!show(engine, view))
        return false;
    engine->view = view;
    return true;
}

static bool evaluate_view(Engine *engine, ModelFunction function, const char *what, double *result, bool *has)
{
    const Point *shown = &engine->shown;
    if (!*has && !evaluate(engine, function, *shown->time, shown->x, shown->z, result, NULL))
        return problem(engine, ENDED_FAILED, "The %s of '%s' could not be evaluated at t = %.17g.", what,
                       engine->model->name, *shown->time);
    *has = true;
    return true;
}

static bool indicators(Engine *engine)
{
    const Model *m = engine->model;
    bool has_flow_set = engine->has_indicators || !m->has_flow_set;
    return evaluate_view(engine, m->flow_set, "flow set", engine->indicators + m->n_margins, &has_flow_set) &&
           evaluate_view(engine, m->margins, "jump sets", engine->indicators, &engine->has_indicators);
}

void engine_note_rates(Engine *engine)
{
    const Model *m = engine->model;
    const double *rates = m->has_flow_set ? engine_values(engine, VIEW_LIVE, BANK_DERIVATIVE) : NULL;
    for (size_t i = 0; i < m->n_states; i++)
        if (!rates || !isfinite(rates[i]))
            return;
    copy_values(engine->inner_rates, rates, m->n_states);
    engine->status->has_inner_rates = true;
}

const double *engine_outer_rates(Engine *engine, View view)
{
    const Model *m = engine->model;
    double margin;
    if (!engine->status->has_inner_rates || !m->has_flow_set || !hold_view(engine, view))
        return NULL;
    const Point *shown = &engine->shown;
    bool outside = evaluate(engine, m->flow_set, *shown->time, shown->x, shown->z, &margin, NULL) && margin < 0.0;
    return outside ? engine->inner_rates : NULL;
}

size_t engine_indicators(const Engine *engine)
{
    return engine->model->n_margins + (engine->model->has_flow_set ? 1 : 0);
}

const double *engine_values(Engine *engine, View view, Bank bank)
{
    const Model *m = engine->model;
    if (bank == BANK_INPUT)
        return engine->u;
    if (bank == BANK_PARAMETER)
        return engine->p;
    /* What is as it is need not be copied to be shown. */
    if (view == VIEW_LIVE && (bank == BANK_STATE || bank == BANK_DISCRETE))
        return bank == BANK_STATE ? engine->live.x : engine->live.z;
    if (!hold_view(engine, view))
        return NULL;
    switch (bank) {
    case BANK_STATE: return engine->shown.x;
    case BANK_DISCRETE: return engine->shown.z;
    case BANK_DERIVATIVE:
        return evaluate_view(engine, m->flow, "flow map", engine->rates, &engine->has_rates) ? engine->rates : NULL;
    case BANK_INDICATOR: return indicators(engine) ? engine->indicators : NULL;
    default:
        return evaluate_view(engine, m->outputs, "outputs", engine->outputs, &engine->has_outputs) ? engine->outputs
                                                                                                 : NULL;
    }
}
