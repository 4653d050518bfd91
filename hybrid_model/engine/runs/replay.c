/* A run that is known by its events is made again: flows, jumps and receptions as they were told, for a record of it. */
#include <math.h>

#include "parts.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

/* What happened: a jump with its number, or an input or a parameter that got a value: over a wire, or from outside at a
   time that was known, beyond which no flow is looked at. */
enum { JUMPED, RECEIVED, GIVEN_INPUT, GIVEN_PARAMETER };
typedef struct {
    double t, value;
    uint32_t number, kind;
} ReplayEvent;

EXPORT int run_replay_begin(Engine *engine, const double *const values[], double start, double stop, int record);
EXPORT size_t run_replay(Engine *engine, size_t count, const ReplayEvent events[], uint64_t jumps_before[], double end);

/* Begins a run that has its start values. */
int run_replay_begin(Engine *engine, const double *const values[], double start, double stop, int record)
{
    const Model *m = engine->model;
    engine_copy(engine->live.x, values[BANK_STATE], m->n_states);
    engine_copy(engine->live.z, values[BANK_DISCRETE], m->n_discrete);
    engine_copy(engine->u, values[BANK_INPUT], m->n_inputs);
    engine_copy(engine->p, values[BANK_PARAMETER], m->n_parameters);
    engine_set_span(engine, start, stop);
    engine_record(engine, (RecordKind)record);
    engine_note_sizes(engine, &engine->live);
    engine_copy(engine->reset.x, engine->live.x, m->n_states + m->n_discrete);
    return engine_record_jump(engine, m->n_jumps) && engine_take_internal_jumps(engine, &engine->live);
}

static bool flow_to(Engine *engine, double t)
{
    size_t budget = SIZE_MAX;
    engine->target = t;
    return !(t > *engine->live.time) || engine_flow(engine, &engine->live, t, false, &budget) == FLOW_REACHED;
}

static bool jump(Engine *engine, size_t number)
{
    engine_changed(engine);
    return engine_evaluate_times(engine, &engine->live) && engine_apply_reset(engine, number, &engine->live) &&
           engine_take_internal_jumps(engine, &engine->live);
}

/* Goes through the events and on to the end; of each event it tells how many jumps the record had when it came,
   breakpoints included.  Returns how many events there were before something failed, one more than all if nothing did. */
size_t run_replay(Engine *engine, size_t count, const ReplayEvent events[], uint64_t jumps_before[], double end)
{
    size_t given = 0;
    for (size_t k = 0; k < count; k++) {
        const ReplayEvent *event = &events[k];
        while (given < count && (given < k || events[given].kind < GIVEN_INPUT))
            given++;
        engine->options.barrier = given < count ? events[given].t : INFINITY;
        if (!flow_to(engine, event->t))
            return k;
        jumps_before[k] = engine->rows[ROWS_OF_JUMPS].count - 1;
        if (event->kind != JUMPED)
            engine_set(engine, event->kind == GIVEN_PARAMETER ? BANK_PARAMETER : BANK_INPUT, event->number,
                       event->value);
        else if (!jump(engine, event->number))
            return k;
    }
    engine->options.barrier = INFINITY;
    return flow_to(engine, end) ? count + 1 : count;
}
