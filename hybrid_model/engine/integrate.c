/* The steps of a flow: their length by the error that the method estimates, whichever method it is.

   Step control after E. Hairer, S. P. Norsett, G. Wanner, "Solving Ordinary Differential Equations I", section II.4. */
#include <math.h>
#include <string.h>

#include "method.h"

/* A step that costs the same however long it is goes so many times as far as the flow before the last jump went: most
   next events are within it, and not far from its start. */
#define BEYOND_NEXT 2.0
/* No step is shorter than so many floats of time.  Across a jump of the rates its error is what those floats leave
   open, and up to so many tolerances it counts as none: a state near zero has small ones.  What is smooth but too fast
   for such a step has an error of the order of the state, 1e13 tolerances. */
#define SHORTEST 16.0
#define LEFT_OPEN 1e6
/* From one step to the next. */
#define MOST_GROWTH 10.0

static bool begin_with_rates(Engine *engine, const Point *point)
{
    const Model *m = engine->model;
    Step *step = &engine->step;
    double t = *point->time;
    if (step->has_rates[0])
        return true;
    step->has_rates[0] = true;
    if (!engine_rates(engine, t, point->x, point->z, step->k[0]))
        return false;
    for (size_t i = 0; i < m->n_states; i++)
        if (!isfinite(step->k[0][i]))
            return engine_fail(
                engine, ENDED_NOT_FINITE,
                "The derivative of '%s' is %g at t = %.17g where '%s' = %.17g; derivatives must be finite. "
                "Remedy: check the flow map and the parameters.",
                NAME_AT(m->names, m->state_names[i]), step->k[0][i], t, NAME_AT(m->names, m->state_names[i]),
                point->x[i]);
    return true;
}

bool engine_step_begin(Engine *engine, const Point *point)
{
    Step *step = &engine->step;
    step->t0 = step->t1 = *point->time;
    step->x0 = point->x;
    step->has_vectors = step->has_rates[0] = false;
    engine_choose_method(engine);
    return (engine->method->knows && engine->method->knows(engine, point)) || begin_with_rates(engine, point);
}

static bool step_too_small(Engine *engine, const Point *point, double h, bool finite)
{
    const char *name = NAME_AT(engine->model->names, engine->model->state_names[engine->suspect]);
    double value = point->x[engine->suspect];
    if (!finite)
        return engine_fail(
            engine, ENDED_NOT_FINITE,
            "'%s' = %.17g does not stay finite beyond t = %.17g. Remedy: check the flow map for a division "
            "by zero or a finite escape time, or keep the state in a flow set; trial steps look a little outside of "
            "it, where np.maximum(%s, 0) keeps a root defined.",
            name, value, *point->time, name);
    return engine_too_small(engine, point, h);
}

/* The proposal for the step after one of the length `used` where `h` was possible. */
static double next_step(const Method *method, double h, double used, double error, bool rejected)
{
    /* A step cut short by the limit says little about the next one, and no root need be taken. */
    if (used * MOST_GROWTH <= h)
        return h;
    double growth = error > 0.0 ? fmin(MOST_GROWTH, 0.9 * pow(error, -1.0 / method->order)) : MOST_GROWTH;
    double proposal = used * (rejected ? fmin(1.0, growth) : fmax(0.2, growth));
    return used < h ? fmax(h, proposal) : proposal;
}

/* The length of a step before which there is none since the last jump or change. */
static bool length_after_jump(Engine *engine, const Point *point, double limit, double *h)
{
    double stride = engine->status->stride, largest = engine_largest_state(engine, point, point->x);
    *h = fmax(BEYOND_NEXT * stride, engine->model->scales.first_least * engine_time_ulp(*point->time));
    if (stride > 0.0 && engine->method->remembers)
        return true;
    if (!engine_first_step(engine, point, limit, largest, h))
        return false;
    *h = fmax(*h, fmin(stride, engine->model->scales.first_growth * *h));
    return true;
}

/* Whether a step of the length `longest` is rejected for what rounding of its rates leaves open, which is allowed from
   now on.  It is asked seldom: crossing a jump of the rates costs many rejections. */
static bool rounding_found(Engine *engine, const Point *point, double longest, bool shortest, size_t rejections)
{
    bool is_time = shortest ? rejections == 0 : rejections == 1 || rejections == 4 || rejections == 16;
    Rounding *rounding = &engine->rounding;
    if (rounding->decides || !is_time || !engine_rounding_decides(engine, point, longest))
        return false;
    engine->statistics.rejected++;
    return rounding->decides = true;
}

bool engine_step_accept(Engine *engine, const Point *point, double limit)
{
    Step *step = &engine->step;
    const Method *method = engine->method;
    double t0 = *point->time, remaining = limit - t0, h = *point->step, shortest = SHORTEST * engine_time_ulp(t0);
    double longest = 0.0;
    size_t rejections = 0;
    engine->rounding.decides = false;
    step->is_known = method->known && method->known(engine, point, limit);
    if (step->is_known) {
        step->has_rates[1] = step->has_vectors = false;
        engine->statistics.steps++;
        return engine_gets_on(engine, point, limit);
    }
    if (!begin_with_rates(engine, point))
        return false;
    step->has_rates[1] = true;
    if (h <= 0.0 && !length_after_jump(engine, point, limit, &h))
        return false;
    h = fmin(h, engine->options.longest_step);
    for (;;) {
        /* The last two steps share what remains, so that no sliver is left. */
        bool whole = h >= remaining;
        double used = whole ? remaining : 2.0 * h > remaining ? 0.5 * remaining : h;
        step->t1 = whole ? limit : t0 + used;
        used = step->t1 - t0;
        step->begin = t0;
        step->end = step->t1;
        double error;
        step->n_terms = method->n_vectors;
        step->n_windows = 1;
        if (!method->trial(engine, point, &error))
            return false;
        if (error > 1.0)
            longest = fmax(longest, used > shortest ? used : MOST_GROWTH * used);
        if (error > 1.0 && isfinite(error) &&
            rounding_found(engine, point, longest, used <= shortest, rejections)) {
            h = longest;
            rejections = 0;
            continue;
        }
        if (error <= 1.0 || (used <= shortest && error <= LEFT_OPEN)) {
            *point->step = error <= 1.0 ? next_step(method, h, used, error, rejections > 0) : used;
            step->has_vectors = false;
            engine->rounding.decides = false;
            engine->statistics.steps++;
            engine_watch_stiffness(engine, point);
            return engine_gets_on(engine, point, limit);
        }
        h = used * (isfinite(error) ? fmax(0.1, 0.9 * pow(error, -1.0 / method->order)) : 0.1);
        rejections++;
        engine->statistics.rejected++;
        if (h >= shortest && t0 + h > t0)
            continue;
        if (isfinite(error) && engine_raise_floor(engine, point, limit)) {
            if (!engine_first_step(engine, point, limit, engine_largest_state(engine, point, point->x), &h))
                return false;
        } else if (isfinite(error) && used > shortest) {
            h = shortest;
        } else {
            return step_too_small(engine, point, h, isfinite(error));
        }
    }
}

void engine_step_commit(Engine *engine, const Point *point)
{
    Step *step = &engine->step;
    double *last = step->k[N_STAGES - 1];
    *point->time = step->t1;
    memcpy(point->x, step->x1, engine->model->n_states * sizeof(double));
    engine_note_sizes(engine, point);
    /* The last stage is the first one of the next step. */
    step->k[N_STAGES - 1] = step->k[0];
    step->k[0] = last;
    step->has_rates[0] = step->has_rates[1];
    step->t0 = step->t1;
    step->has_vectors = false;
    engine_choose_method(engine);
}

bool engine_step_probe(Engine *engine, const Point *point, double t)
{
    engine->statistics.probes++;
    return engine->method->probe(engine, point, t);
}
