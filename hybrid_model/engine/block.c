/* The memory of an engine: the block that evolves, the scratch beside it, and messages. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "chebyshev.h"
#include "method.h"

/* A full matrix of more rows costs more than it spares, unless the author wishes it. */
#define MOST_STATES_TO_SHOW 100

/* Hands out pieces of one allocation; without memory it only counts. */
typedef struct {
    unsigned char *memory;
    size_t used;
} Cursor;

static void *take(Cursor *cursor, size_t size)
{
    void *place = cursor->memory ? cursor->memory + cursor->used : NULL;
    cursor->used += (size + 15) / 16 * 16;
    return place;
}

static size_t point_length(const Model *m)
{
    return 2 + m->n_states + m->n_discrete + m->n_margins + 1 + m->n_states + N_PROGRESS;
}

static Point take_point(Cursor *cursor, const Model *m)
{
    double *values = take(cursor, point_length(m) * sizeof(double));
    if (!values)
        return (Point){NULL, NULL, NULL, NULL, NULL, NULL, NULL};
    double *x = values + 2, *z = x + m->n_states, *level = z + m->n_discrete, *size = level + m->n_margins + 1;
    return (Point){values, values + 1, x, z, level, size, size + m->n_states};
}

/* Lays out the block; called once with no memory, to learn the size. */
static size_t lay_out_block(Engine *engine, unsigned char *memory)
{
    const Model *m = engine->model;
    Cursor cursor = {memory, 0};
    engine->wrapper = take(&cursor, engine->wrapper_size);
    engine->status = take(&cursor, sizeof(Status));
    engine->live = take_point(&cursor, m);
    engine->predicted = take_point(&cursor, m);
    engine->u = take(&cursor, m->n_inputs * sizeof(double));
    engine->p = take(&cursor, m->n_parameters * sizeof(double));
    engine->history = take(&cursor, m->n_jumps * sizeof(JumpHistory));
    engine->ticked = take(&cursor, m->n_jumps);
    engine->inner_rates = take(&cursor, m->n_states * sizeof(double));
    engine->segment = take(&cursor, engine->method->n_vectors * m->n_states * sizeof(double));
    return cursor.used;
}

size_t engine_seed_count(const Model *m)
{
    return 1 + 3 * m->n_states + 2 * m->n_discrete + m->n_inputs + m->n_parameters + m->n_outputs;
}

bool engine_may_show_stiffness(const Model *m)
{
    return m->stiffness == STIFFNESS_UNKNOWN && m->quadratures == 0 && m->n_states <= MOST_STATES_TO_SHOW;
}

/* What a method for stiff flows needs, where the model has derivatives for it. */
static void lay_out_implicit(Engine *engine, Cursor *cursor)
{
    const Model *m = engine->model;
    size_t n = m->n_states, vector = n * sizeof(double);
    Implicit *of = &engine->implicit;
    bool wanted = m->stiffness == STIFFNESS_DECLARED || engine_may_show_stiffness(m);
    if (n == 0 || m->quadratures > 0 || !(m->jacobian || (m->forward && wanted)))
        return;
    of->jacobian = take(cursor, n * vector);
    of->matrix = take(cursor, n * vector);
    of->drift = take(cursor, vector);
    of->pivots = take(cursor, n * sizeof(size_t));
    of->stages = take(cursor, STAGES_OF_RODAS * vector);
    of->probe_stages = take(cursor, STAGES_OF_RODAS * vector);
}

static void lay_out_quadrature(Engine *engine, Cursor *cursor)
{
    size_t vector = engine->model->n_states * sizeof(double), levels = engine->model->quadratures;
    if (levels == 0)
        return;
    engine->quadrature.rates = take(cursor, N_NODES * vector);
    engine->quadrature.states = take(cursor, levels > 1 ? N_NODES * vector : 0);
    engine->quadrature.series = take(cursor, N_SERIES * vector);
    engine->quadrature.tails = take(cursor, vector);
}

static void lay_out_rounding(Engine *engine, Cursor *cursor)
{
    const Model *m = engine->model;
    size_t vector = m->n_states * sizeof(double);
    engine->rounding.rates = take(cursor, vector);
    engine->rounding.turned = take(cursor, vector);
    for (size_t k = 0; k < sizeof engine->rounding.seen / sizeof *engine->rounding.seen; k++)
        engine->rounding.seen[k] = take(cursor, vector);
    for (size_t k = 0; k < sizeof engine->rounding.differences / sizeof *engine->rounding.differences; k++)
        engine->rounding.differences[k] = take(cursor, vector);
    engine->rounding.moved =
        take(cursor, (1 + m->n_states + m->n_discrete + m->n_inputs + m->n_parameters) * sizeof(double));
}

static size_t lay_out_scratch(Engine *engine, unsigned char *memory)
{
    const Model *m = engine->model;
    size_t vector = m->n_states * sizeof(double), rows = m->n_margins + 1;
    Cursor cursor = {memory, 0};
    engine->arg = take(&cursor, (m->n_arg + MODEL_MAX_ARG) * sizeof(double *));
    engine->res = take(&cursor, (m->n_res + MODEL_MAX_RES) * sizeof(double *));
    engine->iw = take(&cursor, m->n_iw * sizeof(long long));
    engine->w = take(&cursor, m->n_w * sizeof(double));
    engine->step.x1 = take(&cursor, vector);
    for (size_t s = 0; s < N_STAGES; s++) {
        engine->step.k[s] = take(&cursor, vector);
        engine->probe_k[s] = take(&cursor, vector);
    }
    engine->step.vectors = take(&cursor, engine->method->n_vectors * vector);
    lay_out_implicit(engine, &cursor);
    lay_out_quadrature(engine, &cursor);
    lay_out_rounding(engine, &cursor);
    engine->probe_x = take(&cursor, vector);
    engine->dense_x = take(&cursor, vector);
    engine->margins = take(&cursor, rows * sizeof(double));
    engine->enabled = take(&cursor, rows * sizeof(double));
    engine->times = take(&cursor, m->n_times * sizeof(double));
    engine->times_of = take(&cursor, (m->n_discrete + m->n_parameters) * sizeof(double));
    engine->samples = take(&cursor, N_SAMPLES * rows * sizeof(double));
    engine->sampled_x = take(&cursor, N_SAMPLES * vector);
    engine->outputs = take(&cursor, m->n_outputs * sizeof(double));
    engine->rates = take(&cursor, vector);
    engine->indicators = take(&cursor, rows * sizeof(double));
    engine->slopes = take(&cursor, 2 * (m->n_states + m->n_outputs) * sizeof(double));
    engine->unit = take(&cursor, engine_seed_count(m) * sizeof(double));
    for (size_t i = 0; i < 2; i++)
        engine->seeds[i] = take(&cursor, engine_seed_count(m) * sizeof(double));
    engine->is_guard = take(&cursor, rows);
    engine->reset = take_point(&cursor, m);
    engine->shown = take_point(&cursor, m);
    return cursor.used;
}

bool engine_take_memory(Engine *engine)
{
    engine->block_size = lay_out_block(engine, NULL);
    engine->block = calloc(1, engine->block_size);
    engine->scratch = calloc(1, lay_out_scratch(engine, NULL));
    if (!engine->block || !engine->scratch)
        return false;
    lay_out_block(engine, engine->block);
    lay_out_scratch(engine, engine->scratch);
    return true;
}

void engine_use_block(Engine *engine, void *block)
{
    engine->block = block;
    lay_out_block(engine, engine->block);
    engine->view = VIEW_NONE;
}

void engine_free(Engine *engine)
{
    if (!engine)
        return;
    for (size_t i = 0; i < N_ROW_KINDS; i++)
        free(engine->rows[i].values);
    engine_free_factors(engine);
    free(engine->block);
    free(engine->scratch);
    free(engine);
}

void *engine_wrapper(Engine *engine)
{
    return engine->wrapper;
}

void engine_copy_point(const Engine *engine, const Point *from, const Point *to)
{
    engine_copy(to->time, from->time, point_length(engine->model));
}

size_t engine_block_size(const Engine *engine)
{
    return engine->block_size;
}

void engine_save(Engine *engine, void *block)
{
    engine_catch_up(engine);
    memcpy(block, engine->block, engine->block_size);
}

void engine_restore(Engine *engine, const void *block)
{
    memcpy(engine->block, block, engine->block_size);
    engine->view = VIEW_NONE;
}

void *engine_wrapper_in(const Engine *engine, void *block)
{
    Engine other = *engine;
    lay_out_block(&other, block);
    return other.wrapper;
}

static bool all_finite(const double *values, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (!isfinite(values[i]))
            return false;
    return true;
}

/* Time, step and states are numbers; a level is one, or infinite where a margin is. */
static bool point_is_sound(const Model *m, const Point *point)
{
    bool sound = all_finite(point->time, 2 + m->n_states + m->n_discrete) && *point->step >= 0.0;
    for (size_t i = 0; i <= m->n_margins; i++)
        sound = sound && !isnan(point->level[i]);
    return sound && all_finite(point->size, m->n_states + N_PROGRESS);
}

static bool segment_is_sound(const Engine *engine)
{
    const Status *status = engine->status;
    bool sound =
        status->segment_terms <= engine->method->n_vectors && isfinite(status->segment_begin) &&
        isfinite(status->segment_end) && status->segment_begin < status->segment_end &&
        isfinite(status->segment_span) && status->segment_span > 0.0 && status->segment_quiet <= status->segment_end;
    sound = sound && all_finite(engine->segment, engine->method->n_vectors * engine->model->n_states);
    return (sound || !status->has_segment) && !status->behind;
}

bool engine_block_is_sound(const Engine *engine, void *block)
{
    const Model *m = engine->model;
    Engine other = *engine;
    if (!block)
        return false;
    lay_out_block(&other, block);
    const Status *status = other.status;
    bool sound =
        status->ending >= ENDED_NOT && status->ending <= ENDED_JUMPS && status->prediction >= PREDICTION_NONE &&
        status->prediction <= PREDICTION_STEP && memchr(status->message, '\0', sizeof status->message) != NULL &&
        isfinite(status->start_time) && status->floor >= 0.0 && isfinite(status->floor) && !isnan(status->stop_time) &&
        isfinite(status->jumps_time) && isfinite(status->recent_time) &&
        (status->is_stiff == 0 || status->is_stiff == 1);
    for (size_t i = 0; i < N_RECENT; i++)
        sound = sound && status->recent[i] < (m->n_jumps > 0 ? m->n_jumps : 1);
    for (size_t j = 0; j < m->n_jumps; j++)
        sound = sound && other.history[j].stored <= N_ZENO_TIMES;
    return sound && point_is_sound(m, &other.live) && point_is_sound(m, &other.predicted) &&
           all_finite(other.u, m->n_inputs) && all_finite(other.p, m->n_parameters) &&
           all_finite(other.inner_rates, m->n_states) && segment_is_sound(&other);
}
