/* Steps of Co-Simulation. */
#include <float.h>
#include <math.h>

#include "instance.h"

/* By what part of itself the stop time may be passed. */
#define STOP_ROUNDING 1e-10

/* Rounding that an importer's own arithmetic may leave between two ways to write one time. */
static double time_rounding(double a, double b)
{
    return 32.0 * engine_time_ulp(fmax(fabs(a), fabs(b)));
}

static Answer check_step(const Instance *instance, const char *function, double point, double size, double target)
{
    const Run *run = instance->run;
    const char *name = instance->name;
    if (run->end_reported)
        return instance_refuse(instance, "%s: the run is over: %s", name, engine_message(instance->engine));
    if (!isfinite(size) || size <= 0.0)
        return instance_refuse(instance, "%s: %s: the step size %g must be finite and above zero.", name, function,
                               size);
    if (!isfinite(point) || !isfinite(target))
        return instance_refuse(instance, "%s: %s: the step from %g to %g must begin and end at finite times.", name,
                               function, point, target);
    if (fabs(point - run->time) > time_rounding(point, fmax(fabs(run->time), size)))
        return instance_refuse(instance,
                               "%s: %s: the step begins at %.17g, but the FMU is at %.17g; steps must follow each "
                               "other without gap or repeat.",
                               name, function, point, run->time);
    /* An importer that adds up its steps is off by a rounding each time. */
    if (target > run->stop_time + fmax(time_rounding(target, run->stop_time), STOP_ROUNDING * fabs(run->stop_time)))
        return instance_refuse(instance, "%s: %s: the step ends at %.17g, after the stop time %.17g.", name, function,
                               target, run->stop_time);
    return ANSWER_OK;
}

bool instance_step_quietly(const Instance *instance, double point, double size)
{
    Run *run = instance->run;
    Assembled *parts = instance_parts(instance);
    double target = point + size;
    if (!(size > 0.0) || !(target <= run->stop_time) || !(target <= DBL_MAX) || run->end_reported ||
        !(fabs(point - run->time) <= 16.0 * DBL_EPSILON * fabs(run->time)) ||
        !(parts ? assembled_advance_quietly(parts, target) : engine_advance_quietly(instance->engine, target)))
        return false;
    run->time = target;
    return true;
}

Answer instance_step(Instance *instance, const char *function, double point, double size, EventPolicy policy,
                     StepReport *report)
{
    Engine *engine = instance->engine;
    Assembled *parts = instance_parts(instance);
    Run *run = instance->run;
    double target = point + size;
    *report = (StepReport){.reached = run->time};
    if (check_step(instance, function, point, size, target) != ANSWER_OK)
        return ANSWER_ERROR;
    Advance advance = parts ? assembled_advance(parts, target, policy) : engine_advance(engine, target, policy);
    double end = parts ? assembled_target(parts) : engine_target(engine);
    bool reached = advance == ADVANCE_REACHED || advance == ADVANCE_EVENT_AT_TARGET;
    bool pending = advance == ADVANCE_EVENT_AT_TARGET || advance == ADVANCE_EVENT_BEFORE;
    run->time = reached ? end : fmin(engine_time(engine), end);
    report->reached = run->time;
    report->event = pending || (parts ? assembled_jumps_taken(parts) : engine_jumps_taken(engine)) > 0;
    report->early = run->time < target;
    report->terminate = advance == ADVANCE_ENDED;
    if (report->terminate) {
        report->event = false;
        run->end_reported = true;
        instance_refuse(instance, "%s: %s", instance->name, engine_message(engine));
    }
    /* The call itself succeeded: it computed what there is, and says by its flags that it is the end. */
    return ANSWER_OK;
}
