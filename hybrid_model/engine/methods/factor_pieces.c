/* Memory for series of factors, and when the piece of time that a point is on is over: as soon as a value changes that
   the functions depend on.  held_factors.c makes the series. */
#include <stdlib.h>

#include "chebyshev.h"
#include "method.h"

#define MOST_BYTES 8388608

bool engine_keep_factors(Engine *engine, size_t parts)
{
    const Model *m = engine->model;
    Factors *of = &engine->factors;
    size_t n = m->n_states + m->n_factors;
    if (!m->factors || of->rows)
        return true;
    of->width = PIECE_KEYS + m->n_factor_keys + (N_SERIES + 1) * n;
    size_t most = MOST_BYTES / (of->width * sizeof(double));
    for (of->n_rows = 1; of->n_rows < 2 * parts && 2 * of->n_rows <= most;)
        of->n_rows *= 2;
    of->rows = calloc(of->n_rows * of->width, sizeof(double));
    of->values = malloc((N_NODES * n + m->n_factor_keys + 1) * sizeof(double));
    of->vectors = malloc(N_SERIES * n * sizeof(double));
    of->zeros = calloc(n, sizeof(double));
    of->sums = malloc(N_SERIES * m->n_states * sizeof(double));
    return of->rows && of->values && of->vectors && of->zeros && of->sums;
}

void engine_free_factors(Engine *engine)
{
    free(engine->factors.rows);
    free(engine->factors.values);
    free(engine->factors.vectors);
    free(engine->factors.zeros);
    free(engine->factors.sums);
}

static void forget(const Point *point)
{
    point->progress[FACTORS_BEGIN] = point->progress[FACTORS_END] = point->progress[FACTORS_FOUND] = 0.0;
}

void engine_watch_factors(const Engine *engine, const Point *point, const double *z)
{
    const Model *m = engine->model;
    for (size_t k = 0; k < m->n_factor_keys && m->factor_keys[k] < m->n_discrete; k++)
        if (z[m->factor_keys[k]] != point->z[m->factor_keys[k]]) {
            forget(point);
            return;
        }
}

void engine_note_factors(const Engine *engine, Bank bank, size_t index)
{
    const Model *m = engine->model;
    if (bank == BANK_STATE || m->n_factor_keys == 0)
        return;
    size_t before = bank == BANK_DISCRETE ? 0 : bank == BANK_INPUT ? m->n_discrete : m->n_discrete + m->n_inputs;
    size_t low = 0, high = m->n_factor_keys;
    while (high - low > 1) {
        size_t middle = low + (high - low) / 2;
        if (m->factor_keys[middle] <= before + index)
            low = middle;
        else
            high = middle;
    }
    if (m->factor_keys[low] == before + index)
        forget(&engine->live);
}
