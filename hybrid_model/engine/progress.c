/* Whether a flow gets on: its pace, and whether it chatters about a jump of its rates (rule 13 of docs/semantics.md).
   It decides as hybrid_model/reference/progress.py and discontinuities.py do.

   Steps cross a jump of the rates that they meet once after some rejections; where the flow on both sides leads back to
   it, as with a relay, no step leads away from it. */
#include <math.h>
#include <stdio.h>

#include "parts.h"

/* A point on the straight way from (t, x) with the rates there; rates[row] is what is looked at. */
typedef struct {
    double t, *x, *rates;
} Side;

/* A jump of the rate of a state: two points next to each other between which it jumps, the time between them, and the
   rates a little before and after. */
typedef struct {
    size_t row;
    double gap, before, after;
    Side near, far;
} JumpOfRates;

#define REMEDY                                                                                                         \
    "Remedy: write what jumps as modes with a switch (hm.ModalAutomaton, hm.Switch), with a mode of its own for what " \
    "stays at that surface, as sticking does; or let a jump happen there."

static bool evaluate(Engine *engine, const Point *point, Side *side)
{
    return engine_rates(engine, fmin(side->t, engine->status->stop_time), side->x, point->z, side->rates);
}

/* to = from + time * the rates there. */
static void go_straight(const Engine *engine, const Side *from, double time, Side *to)
{
    to->t = from->t + time;
    for (size_t i = 0; i < engine->model->n_states; i++)
        to->x[i] = from->x[i] + time * from->rates[i];
}

/* The middle of two points; whether it is another state than both. */
static bool halve(const Engine *engine, const Side *a, const Side *b, Side *middle)
{
    bool off_a = false, off_b = false;
    middle->t = a->t + 0.5 * (b->t - a->t);
    for (size_t i = 0; i < engine->model->n_states; i++) {
        middle->x[i] = a->x[i] + 0.5 * (b->x[i] - a->x[i]);
        off_a = off_a || middle->x[i] != a->x[i];
        off_b = off_b || middle->x[i] != b->x[i];
    }
    return off_a && off_b;
}

/* The state whose rate changes most between two points, in units of the error allowed. */
static size_t greatest_change(Engine *engine, const Point *point, const Side *a, const Side *b)
{
    size_t row = 0;
    double most = 0.0;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double change = fabs(b->rates[i] - a->rates[i]) / engine_error_scale(engine, point, i, fabs(a->x[i]));
        if (change > most) {
            most = change;
            row = i;
        }
    }
    return row;
}

/* Halves what lies between two points, always with the half in which the rate changes more. */
static bool narrow(Engine *engine, const Point *point, JumpOfRates *jump, Side *spare)
{
    const ModelScales *scales = &engine->model->scales;
    Side *a = &jump->near, *b = &jump->far;
    size_t row = jump->row;
    double least = scales->retained * fabs(jump->after - jump->before), halvings = 0.0;
    jump->gap = b->t - a->t;
    while (halvings < scales->halvings_most) {
        bool moved = halve(engine, a, b, spare);
        if (!moved && !(a->t < spare->t && spare->t < b->t))
            break;
        if (!evaluate(engine, point, spare))
            return false;
        double first = fabs(spare->rates[row] - a->rates[row]), second = fabs(b->rates[row] - spare->rates[row]);
        if (!(fmax(first, second) >= least))
            return false;
        Side *replaced = first >= second ? b : a, kept = *replaced;
        *replaced = *spare;
        *spare = kept;
        halvings += 1.0;
        jump->gap *= moved ? 0.5 : 1.0;
    }
    return halvings >= scales->halvings_least;
}

/* Whether the rates jump on the straight way ahead of (t, x), in the next `time` seconds but within the run, and not
   only change fast: a change that is smooth shrinks with the distance. */
static bool jump_ahead(Engine *engine, const Point *point, const Side *here, double time, JumpOfRates *jump,
                       Side *spare)
{
    double t1 = fmin(here->t + time, engine->status->stop_time);
    jump->near = *here;
    if (!(t1 > here->t) || !evaluate(engine, point, &jump->near))
        return false;
    go_straight(engine, &jump->near, t1 - here->t, &jump->far);
    jump->far.t = t1;
    if (!evaluate(engine, point, &jump->far))
        return false;
    jump->row = greatest_change(engine, point, &jump->near, &jump->far);
    jump->before = jump->near.rates[jump->row];
    jump->after = jump->far.rates[jump->row];
    return fabs(jump->after - jump->before) > 0.0 && narrow(engine, point, jump, spare);
}

/* Whether in that time the flow leads from one side of a jump to the other. */
static bool leads_to(Engine *engine, const Point *point, const Side *from, const Side *to, size_t row, double time,
                     Side *spare)
{
    go_straight(engine, from, time, spare);
    return evaluate(engine, point, spare) &&
           fabs(spare->rates[row] - to->rates[row]) < fabs(spare->rates[row] - from->rates[row]);
}

static bool leads_back(Engine *engine, const Point *point, const JumpOfRates *jump, double longest, Side *spare)
{
    for (size_t i = 0; i < N_AWAY; i++) {
        double time = engine->model->scales.away[i] * jump->gap;
        if (time <= longest && leads_to(engine, point, &jump->near, &jump->far, jump->row, time, spare) &&
            leads_to(engine, point, &jump->far, &jump->near, jump->row, time, spare))
            return true;
    }
    return false;
}

/* Whether rounding alone makes such a jump: sums of large terms that cancel are as rough. */
static bool is_rounding(Engine *engine, const Point *point, const JumpOfRates *jump, double time)
{
    const Side *near = &jump->near;
    double least = engine_find_rounding(engine, near->t, near->x, point->z, time)
                       ? engine->model->scales.left_by_rounding * engine->rounding.rates[jump->row]
                       : 0.0;
    return fabs(jump->after - jump->before) <= least;
}

/* Places for three points; what is probed on a step comes later. */
static Side take_side(Engine *engine, size_t i, double t, const double *x)
{
    Side side = {t, engine->probe_k[2 * i + 1], engine->probe_k[2 * i + 2]};
    engine_copy(side.x, x, engine->model->n_states);
    return side;
}

static bool find_jump(Engine *engine, const Point *point, double t, const double *x, double time,
                      JumpOfRates *jump, Side *spare)
{
    Side here = take_side(engine, 0, t, x);
    jump->far = take_side(engine, 1, t, x);
    *spare = take_side(engine, 2, t, x);
    return engine->model->n_states > 0 && jump_ahead(engine, point, &here, time, jump, spare) &&
           !is_rounding(engine, point, jump, time);
}

/* "the rate of 'v' jumps from -2 to 2 where its value is 0" */
static const char *describe(const Engine *engine, const JumpOfRates *jump, char *text, size_t size)
{
    char name[NAME_SIZE];
    engine_name(engine->model->names, engine->model->state_names[jump->row], name);
    snprintf(text, size, "the rate of '%s' jumps from %.6g to %.6g where its value is %.9g", name, jump->before,
             jump->after, jump->near.x[jump->row]);
    return text;
}

/* Whether at the pace of the last `steps` steps the run comes to its end, if that is known, with not many more. */
static bool soon_over(const Engine *engine, const Point *point, double steps)
{
    double t = engine->step.t1, pace = (t - point->progress[LOOKS_BEGIN]) / steps;
    return engine->status->stop_time - t <= engine->model->scales.sliding_left * pace;
}

static void begin_looks(const Point *point, double steps, double t)
{
    point->progress[LOOKS_STEPS] = steps;
    point->progress[LOOKS_BEGIN] = t;
    point->progress[LOOKS_FOUND] = 0.0;
}

static bool look_is_due(const Engine *engine, const Point *point)
{
    const ModelScales *scales = &engine->model->scales;
    double *looks = point->progress, t = engine->step.t1;
    if (looks[LOOKS_STEPS] == 0.0)
        looks[LOOKS_BEGIN] = engine->step.t0;
    looks[LOOKS_STEPS] += 1.0;
    if (looks[LOOKS_STEPS] == scales->sliding_after)
        begin_looks(point, soon_over(engine, point, scales->sliding_after) ? 0.0 : scales->sliding_after, t);
    else if (looks[LOOKS_STEPS] > scales->sliding_after + scales->sliding_looks)
        begin_looks(point, 0.0, t);
    return looks[LOOKS_STEPS] > scales->sliding_after;
}

/* Looks a few steps ahead; false if too many looks have found that no step leads away from a jump of the rates. */
static bool look(Engine *engine, const Point *point)
{
    const ModelScales *scales = &engine->model->scales;
    const Step *step = &engine->step;
    double *looks = point->progress, ahead = scales->sliding_ahead * (step->t1 - step->t0);
    double steps = looks[LOOKS_STEPS] - scales->sliding_after;
    char text[2 * NAME_SIZE];
    JumpOfRates jump;
    Side spare;
    if (!find_jump(engine, point, step->t1, step->x1, ahead, &jump, &spare) ||
        !leads_back(engine, point, &jump, ahead, &spare))
        return true;
    looks[LOOKS_FOUND] += 1.0;
    if (looks[LOOKS_FOUND] < scales->sliding_found || soon_over(engine, point, steps))
        return true;
    return engine_fail(engine, ENDED_FAILED,
                       "The flow chatters at t = %.9g s: %s, and from both sides the flow leads back there: %.0f steps "
                       "led %.2g s on. " REMEDY,
                       step->t1, describe(engine, &jump, text, sizeof text), steps, step->t1 - looks[LOOKS_BEGIN]);
}

static bool creeps(Engine *engine, const Point *point, double needed, double limit)
{
    const Step *step = &engine->step;
    double steps = engine->model->scales.pace_steps, before = point->progress[PACE_BEGIN];
    char text[2 * NAME_SIZE];
    JumpOfRates jump;
    Side spare;
    bool jumps = find_jump(engine, point, step->t1, step->x1,
                           engine->model->scales.overshoot * engine_time_ulp(step->t1), &jump, &spare);
    if (jumps)
        describe(engine, &jump, text, sizeof text);
    else
        engine_describe_state(engine, step->x1, point->z, text, NAME_SIZE);
    return engine_fail(engine, ENDED_FAILED,
                       "The flow creeps: its last %.0f steps led from t = %.9g to %.9g s, so that it would need %.2g "
                       "more to reach %.9g s; there %s. %s",
                       steps, before, step->t1, needed, limit, text,
                       jumps ? REMEDY
                             : "Remedy: look for a flow map that is not smooth there (a root at zero, a sign), or for "
                               "a stiff state: write it as modes with a switch, or smooth it.");
}

void engine_begin_pace(const Point *point)
{
    point->progress[PACE_STEPS] = 0.0;
    point->progress[PACE_BEGIN] = *point->time;
}

/* A look ahead has an end of its own, and a budget. */
static bool keep_pace(Engine *engine, const Point *point, double limit)
{
    const ModelScales *scales = &engine->model->scales;
    double *pace = point->progress, t = engine->step.t1;
    pace[PACE_STEPS] += 1.0;
    if (pace[PACE_STEPS] < scales->pace_steps)
        return true;
    double needed = (limit - t) / (t - pace[PACE_BEGIN]) * scales->pace_steps;
    if (point == &engine->live && needed > scales->most_compiled_steps)
        return creeps(engine, point, needed, limit);
    pace[PACE_STEPS] = 0.0;
    pace[PACE_BEGIN] = t;
    return true;
}

bool engine_gets_on(Engine *engine, const Point *point, double limit)
{
    return (!look_is_due(engine, point) || look(engine, point)) && keep_pace(engine, point, limit);
}

bool engine_too_small(Engine *engine, const Point *point, double h)
{
    double t = *point->time, value = point->x[engine->suspect];
    char text[2 * NAME_SIZE];
    JumpOfRates jump;
    Side spare;
    if (find_jump(engine, point, t, point->x, engine->model->scales.overshoot * engine_time_ulp(t), &jump, &spare))
        return engine_fail(engine, ENDED_FAILED, "The solver needs steps below %.3g s at t = %.17g: %s. " REMEDY, h, t,
                           describe(engine, &jump, text, sizeof text));
    return engine_fail(
        engine, ENDED_FAILED,
        "The solver needs steps below %.3g s at t = %.17g, where '%s' = %.17g changes too fast for its "
        "tolerance. Remedy: declare a discontinuity of the flow map as a time event, or scale the state.",
        h, t, NAME_AT(engine->model->names, engine->model->state_names[engine->suspect]), value);
}
