/* Event Mode. */
#include <math.h>

#include "instance.h"

size_t instance_pending(const Instance *instance)
{
    Assembled *parts = instance_parts(instance);
    return parts ? assembled_pending(parts) : engine_pending(instance->engine);
}

Answer instance_enter_event_mode(void *handle, const char *function, int modes)
{
    Instance *instance = instance_enter(handle, function, modes);
    if (!instance)
        return ANSWER_ERROR;
    bool stepping = instance->interface == CO_SIMULATION;
    if (stepping && !instance->event_mode_used)
        return instance_refuse(instance, "%s: %s: the FMU was instantiated with eventModeUsed = false.", instance->name,
                               function);
    if (!stepping && instance->run->mode == MODE_CONTINUOUS && !engine_arrive(instance->engine))
        return instance_refuse(instance, "%s: %s", instance->name, engine_problem(instance->engine));
    instance->run->mode = MODE_EVENT;
    return ANSWER_OK;
}

Answer instance_leave_event_mode(void *handle, const char *function, int mode)
{
    Instance *instance = instance_enter(handle, function, MODE_EVENT);
    if (!instance)
        return ANSWER_ERROR;
    if ((instance->interface == CO_SIMULATION) != (mode == MODE_STEP))
        return instance_refuse(instance, "%s: %s: an instance of this kind has no '%s'.", instance->name, function,
                               instance_mode_name(mode));
    engine_clear_ticks(instance->engine);
    if (mode == MODE_CONTINUOUS)
        engine_note_rates(instance->engine);
    instance->run->mode = mode;
    return ANSWER_OK;
}

/* The time of the next event, if it can be known: predicted where all inputs are discrete, the next
   time event otherwise.  Who integrates by himself needs to know the time events only, with those at which
   the flow has a kink. */
static bool next_event(const Instance *instance, double *event_time)
{
    Engine *engine = instance->engine;
    Assembled *parts = instance_parts(instance);
    if (instance->interface == MODEL_EXCHANGE)
        return engine_next_time_event(engine, true, event_time);
    if (parts)
        return assembled_predict(parts, event_time);
    return model.predictable ? engine_predict(engine, instance->run->stop_time, event_time)
                             : engine_next_time_event(engine, false, event_time);
}

Answer instance_update(void *handle, const char *function, EventUpdate *update)
{
    Instance *instance = instance_enter(handle, function, MODE_EVENT);
    if (!instance)
        return ANSWER_ERROR;
    Engine *engine = instance->engine;
    Assembled *parts = instance_parts(instance);
    Run *run = instance->run;
    bool changed = false;
    *update = (EventUpdate){.terminate = !(parts ? assembled_jump(parts, &changed) : engine_jump(engine, &changed))};
    /* True only where a value is another one: 2.0.5, section 3.2.2, forbids it elsewhere, and in 3.0.2, section 2.3.5,
       it says that a state was re-initialised to another value.  So a jump that changes nothing but the mode of the
       flow is not told apart from none, and an importer restarts its solver after every event. */
    update->states_changed = changed;
    update->again = !update->terminate && instance_pending(instance) < model.n_jumps;
    /* This iteration's clocks are over; the next one's are those of the jump that comes next. */
    engine_clear_ticks(engine);
    bool settled = !update->terminate && !update->again;
    if (settled && instance->interface == MODEL_EXCHANGE && !engine_may_flow(engine)) {
        update->terminate = true;
        settled = false;
    }
    update->has_next = settled && next_event(instance, &update->next);
    if (!update->has_next)
        update->next = 0.0;
    /* A countdown that has begun cannot be called off: without an event it ends where nothing happens. */
    bool foreseen = parts ? assembled_foresees(parts) : engine_foresees(engine);
    bool counts = update->has_next && (foreseen || run->interval_owed);
    run->next_event = counts ? update->next : (double)INFINITY;
    run->interval_told = false;
    if (update->terminate)
        instance_refuse(instance, "%s: %s", instance->name, engine_message(engine));
    return ANSWER_OK;
}
