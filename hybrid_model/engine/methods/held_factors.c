/* Steps of quadratures whose rates are affine in values that only jumps change: between jumps those are factors of
   functions of time, w_j(t) in sum_j w_j(t) u_j.

   The functions are integrated once on a piece of time, as Chebyshev series.  Each look ahead from within the piece is
   a sum of these series with the present values: no map is called.  Points with equal parameters share them, as agents
   of a network do whose gates switch together.

   Which piece a point is on follows from its run alone, and so does each series from the piece, whatever was kept: a
   run that is restored goes on as it did. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "chebyshev.h"
#include "method.h"

#define COARSE 2
/* What a coarse series leaves out by its own count is so many times less than what it may be off. */
#define CLOSE 10.0
#define MOST_TRIALS 12
/* A piece is no longer than so many times the one before. */
#define LONGER 10.0
/* From one term to the next those of smooth functions fall by that at least, where a piece is as long as they allow. */
#define FALLS 0.03
/* Sums of series may be larger than the states by that: what cancels in them shows as rounding. */
#define MOST_CANCELLED 100.0
/* Rounding decides about shorter pieces. */
#define SHORTEST 1e6

static size_t series_count(const Model *m)
{
    return m->n_states + m->n_factors;
}

/* The value at a place in z, u and p, one after the other. */
static double value_at(const Engine *engine, const Point *point, size_t place)
{
    const Model *m = engine->model;
    if (place < m->n_discrete)
        return point->z[place];
    place -= m->n_discrete;
    return place < m->n_inputs ? engine->u[place] : engine->p[place - m->n_inputs];
}

/* Begins a piece with what its series depend on. */
static void begin_row(const Engine *engine, const Point *point, double *row)
{
    row[PIECE_BEGIN] = point->progress[FACTORS_BEGIN];
    row[PIECE_END] = point->progress[FACTORS_END];
    row[PIECE_TERMS] = 0.0;
    for (size_t k = 0; k < engine->model->n_factor_keys; k++)
        row[PIECE_KEYS + k] = value_at(engine, point, engine->model->factor_keys[k]);
}

/* The place for a piece among the rows. */
static double *place_of(const Engine *engine, const double *head)
{
    const Factors *of = &engine->factors;
    uint64_t mixed = 0, bits;
    for (size_t k = 0; k < PIECE_KEYS + engine->model->n_factor_keys; k++) {
        memcpy(&bits, &head[k], sizeof bits);
        mixed = (mixed ^ bits) * UINT64_C(0x9E3779B97F4A7C15);
        mixed ^= mixed >> 29;
    }
    return of->rows + of->width * ((size_t)(mixed >> 32) & (of->n_rows - 1));
}

/* The functions at a time, then the rates in front of them. */
static bool evaluate(Engine *engine, const Point *point, double t, double *values)
{
    const Model *m = engine->model;
    engine->statistics.evaluations++;
    return engine_evaluate(engine, m->factors, t, point->x, point->z, values, values + m->n_states);
}

/* The largest of some numbers without their signs; infinite where one is not finite. */
static double largest_of(const double *values, size_t n)
{
    double largest = 0.0;
    for (size_t i = 0; i < n; i++) {
        if (!isfinite(values[i]))
            return INFINITY;
        largest = fabs(values[i]) > largest ? fabs(values[i]) : largest;
    }
    return largest;
}

/* Whether series are those of the rows, but for `close`. */
static bool say_the_same(const double *series, const double *rows, size_t n, double close)
{
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < N_SERIES; k++)
            if (fabs(series[k * n + i] - rows[N_SERIES * i + k]) > close)
                return false;
    return true;
}

/* Makes the series on a piece, whose head is there; the error in units of the tolerance. */
static double make_series(Engine *engine, const Point *point, double *row)
{
    const Model *m = engine->model;
    Factors *of = &engine->factors;
    size_t n = series_count(m), coarse = 0;
    double begin = row[PIECE_BEGIN], end = row[PIECE_END], error = INFINITY, *series = of->vectors;
    double *rows = row + PIECE_KEYS + m->n_factor_keys, *tails = rows + N_SERIES * n;
    for (size_t stride = COARSE, known = 2 * FINEST; stride > 0; known = stride, stride /= 2) {
        for (size_t j = 0; j <= FINEST; j += stride) {
            double t = j == FINEST ? end : begin + engine_node(j) * (end - begin);
            if ((known > FINEST || j % known != 0) && !evaluate(engine, point, t, of->values + j * n))
                return INFINITY;
        }
        size_t n_terms = engine_integrate_series(n, stride, end - begin, of->zeros, of->values, series, tails);
        double size = largest_of(series + n, n * (n_terms - 1)), tail = largest_of(tails, n);
        row[PIECE_TERMS] = (double)n_terms;
        if (!isfinite(size) || !isfinite(tail))
            return INFINITY;
        error = tail > 0.0 ? tail / (engine->options.relative_tolerance * size) : 0.0;
        if (error > 1.0)
            continue;
        /* Coarse nodes may step over a pulse, which the finer ones see. */
        double close = CLOSE * engine->options.relative_tolerance * size;
        if (coarse > 0 && say_the_same(series, rows, n, close)) {
            row[PIECE_TERMS] = (double)coarse;
            return error;
        }
        coarse = n_terms;
        for (size_t i = 0; i < n; i++)
            for (size_t k = 0; k < N_SERIES; k++)
                rows[N_SERIES * i + k] = series[k * n + i];
    }
    return error;
}

/* Finds a piece from the point on whose functions are smooth enough for series, and makes these in its row. */
static void find_piece(Engine *engine, const Point *point, double limit)
{
    double *progress = point->progress, t = *point->time, before = progress[FACTORS_END] - progress[FACTORS_BEGIN];
    double *head = engine->factors.values, span = limit - t;
    if (before > 0.0 && LONGER * before < span)
        span = LONGER * before;
    progress[FACTORS_FOUND] = 0.0;
    for (int trial = 0; trial < MOST_TRIALS && isfinite(span) && span > SHORTEST * engine_time_ulp(t); trial++) {
        progress[FACTORS_BEGIN] = t;
        progress[FACTORS_END] = span >= limit - t ? limit : t + span;
        begin_row(engine, point, head);
        double *row = place_of(engine, head);
        size_t length = (PIECE_KEYS + engine->model->n_factor_keys) * sizeof(double);
        double terms = row[PIECE_TERMS];
        row[PIECE_TERMS] = 0.0;
        bool there = terms > 0.0 && memcmp(row, head, length) == 0;
        if (there) {
            row[PIECE_TERMS] = terms;
            progress[FACTORS_FOUND] = 1.0;
            return;
        }
        memcpy(row, head, length);
        double error = make_series(engine, point, row);
        if (error <= 1.0) {
            progress[FACTORS_FOUND] = 1.0;
            return;
        }
        row[PIECE_TERMS] = 0.0;
        span *= isfinite(error) ? fmin(fmax(0.1, 0.9 * pow(error, -1.0 / (FINEST + 1.0))), 0.7) : 0.1;
    }
    /* No series is looked for again up to there. */
    progress[FACTORS_BEGIN] = t;
    progress[FACTORS_END] = isfinite(limit) ? limit : t;
}

/* The row of the point's piece; NULL if it has none. */
static const double *row_of(Engine *engine, const Point *point)
{
    double *head = engine->factors.values;
    begin_row(engine, point, head);
    double *row = place_of(engine, head);
    size_t length = (PIECE_KEYS + engine->model->n_factor_keys) * sizeof(double);
    head[PIECE_TERMS] = row[PIECE_TERMS];
    if (row[PIECE_TERMS] > 0.0 && memcmp(row, head, length) == 0)
        return row;
    head[PIECE_TERMS] = 0.0;
    memcpy(row, head, length);
    if (make_series(engine, point, row) <= 1.0)
        return row;
    row[PIECE_TERMS] = 0.0;
    return NULL;
}

/* Functions that others share are not written to. */
static void add_series(double *restrict sum, double share, const double *restrict series)
{
    for (size_t k = 0; k < N_SERIES; k++)
        sum[k] += share * series[k];
}

/* Sums the series of a row with the present values into those of the states, and their tails; without constants. */
static void sum_series(Engine *engine, const Point *point, const double *row, double *tails)
{
    const Model *m = engine->model;
    const double *series = row + PIECE_KEYS + m->n_factor_keys, *of_series = series + N_SERIES * series_count(m);
    double *vectors = engine->step.vectors;
    size_t n = m->n_states;
    /* One state's series lies as the vectors do. */
    double *sums = n == 1 ? vectors : engine->factors.sums;
    engine_copy(sums, series, N_SERIES * n);
    engine_copy(tails, of_series, n);
    series += N_SERIES * n;
    for (size_t e = 0; e < m->n_factors; e++, series += N_SERIES) {
        double share = value_at(engine, point, m->held[m->factor_columns[e]]);
        add_series(sums + N_SERIES * m->factor_rows[e], share, series);
        tails[m->factor_rows[e]] += fabs(share) * of_series[n + e];
    }
    for (size_t i = 0; n > 1 && i < n; i++)
        for (size_t k = 0; k < N_SERIES; k++)
            vectors[k * n + i] = sums[N_SERIES * i + k];
}

/* The size of the last two terms of the rates of state i, integrated: what cancels in the sum of all functions is not
   neglected; of what follows less is left, in which nothing need cancel. */
static double tail_of(const Step *step, size_t n, size_t i, double whole)
{
    double tail = 0.0;
    size_t degree = step->n_terms > N_SERIES - FINEST / COARSE ? FINEST : FINEST / COARSE;
    for (size_t k = degree; k <= degree + 1; k++)
        tail += 2.0 * (double)k * fabs(step->vectors[k * n + i]);
    return fmax(tail, FALLS * whole);
}

/* Lets the series begin with the states of the step, and gives its end; whether it is as exact as a step must be. */
static bool place_states(Engine *engine, const Point *point, const double *tails)
{
    Step *step = &engine->step;
    size_t n = engine->model->n_states;
    double span = step->end - step->begin;
    bool later = step->t0 > step->begin;
    if (later)
        engine_series_at(step->vectors, step->n_terms, n, (step->t0 - step->begin) / span, engine->probe_x);
    for (size_t i = 0; i < n; i++)
        step->vectors[i] += step->x0[i] - (later ? engine->probe_x[i] : 0.0);
    engine_series_at(step->vectors, step->n_terms, n, (step->t1 - step->begin) / span, step->x1);
    engine->largest = engine_largest_state(engine, point, step->x1);
    for (size_t i = 0; i < n; i++) {
        double moves = 0.0, size = fmax(fabs(step->x0[i]), fabs(step->x1[i]));
        for (size_t k = 1; k < step->n_terms; k++)
            moves += fabs(step->vectors[k * n + i]);
        bool exact = tail_of(step, n, i, tails[i]) <= engine_error_scale(engine, point, i, size) &&
                     moves <= MOST_CANCELLED * engine_state_size(engine, point, i, size);
        if (!exact || !isfinite(step->x1[i]))
            return false;
    }
    return true;
}

bool engine_knows_factors(const Engine *engine, const Point *point)
{
    return point == &engine->predicted && engine->factors.rows && !engine->model->has_flow_set &&
           !isfinite(engine->options.longest_step);
}

/* What is found out from the live point's own place is the live point's. */
static void share_piece(const Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    bool same = *engine->live.time == *point->time;
    for (size_t k = 0; same && k < m->n_factor_keys && m->factor_keys[k] < m->n_discrete; k++)
        same = engine->live.z[m->factor_keys[k]] == point->z[m->factor_keys[k]];
    for (size_t i = FACTORS_BEGIN; same && i <= FACTORS_FOUND; i++)
        engine->live.progress[i] = point->progress[i];
}

bool engine_step_of_factors(Engine *engine, const Point *point, double limit)
{
    Step *step = &engine->step;
    double *progress = point->progress, t = *point->time;
    if (!engine_knows_factors(engine, point))
        return false;
    if (!(t >= progress[FACTORS_BEGIN] && t < progress[FACTORS_END])) {
        find_piece(engine, point, limit);
        share_piece(engine, point);
    }
    const double *row = progress[FACTORS_FOUND] > 0.0 ? row_of(engine, point) : NULL;
    if (!row)
        return false;
    step->begin = progress[FACTORS_BEGIN];
    step->end = progress[FACTORS_END];
    step->t1 = fmin(limit, step->end);
    step->n_terms = (size_t)row[PIECE_TERMS];
    bool whole = step->t1 - step->t0 > 0.5 * (step->end - step->begin);
    step->n_windows = whole && step->n_terms > N_SERIES - FINEST / COARSE ? COARSE : 1;
    sum_series(engine, point, row, engine->quadrature.tails);
    *point->step = step->t1 - step->t0;
    return place_states(engine, point, engine->quadrature.tails);
}
