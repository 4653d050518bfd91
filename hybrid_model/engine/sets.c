/* The margins of the jump sets and of the flow set at a point, and whether a flow may begin there. */
#include <float.h>
#include <math.h>

#include "parts.h"

double engine_one_instant(const Engine *engine, double t)
{
    const ModelScales *scales = &engine->model->scales;
    const Status *status = engine->status;
    if (engine->options.event_tolerance > 0.0)
        return engine->options.event_tolerance;
    double by_run = scales->instant * (t - status->start_time);
    double by_gap = scales->instant_in_gap * (t - status->jumps_time);
    return engine_larger(engine_smaller(by_run, by_gap), scales->roundings * engine_time_ulp(t));
}

bool engine_evaluate_margins(Engine *engine, double t, const double *x, const double *z)
{
    const Model *m = engine->model;
    if (m->n_margins == 0)
        return true;
    if (!engine_evaluate(engine, m->margins, t, x, z, engine->margins, NULL))
        return engine_fail(engine, ENDED_FAILED, "The jump sets of '%s' could not be evaluated at t = %.17g.", m->name,
                           t);
    for (size_t i = 0; i < m->n_margins; i++)
        if (isnan(engine->margins[i]))
            return engine_fail(
                engine, ENDED_NOT_FINITE,
                "the margin of jump '%s' is not a number at t = %.9g s: it must be defined wherever a flow or a jump "
                "leads. Remedy: check the jump set for 0/0 or the root of a negative number.",
                NAME_AT(m->names, m->margin_names[i]), t);
    return true;
}

bool engine_evaluate_flow_set(Engine *engine, double t, const double *x, const double *z, double *margin)
{
    const char *name = engine->model->name;
    if (!engine_evaluate(engine, engine->model->flow_set, t, x, z, margin, NULL))
        return engine_fail(engine, ENDED_FAILED, "The flow set of '%s' could not be evaluated at t = %.17g.", name, t);
    if (isnan(*margin))
        return engine_fail(engine, ENDED_NOT_FINITE,
                           "the margin of the flow set is not a number at t = %.9g s: it must be defined wherever a "
                           "flow or a jump leads. Remedy: check the flow set for 0/0 or the root of a negative "
                           "number.",
                           t);
    return true;
}

bool engine_blocked(Engine *engine, double t, const double *x, const double *z, double margin)
{
    char values[MESSAGE_SIZE / 2];
    return engine_fail(
        engine, ENDED_BLOCKED,
        "Blocked: the state is in neither the flow set nor the jump set at t = %.9g s: %s; margin of the flow set "
        "%.3g. Enlarge one of the sets, or make the jump map land in their union.",
        t, engine_describe_state(engine, x, z, values, sizeof values), margin);
}

/* The margin of the flow set at a point that the run need not reach; not a number if there is none. */
static double trial_margin(Engine *engine, double t, const double *x, const double *z)
{
    double margin;
    return engine_evaluate(engine, engine->model->flow_set, t, x, z, &margin, NULL) ? margin : (double)NAN;
}

/* How much the margin changes when states move by a small part of their sizes, all one way or to and fro: no simple
   sum of states hides from both. */
static double change_by_size(Engine *engine, const Point *point, double t, const double *x, double here,
                             bool to_and_fro)
{
    double *moved = engine->probe_x, border = engine->model->scales.border,
           largest = engine_largest_state(engine, point, x);
    for (size_t i = 0; i < engine->model->n_states; i++) {
        double turns = (double)i * 0.6180339887498949, weight = 1.0 - 0.5 * (turns - (double)(size_t)turns);
        double sign = to_and_fro && i % 2 ? -1.0 : 1.0;
        /* As large as the states are here: what they once were counts only where they may be rounding errors of it. */
        double nominal = engine->model->nominals[i], present = fmax(fabs(point->x[i]), fabs(x[i]));
        double size = nominal > 0.0 ? nominal : present;
        bool rounding = nominal <= 0.0 && size < engine->model->scales.rounding_level * largest;
        moved[i] = x[i] + border * sign * weight * (rounding ? largest : size);
    }
    return fabs(trial_margin(engine, t, moved, point->z) - here);
}

/* How much the margin changes when the states go on for one instant. */
static double change_by_time(Engine *engine, const Point *point, double t, const double *x, double here)
{
    const Model *m = engine->model;
    double *rates = engine->probe_k[1], *moved = engine->probe_x, wait = engine_one_instant(engine, t);
    if (m->n_states > 0 && !engine_evaluate(engine, m->flow, t, x, point->z, rates, NULL))
        return 0.0;
    for (size_t i = 0; i < m->n_states; i++) {
        if (!isfinite(rates[i]))
            return 0.0;
        moved[i] = x[i] + wait * rates[i];
    }
    return fabs(trial_margin(engine, t, moved, point->z) - here);
}

double engine_flow_border(Engine *engine, const Point *point, double t, const double *x)
{
    if (engine->options.event_tolerance > 0.0)
        return engine->options.event_tolerance;
    double here = trial_margin(engine, t, x, point->z);
    double by_size =
        fmax(change_by_size(engine, point, t, x, here, false), change_by_size(engine, point, t, x, here, true));
    double width = by_size + change_by_time(engine, point, t, x, here);
    return isfinite(width) ? width : 0.0;
}

/* How the margin of the flow set changes along the flow in a time; not a number if that cannot be told.  Nothing is
   evaluated beyond the end of the run. */
static bool margin_change(Engine *engine, const Point *point, double margin, double span, double *change)
{
    double t = *point->time;
    bool forward = t + span <= engine->status->stop_time;
    double there = forward ? t + span : t - span;
    *change = NAN;
    if (there < engine->status->start_time)
        return true;
    if (!engine_step_probe(engine, point, there))
        return false;
    *change = trial_margin(engine, there, engine->probe_x, point->z) - margin;
    if (!forward)
        *change = -*change;
    return true;
}

/* The largest size of the states, and whether the run or a nominal value has shown it; else the end of the run suggests
   one, which may be far too large. */
static double shown_size(const Engine *engine, const Point *point, bool *shown)
{
    const Status *status = engine->status;
    bool declared = false;
    double size = 0.0;
    for (size_t i = 0; i < engine->model->n_states; i++) {
        declared = declared || engine->model->nominals[i] > 0.0;
        size = fmax(size, engine_state_size(engine, point, i, point->x[i]));
    }
    *shown = size >= DBL_MIN && (size >= status->floor || declared || status->jumps_time > status->start_time);
    return *shown ? size : fmax(size, status->floor);
}

bool engine_leads_out(Engine *engine, const Point *point, double margin, bool *out)
{
    const Status *status = engine->status;
    const ModelScales *scales = &engine->model->scales;
    bool shown;
    double h, t = *point->time, size = shown_size(engine, point, &shown);
    /* At the end of the run no step is left to measure by. */
    if (!(status->stop_time > t))
        h = t - status->start_time;
    else if (!engine_first_step(engine, point, status->stop_time, size, &h))
        return false;
    double probe = scales->probe * h, change, twice;
    /* As long as no state has shown its size, the step may be far too long. */
    *out = false;
    for (size_t i = shown ? N_PROBE_PARTS - 1 : 0; i < N_PROBE_PARTS; i++) {
        double span = scales->probe_parts[i] * probe;
        if (!margin_change(engine, point, margin, span, &change))
            return false;
        *out = change < 0.0;
        if (i + 1 == N_PROBE_PARTS || !(fabs(change) > 0.0))
            continue;
        if (!margin_change(engine, point, margin, 2.0 * span, &twice))
            return false;
        if (fabs(twice - 2.0 * change) <= scales->steady * fabs(twice))
            return true;
    }
    return true;
}

bool engine_flow_may_begin(Engine *engine, const Point *point, double *level)
{
    double margin, t = *point->time;
    *level = 0.0;
    if (!engine->model->has_flow_set)
        return true;
    if (!engine_evaluate_flow_set(engine, t, point->x, point->z, &margin))
        return false;
    *level = fmin(0.0, margin);
    return margin >= 0.0 || margin >= -engine_flow_border(engine, point, t, point->x) ||
           engine_blocked(engine, t, point->x, point->z, margin);
}
