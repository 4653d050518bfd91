/* The step of the solver that the live point moves along between its ends, as far as nothing happens there. */
#include "method.h"

void engine_segment_move(Engine *engine, double t)
{
    *engine->live.time = t;
    engine->status->behind = true;
}

void engine_catch_up(Engine *engine)
{
    Status *status = engine->status;
    if (!status->behind)
        return;
    double t = *engine->live.time;
    double a = (t - status->segment_begin) / status->segment_span;
    engine->method->interpolate(engine->segment, (size_t)status->segment_terms, engine->model->n_states, a,
                                engine->live.x);
    status->behind = false;
}
