/* The margins of the jump sets and of the flow set at a point, and whether a flow may begin there. */
#include <math.h>

#include "search.h"

double event_tolerance(double t)
{
    return fmax(EVENT_TOLERANCE, 8.0 * time_ulp(t));
}

bool evaluate_margins(Engine *engine, double t, const double *x, const double *z)
{
    const Model *m = engine->model;
    if (m->n_margins == 0)
        return true;
    if (!evaluate(engine, m->margins, t, x, z, engine->margins, NULL))
        return problem(engine, ENDED_FAILED, "The jump sets of '%s' could not be evaluated at t = %.17g.", m->name, t);
    for (size_t i = 0; i < m->n_margins; i++)
        if (isnan(engine->margins[i]))
            return problem(engine, ENDED_NOT_FINITE,
                           "The jump margin '%s' is not a number at t = %.17g; margins must be numbers. Remedy: check "
                           "the jump set for 0/0 or the root of a negative number.",
                           NAME_AT(m, m->margin_names[i]), t);
    return true;
}

bool evaluate_flow_set(Engine *engine, double t, const double *x, const double *z, double *margin)
{
    const char *name = engine->model->name;
    if (!evaluate(engine, engine->model->flow_set, t, x, z, margin, NULL))
        return problem(engine, ENDED_FAILED, "The flow set of '%s' could not be evaluated at t = %.17g.", name, t);
    if (isnan(*margin))
        return problem(engine, ENDED_NOT_FINITE,
                       "The margin of the flow set of '%s' is not a number at t = %.17g; margins must be numbers. "
                       "Remedy: check the flow set for 0/0 or the root of a negative number.",
                       name, t);
    return true;
}

bool blocked(Engine *engine, double t, const double *x, const double *z, double margin)
{
    char values[MESSAGE_SIZE / 2];
    return problem(engine, ENDED_BLOCKED,
                   "Blocked: at t = %.17g the state is outside the flow set (margin %.6g < 0) and no jump is enabled; "
                   "%s. Remedy: extend the flow set or the jump set so that one of them holds the state.",
                   t, margin, describe_state(engine, x, z, values, sizeof values));
}

bool flow_may_begin(Engine *engine, const Point *point, double *level)
{
    double margin, later, t = *point->time;
    *level = 0.0;
    if (!engine->model->has_flow_set)
        return true;
    if (!evaluate_flow_set(engine, t, point->x, point->z, &margin))
        return false;
    *level = fmin(0.0, margin);
    if (margin >= -EVENT_TOLERANCE)
        return true;
    double soon = t + event_tolerance(t);
    if (!step_probe(engine, point, soon) || !evaluate_flow_set(engine, soon, engine->probe_x, point->z, &later))
        return false;
    return later >= 0.0 || blocked(engine, t, point->x, point->z, margin);
}
