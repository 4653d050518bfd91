/* Derivatives along directions: what a change of time, states, inputs and parameters does to the flow and
   to the outputs, and the other way round. */
#include <string.h>

#include "parts.h"

static void lay_out_seeds(const Engine *engine, double *place, double *places[N_SEEDS])
{
    const Model *m = engine->model;
    const size_t sizes[N_SEEDS] = {1,           m->n_states,  m->n_discrete, m->n_inputs,  m->n_parameters,
                                   m->n_states, m->n_outputs, m->n_states,   m->n_discrete};
    memset(place, 0, engine_seed_count(m) * sizeof(double));
    for (size_t i = 0; i < N_SEEDS; i++) {
        places[i] = place;
        place += sizes[i];
    }
}

void engine_seeds(Engine *engine, double *places[N_SEEDS])
{
    lay_out_seeds(engine, engine->seeds[0], places);
}

static void own_seeds(Engine *engine, double *places[N_SEEDS])
{
    lay_out_seeds(engine, engine->seeds[1], places);
}

static bool call(Engine *engine, ModelFunction function, const Point *at, double *const *seeds, size_t n_seeds,
                 double *const *results, size_t n_results)
{
    const double *known[MODEL_N_ARG] = {at->time, at->x, at->z, engine->u, engine->p};
    memcpy(engine->arg, known, sizeof known);
    for (size_t i = 0; i < n_seeds; i++)
        engine->arg[MODEL_N_ARG + i] = seeds[i];
    memcpy(engine->res, results, n_results * sizeof *results);
    return function(engine->arg, engine->res, engine->iw, engine->w, 0) == 0 ||
           engine_fail(engine, ENDED_FAILED, "The derivatives of '%s' could not be evaluated at t = %.17g.",
                       engine->model->name, *at->time);
}

bool engine_forward(Engine *engine, View view, double *const seeds[N_SEEDS])
{
    const Model *m = engine->model;
    double *const *wanted = seeds + SEED_RATES;
    if (!engine_hold_view(engine, view))
        return false;
    if (view == VIEW_START) {
        if (!call(engine, m->start_forward, &engine->live, seeds, MODEL_N_ARG, seeds + SEED_SHOWN, 2))
            return false;
    } else {
        engine_copy(seeds[SEED_SHOWN], seeds[SEED_STATES], m->n_states);
        engine_copy(seeds[SEED_SHOWN + 1], seeds[SEED_STATES + 1], m->n_discrete);
    }
    double *onward[MODEL_N_ARG] = {seeds[0], seeds[SEED_SHOWN], seeds[SEED_SHOWN + 1], seeds[3], seeds[4]};
    return call(engine, m->forward, &engine->shown, onward, MODEL_N_ARG, wanted, 2) &&
           engine_mend_slopes(engine, onward, wanted[0], wanted[1]);
}

static void add(double *to, const double *more, size_t n)
{
    for (size_t i = 0; i < n; i++)
        to[i] += more[i];
}

bool engine_reverse(Engine *engine, View view, double *const seeds[N_SEEDS])
{
    const Model *m = engine->model;
    double *back[N_SEEDS], *const *x = seeds + SEED_STATES;
    if (!engine_hold_view(engine, view) ||
        !call(engine, m->reverse, &engine->shown, seeds + SEED_RATES, 2, seeds, MODEL_N_ARG) ||
        !engine_mend_sensitivities(engine, seeds))
        return false;
    add(x[0], seeds[SEED_SHOWN], m->n_states);
    add(x[1], seeds[SEED_SHOWN + 1], m->n_discrete);
    if (view != VIEW_START)
        return true;
    /* The states are themselves computed from what was set. */
    own_seeds(engine, back);
    if (!call(engine, m->start_reverse, &engine->live, x, 2, back, MODEL_N_ARG))
        return false;
    engine_copy(x[0], back[SEED_STATES], m->n_states);
    engine_copy(x[1], back[SEED_STATES + 1], m->n_discrete);
    add(seeds[0], back[0], 1);
    add(seeds[3], back[3], m->n_inputs);
    add(seeds[4], back[4], m->n_parameters);
    return true;
}
