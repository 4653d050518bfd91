/* How much of the rates is rounding: where large terms cancel, no step is as exact as small states ask for (rule 12 of
   docs/semantics.md).  It decides as hybrid_model/reference/rounding.py does.

   Rates are looked at along three short lines. Their slope tells how large the terms are that a rate is a sum of,
   and so how they are rounded, if it is the same in both halves, as it is not at a jump of the rates. Points are so
   near to each other that what is smooth has no second differences; what there is of them is rounding, which the
   slope does not show of terms that depend on time alone: J. J. More, S. M. Wild, "Estimating computational noise",
   SIAM Journal on Scientific Computing 33, 2011. A jump looks alike, but is not on all of the lines. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "parts.h"

/* The variance of a second difference of numbers that differ at random is so many times theirs. */
#define OF_SECOND_DIFFERENCES 6.0

/* What the flow map is given, by the places of its arguments. */
typedef struct {
    const double *values[MODEL_N_ARG];
    size_t lengths[MODEL_N_ARG];
} Given;

enum { ARG_TIME, ARG_STATES, ARG_DISCRETE };

static Given given_at(const Engine *engine, const double *t, const double *x, const double *z)
{
    const Model *m = engine->model;
    return (Given){{t, x, z, engine->u, engine->p},
                   {1, m->n_states, m->n_discrete, m->n_inputs, m->n_parameters}};
}

/* Which way a number is moved on a line: no simple sum of numbers hides from all of them. */
static double way_of(size_t line, size_t place)
{
    double turns = (double)place * 0.6180339887498949, weight = 1.0 - 0.5 * (turns - floor(turns));
    bool back = line == 1 ? place % 2 == 1 : line == 2 && place % 4 >= 2;
    return back ? -weight : weight;
}

/* Moves time by `later`, and all else that the rates depend on by a part of itself, but for integers, which count or
   choose. */
static void move(const Engine *engine, const Given *given, size_t line, double later, double part,
                 const double **arguments)
{
    double *moved = engine->rounding.moved;
    for (size_t a = 0, place = 0; a < MODEL_N_ARG; a++) {
        arguments[a] = moved;
        for (size_t i = 0; i < given->lengths[a]; i++, place++) {
            double value = given->values[a][i];
            bool stays = a == ARG_DISCRETE && engine->model->whole[i];
            *moved++ = a == ARG_TIME ? fmin(value + later, engine->status->stop_time)
                       : stays       ? value
                                     : value + part * way_of(line, place) * value;
        }
    }
}

static bool rates_of(Engine *engine, const double *const arguments[MODEL_N_ARG], double *rates)
{
    engine->statistics.evaluations++;
    memcpy(engine->arg, arguments, MODEL_N_ARG * sizeof *arguments);
    engine->res[0] = rates;
    return engine->model->flow(engine->arg, engine->res, engine->iw, engine->w, 0) == 0;
}

/* The rounding that the slope along a line shows of rate i. */
static double by_slope(const Engine *engine, size_t i)
{
    double *const *seen = engine->rounding.seen;
    double middle = seen[ON_LINE / 2][i], half = middle - seen[0][i], other = seen[ON_LINE - 1][i] - middle;
    double whole = fabs(half + other);
    bool steady = fabs(other - half) <= engine->model->scales.steady * whole;
    return steady ? whole * DBL_EPSILON / ((ON_LINE - 1) * engine->model->scales.seen_part) : 0.0;
}

/* What second differences along a line show of it. */
static double by_differences(const Engine *engine, size_t i)
{
    double *const *seen = engine->rounding.seen, sum = 0.0;
    for (size_t k = 2; k < ON_LINE; k++) {
        double second = seen[k][i] - seen[k - 1][i] - (seen[k - 1][i] - seen[k - 2][i]);
        sum += second * second;
    }
    return sqrt(sum / ((ON_LINE - 2) * OF_SECOND_DIFFERENCES));
}

/* Looks along a line, which begins where the one before has ended. */
static bool look(Engine *engine, const Given *given, size_t line, double later)
{
    Rounding *of = &engine->rounding;
    const double *arguments[MODEL_N_ARG];
    for (size_t k = 0; k < ON_LINE; k++) {
        double along = (double)(line * ON_LINE + k);
        move(engine, given, line, along * later, along * engine->model->scales.seen_part, arguments);
        if (!rates_of(engine, arguments, of->seen[k]))
            return false;
    }
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double slope = by_slope(engine, i);
        of->differences[line][i] = by_differences(engine, i);
        of->rates[i] = line == 0 ? slope : fmax(of->rates[i], slope);
    }
    return true;
}

bool engine_find_rounding(Engine *engine, double t, const double *x, const double *z, double h)
{
    Rounding *of = &engine->rounding;
    Given given = given_at(engine, &t, x, z);
    double later = engine->model->scales.seen_part * fmax(h, t - engine->status->start_time);
    for (size_t line = 0; line < N_LINES; line++)
        if (!look(engine, &given, line, fmax(later, engine_time_ulp(t))))
            return false;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double least = fmin(fmin(of->differences[0][i], of->differences[1][i]), of->differences[2][i]);
        of->rates[i] = fmax(of->rates[i], least);
        if (!isfinite(of->rates[i]))
            of->rates[i] = 0.0;
    }
    return true;
}

/* How fast the flow takes back by itself what rounding has moved in a step of `h`. */
static bool find_turns(Engine *engine, const Point *point, double h)
{
    Rounding *of = &engine->rounding;
    const double *here = engine->step.k[0];
    const double *arguments[MODEL_N_ARG] = {point->time, of->moved, point->z, engine->u, engine->p};
    for (size_t i = 0; i < engine->model->n_states; i++)
        of->moved[i] = point->x[i] + h * of->rates[i];
    if (!rates_of(engine, arguments, of->seen[0]))
        return false;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double by = h * of->rates[i], change = fabs(of->seen[0][i] - here[i]);
        of->turned[i] = by > 0.0 && isfinite(change) ? change / by : 0.0;
    }
    return true;
}

bool engine_rounding_decides(Engine *engine, const Point *point, double h)
{
    if (!engine_find_rounding(engine, *point->time, point->x, point->z, h) || !find_turns(engine, point, h))
        return false;
    for (size_t i = 0; i < engine->model->n_states; i++)
        if (engine_left_by_rounding(engine, i, h) > engine_error_scale(engine, point, i, fabs(point->x[i])))
            return true;
    return false;
}
