/* What a reader is shown: the state as it is, at the start or after the jump that comes next; and what follows. */
#include <math.h>

#include "parts.h"

static bool show(Engine *engine, View view)
{
    const Point *shown = &engine->shown;
    size_t jump;
    engine_copy_point(engine, &engine->live, shown);
    if (view == VIEW_START)
        return engine_apply_start(engine, shown);
    if (view == VIEW_PENDING && engine->status->ending == ENDED_NOT) {
        if (!engine_take_internal_jumps(engine, shown) || !engine_first_enabled(engine, shown, &jump))
            return false;
        if (jump < engine->model->n_jumps)
            return engine_apply_reset(engine, jump, shown) && engine_take_internal_jumps(engine, shown);
    }
    return true;
}

bool engine_hold_view(Engine *engine, View view)
{
    if (engine->view == view)
        return true;
    engine_catch_up(engine);
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
    if (!*has && !engine_evaluate(engine, function, *shown->time, shown->x, shown->z, result, NULL))
        return engine_fail(engine, ENDED_FAILED, "The %s of '%s' could not be evaluated at t = %.17g.", what,
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
    if (!rates)
        return;
    for (size_t i = 0; i < m->n_states; i++)
        if (!isfinite(rates[i]))
            return;
    engine_copy(engine->inner_rates, rates, m->n_states);
    engine->status->has_inner_rates = true;
}

const double *engine_outer_rates(Engine *engine, View view)
{
    const Model *m = engine->model;
    double margin;
    if (!engine->status->has_inner_rates || !m->has_flow_set || !engine_hold_view(engine, view))
        return NULL;
    const Point *shown = &engine->shown;
    bool outside =
        engine_evaluate(engine, m->flow_set, *shown->time, shown->x, shown->z, &margin, NULL) && margin < 0.0;
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
    if (view == VIEW_LIVE && (bank == BANK_STATE || bank == BANK_DISCRETE)) {
        engine_catch_up(engine);
        return bank == BANK_STATE ? engine->live.x : engine->live.z;
    }
    if (!engine_hold_view(engine, view))
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
