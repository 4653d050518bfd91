/* An engine for a model: which method it steps with, and the options that it begins with. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "method.h"

Engine *engine_create(const Model *m, size_t wrapper_size)
{
    Engine *engine = calloc(1, sizeof *engine);
    if (!engine)
        return NULL;
    engine->model = m;
    engine->method = m->quadratures > 0 ? &engine_quadrature : &engine_dormand_prince;
    engine->wrapper_size = wrapper_size;
    if (!engine_take_memory(engine)) {
        engine_free(engine);
        return NULL;
    }
    for (size_t j = 0; j < m->n_jumps; j++)
        if (m->jumps[j].kind == JUMP_ON_STATE) {
            engine->is_guard[m->jumps[j].index] = 1;
            engine->n_guards++;
        }
    engine_reset(engine);
    return engine;
}

static EngineOptions default_options(const Model *m)
{
    return (EngineOptions){
        .relative_tolerance = RELATIVE_TOLERANCE,
        .longest_step = INFINITY,
        .barrier = INFINITY,
        .jumps_at_once = m->scales.jumps_at_once,
        .jumps_in_window = m->scales.jumps_in_window,
        .spread = m->scales.spread,
        .window = -1.0,
        .remainder = -1.0,
        .most_jumps = INFINITY,
        .steps_at_once = 1e6,
        .look_ahead_steps = 2e4,
        .look_ahead_work = 2e5,
    };
}

EngineOptions *engine_options(Engine *engine)
{
    return &engine->options;
}

const Statistics *engine_statistics(const Engine *engine)
{
    return &engine->statistics;
}

void engine_reset(Engine *engine)
{
    const Model *m = engine->model;
    memset(engine->block, 0, engine->block_size);
    engine->options = default_options(m);
    engine->statistics = (Statistics){0};
    engine_record(engine, RECORD_NOTHING);
    engine->status->stop_time = INFINITY;
    if (m->x) {
        engine_copy(engine->live.x, m->x, m->n_states);
        engine_copy(engine->live.z, m->z, m->n_discrete);
        engine_copy(engine->u, m->u, m->n_inputs);
        engine_copy(engine->p, m->p, m->n_parameters);
    }
    engine->view = VIEW_NONE;
    engine_fail(engine, ENDED_NOT, "%s", "");
}
