/* What a run leaves: its steps with their interpolation and its jumps with both sides, in flat growing rows. */
#include <stdlib.h>
#include <string.h>

#include "method.h"

#define FIRST_ROWS 64
#define BEFORE_STATES 3       /* numbers in a row before those of the states */

void engine_record(Engine *engine, RecordKind kind)
{
    const Model *m = engine->model;
    engine->record = kind;
    engine->rows[ROWS_OF_STEPS].width = BEFORE_STATES + (1 + engine->method->n_vectors) * m->n_states;
    engine->rows[ROWS_OF_JUMPS].width = BEFORE_STATES + 2 * (m->n_states + m->n_discrete);
    for (size_t i = 0; i < N_ROW_KINDS; i++)
        engine->rows[i].count = 0;
}

const double *engine_rows(const Engine *engine, RowKind kind, size_t *count, size_t *width)
{
    *count = engine->rows[kind].count;
    *width = engine->rows[kind].width;
    return engine->rows[kind].values;
}

/* The place of another row; NULL without memory. */
static double *add_row(Engine *engine, RowKind kind)
{
    Rows *rows = &engine->rows[kind];
    if (rows->count == rows->capacity) {
        size_t capacity = rows->capacity > 0 ? 2 * rows->capacity : FIRST_ROWS;
        double *values = realloc(rows->values, capacity * rows->width * sizeof(double));
        if (!values) {
            engine_fail(engine, ENDED_FAILED,
                        "No memory is left for what a run of '%s' leaves, at t = %.17g s after %zu rows of %zu bytes. "
                        "Remedy: end the run earlier, or keep its events only (record=\"events\").",
                        engine->model->name, *engine->live.time, rows->count, rows->width * sizeof(double));
            return NULL;
        }
        rows->values = values;
        rows->capacity = capacity;
    }
    return rows->values + rows->width * rows->count++;
}

/* A row of the present step without its vectors; NULL where none is to be kept, or there is no memory for it. */
static double *step_row(Engine *engine, double t1, double end, const double *x)
{
    double *row = add_row(engine, ROWS_OF_STEPS);
    if (!row)
        return NULL;
    row[0] = engine->step.t0;
    row[1] = t1;
    row[2] = end;
    engine_copy(row + BEFORE_STATES, x, engine->model->n_states);
    return row;
}

bool engine_record_step(Engine *engine, double end, const double *x)
{
    size_t n = engine->model->n_states;
    if (engine->record != RECORD_ALL)
        return true;
    double *row = step_row(engine, engine->step.t1, end, x);
    if (row)
        engine_copy(row + BEFORE_STATES + n, engine_step_vectors(engine), engine->method->n_vectors * n);
    return row != NULL;
}

bool engine_record_line(Engine *engine, double end, const double *x)
{
    size_t n = engine->model->n_states;
    if (engine->record != RECORD_ALL)
        return true;
    double *row = step_row(engine, end, end, x);
    if (row)
        engine->method->straight(engine->step.x0, x, n, row + BEFORE_STATES + n);
    return row != NULL;
}

bool engine_record_jump(Engine *engine, size_t jump)
{
    size_t size = engine->model->n_states + engine->model->n_discrete;
    if (engine->record == RECORD_NOTHING)
        return true;
    double *row = add_row(engine, ROWS_OF_JUMPS);
    if (!row)
        return false;
    row[0] = (double)engine->rows[ROWS_OF_STEPS].count;
    row[1] = *engine->live.time;
    row[2] = (double)jump;
    engine_copy(row + BEFORE_STATES, engine->live.x, size);
    engine_copy(row + BEFORE_STATES + size, engine->reset.x, size);
    return true;
}
