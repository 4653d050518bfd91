/* What a process that has loaded the engine as a library may call: whole runs of a model, and maps at many points.
   An FMU does not contain this file. */
#include <math.h>

#include "parts.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORT __attribute__((visibility("default")))
#else
#define EXPORT
#endif

/* Changes with every change of what follows, so that no process uses a library of another version. */
#define RUN_INTERFACE 5

/* What one event iteration gave: the jump that was taken (n_jumps if none), whether another one is due, whether the run
   is over, and when the next event comes (infinite if that is not known). */
typedef struct {
    size_t jump;
    int again, over;
    double next;
} RunUpdate;

EXPORT int run_interface(void);
EXPORT Engine *run_create(const Model *model);
EXPORT EngineOptions *run_options(Engine *engine);
EXPORT int run_start(Engine *engine, const double *const values[], double start, double stop, int record);
EXPORT int run_advance(Engine *engine, double target, int take);
EXPORT void run_place(Engine *engine, const double *const values[], double start, double stop);
EXPORT int run_begin(Engine *engine, int inside);
EXPORT void run_update(Engine *engine, double stop, int predicts, RunUpdate *update);
EXPORT int run_step(Engine *engine, double target, int inside);
EXPORT const double *run_read(Engine *engine, int view, int bank);
EXPORT size_t run_block_size(const Engine *engine);
EXPORT void run_save(Engine *engine, void *block);
EXPORT void run_restore(Engine *engine, const void *block);
EXPORT const char *run_problem(const Engine *engine);
EXPORT void run_set(Engine *engine, int bank, size_t index, double value);
EXPORT const double *run_values(Engine *engine, int bank);
EXPORT const double *run_rows(const Engine *engine, int kind, size_t *count, size_t *width);
EXPORT const Statistics *run_statistics(const Engine *engine);
EXPORT int run_ending(const Engine *engine);
EXPORT int run_shows_stiffness(const Engine *engine);
EXPORT int run_can_be_stiff(const Engine *engine);
EXPORT double run_time(const Engine *engine);
EXPORT const char *run_message(const Engine *engine);
EXPORT void run_free(Engine *engine);
EXPORT size_t run_evaluate(Engine *engine, int map, size_t count, const double *const tables[], double *results);

int run_interface(void)
{
    return RUN_INTERFACE;
}

Engine *run_create(const Model *model)
{
    return engine_create(model, 0);
}

EngineOptions *run_options(Engine *engine)
{
    return engine_options(engine);
}

/* The reason noted last ends the run. */
static int fail(Engine *engine)
{
    engine_end_run(engine);
    return 0;
}

/* Before a run: values of the states, inputs and parameters, in the order of the banks, and the times of its span. */
void run_place(Engine *engine, const double *const values[], double start, double stop)
{
    const Model *m = engine->model;
    engine_copy(engine->live.x, values[BANK_STATE], m->n_states);
    engine_copy(engine->live.z, values[BANK_DISCRETE], m->n_discrete);
    engine_copy(engine->u, values[BANK_INPUT], m->n_inputs);
    engine_copy(engine->p, values[BANK_PARAMETER], m->n_parameters);
    engine_set_span(engine, start, stop);
}

/* Begins a run and its record. */
int run_start(Engine *engine, const double *const values[], double start, double stop, int record)
{
    run_place(engine, values, start, stop);
    engine_record(engine, (RecordKind)record);
    return engine_start(engine) || fail(engine);
}

/* Begins a run that has been placed and is not recorded; who wants events inside has the jumps of the start taken. */
int run_begin(Engine *engine, int inside)
{
    if (!engine_start(engine))
        return fail(engine);
    bool going = !inside || engine_jump_all(engine);
    engine_clear_ticks(engine);
    return going;
}

/* Takes the jump that comes next, if one is due; looks ahead where none is due then, at most to `stop`. */
void run_update(Engine *engine, double stop, int predicts, RunUpdate *update)
{
    size_t n = engine->model->n_jumps;
    bool changed;
    *update = (RunUpdate){.over = !engine_jump(engine, &changed), .next = INFINITY};
    while (update->jump < n && !engine_ticked(engine, update->jump))
        update->jump++;
    engine_clear_ticks(engine);
    update->again = !update->over && engine_pending(engine) < n;
    double next;
    if (!update->over && !update->again && predicts && engine_predict(engine, stop, &next))
        update->next = next;
}

/* Goes on to the target, or to the first event if events are not taken inside. */
int run_step(Engine *engine, double target, int inside)
{
    return (int)engine_advance(engine, target, inside ? EVENTS_INSIDE : EVENTS_STOP);
}

const double *run_read(Engine *engine, int view, int bank)
{
    return engine_values(engine, (View)view, (Bank)bank);
}

size_t run_block_size(const Engine *engine)
{
    return engine_block_size(engine);
}

void run_save(Engine *engine, void *block)
{
    engine_save(engine, block);
}

void run_restore(Engine *engine, const void *block)
{
    engine_restore(engine, block);
}

const char *run_problem(const Engine *engine)
{
    return engine_problem(engine);
}

/* Goes on to the target; the jumps that are due there are taken if the run ends there, and else left to inputs that
   change first.  A run that ends must be in one of the sets: in neither it is over (line 4 of docs/semantics.md). */
int run_advance(Engine *engine, double target, int take)
{
    double level;
    engine->options.barrier = take ? INFINITY : target;
    Advance advance = engine_advance(engine, target, take ? EVENTS_INSIDE : EVENTS_INSIDE_BEFORE_END);
    if (advance != ADVANCE_REACHED || !take || engine_flow_may_begin(engine, &engine->live, &level))
        return (int)advance;
    engine_end_run(engine);
    return (int)ADVANCE_ENDED;
}

void run_set(Engine *engine, int bank, size_t index, double value)
{
    engine_set(engine, (Bank)bank, index, value);
}

const double *run_values(Engine *engine, int bank)
{
    return engine_values(engine, VIEW_LIVE, (Bank)bank);
}

const double *run_rows(const Engine *engine, int kind, size_t *count, size_t *width)
{
    return engine_rows(engine, (RowKind)kind, count, width);
}

const Statistics *run_statistics(const Engine *engine)
{
    return engine_statistics(engine);
}

int run_ending(const Engine *engine)
{
    return (int)engine->status->ending;
}

/* Whether the steps of an explicit method have shown that the flow is stiff. */
int run_shows_stiffness(const Engine *engine)
{
    return engine->status->is_stiff;
}

/* Whether there is a method for the flow if it is stiff. */
int run_can_be_stiff(const Engine *engine)
{
    const Model *m = engine->model;
    return m->n_states == 0 || m->quadratures > 0 || engine->implicit.jacobian;
}

double run_time(const Engine *engine)
{
    return engine_time(engine);
}

const char *run_message(const Engine *engine)
{
    return engine_message(engine);
}

void run_free(Engine *engine)
{
    engine_free(engine);
}

/* Evaluates a map of the model (0: rates, 1: outputs, 2: margins) row by row: of t, x, z, u, p there is one row each a
   point.  Returns how many rows were evaluated: fewer than asked for where one fails. */
size_t run_evaluate(Engine *engine, int map, size_t count, const double *const tables[], double *results)
{
    const Model *m = engine->model;
    ModelFunction function = map == 0 ? m->flow : map == 1 ? m->outputs : m->margins;
    size_t widths[MODEL_N_ARG] = {1, m->n_states, m->n_discrete, m->n_inputs, m->n_parameters};
    size_t width = map == 0 ? m->n_states : map == 1 ? m->n_outputs : m->n_margins;
    for (size_t row = 0; row < count; row++) {
        for (size_t i = 0; i < MODEL_N_ARG; i++)
            engine->arg[i] = tables[i] + row * widths[i];
        engine->res[0] = results + row * width;
        if (function(engine->arg, engine->res, engine->iw, engine->w, 0) != 0)
            return row;
    }
    return count;
}
