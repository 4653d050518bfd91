/* From Instantiated to the first mode of a run. */
#include <math.h>

#include "instance.h"

Answer instance_set_up(void *handle, const char *function, const Experiment *experiment)
{
    Instance *instance = instance_enter(handle, function, MODE_INSTANTIATED);
    double tolerance = experiment->tolerance, start = experiment->start, stop = experiment->stop;
    if (!instance)
        return ANSWER_ERROR;
    if (experiment->has_tolerance && !(isfinite(tolerance) && tolerance > 0.0))
        return instance_refuse(instance, "%s: the tolerance %g must be finite and above zero.", instance->name,
                               tolerance);
    if (!isfinite(start))
        return instance_refuse(instance, "%s: the start time %g must be finite.", instance->name, start);
    if (experiment->has_stop && !(isfinite(stop) && stop >= start))
        return instance_refuse(instance, "%s: the stop time %.17g must be finite and not before the start time %.17g.",
                               instance->name, stop, start);
    if (experiment->has_tolerance)
        engine_set_tolerance(instance->engine, tolerance);
    instance->run->time = start;
    instance->run->stop_time = experiment->has_stop ? stop : INFINITY;
    engine_set_span(instance->engine, start, instance->run->stop_time);
    return ANSWER_OK;
}

Answer instance_enter_initialization(void *handle, const char *function)
{
    Instance *instance = instance_enter(handle, function, MODE_INSTANTIATED);
    if (!instance)
        return ANSWER_ERROR;
    instance->run->mode = MODE_INITIALIZATION;
    return ANSWER_OK;
}

Answer instance_exit_initialization(void *handle, const char *function)
{
    Instance *instance = instance_enter(handle, function, MODE_INITIALIZATION);
    if (!instance)
        return ANSWER_ERROR;
    Engine *engine = instance->engine;
    bool events_outside = instance->interface == MODEL_EXCHANGE || instance->event_mode_used;
    if (!engine_start(engine))
        return instance_refuse(instance, "%s: %s", instance->name, engine_problem(engine));
    bool going = !instance->parts || assembled_begin(instance->parts);
    if (going && !events_outside)
        going = instance->parts ? assembled_jump_all(instance->parts) : engine_jump_all(engine);
    if (!going)
        return instance_refuse(instance, "%s: %s", instance->name, engine_message(engine));
    engine_clear_ticks(engine);
    instance->run->mode = events_outside ? MODE_EVENT : MODE_STEP;
    return ANSWER_OK;
}

Answer instance_configure(void *handle, const char *function, bool begin)
{
    Instance *instance = instance_enter(handle, function, begin ? MODE_INSTANTIATED : MODE_CONFIGURATION);
    if (!instance)
        return ANSWER_ERROR;
    instance->run->mode = begin ? MODE_CONFIGURATION : MODE_INSTANTIATED;
    return ANSWER_OK;
}
