/* Which clocks tick, and when the next event comes. */
#include <math.h>

#include "instance.h"

static Answer check_clocks(const Instance *instance, const char *function, const Reference references[], size_t n,
                           const void *values)
{
    if (n > 0 && (!references || !values))
        return instance_null_argument(instance, function);
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = instance_variable(instance, function, references[i]);
        if (!variable || instance_check_type(instance, function, variable, TYPE_CLOCK) != ANSWER_OK)
            return ANSWER_ERROR;
    }
    return ANSWER_OK;
}

static Answer check_countdowns(const Instance *instance, const char *function, const Reference references[], size_t n,
                               const void *values)
{
    if (check_clocks(instance, function, references, n, values) != ANSWER_OK)
        return ANSWER_ERROR;
    for (size_t i = 0; i < n; i++)
        if (description.variables[references[i]].bank != BANK_COUNTDOWN)
            return instance_refuse(instance, "%s: %s: '%s' is an output clock, which ticks by itself.", instance->name,
                                   function, NAME_OF(&description.variables[references[i]]));
    return ANSWER_OK;
}

/* Clocks tick in Event Mode only: the clock of the jump that comes next at this instant, and in the
   first iteration those whose jumps were taken inside the last step. */
Answer instance_get_clocks(void *handle, const char *function, const Reference references[], size_t n, bool active[])
{
    Instance *instance = instance_enter(handle, function, MODE_ANY);
    if (!instance || check_clocks(instance, function, references, n, active) != ANSWER_OK)
        return ANSWER_ERROR;
    bool in_event_mode = instance->run->mode == MODE_EVENT;
    size_t pending = in_event_mode ? instance_pending(instance) : model.n_jumps;
    for (size_t i = 0; i < n; i++) {
        const Variable *clock = &description.variables[references[i]];
        bool pends = pending < model.n_jumps;
        if (clock->bank == BANK_CLOCK)
            pends =
                (pends && clock->index == pending) || (in_event_mode && engine_ticked(instance->engine, clock->index));
        active[i] = pends;
    }
    return ANSWER_OK;
}

Answer instance_set_clocks(void *handle, const char *function, const Reference references[], size_t n,
                           const bool active[])
{
    Instance *instance = instance_enter(handle, function, MODE_EVENT);
    /* The event is due by its own time: the tick tells nothing new, and one that comes early does nothing. */
    if (!instance || check_countdowns(instance, function, references, n, active) != ANSWER_OK)
        return ANSWER_ERROR;
    for (size_t i = 0; i < n; i++)
        if (active[i])
            instance->run->interval_owed = false;
    return ANSWER_OK;
}

Answer instance_get_interval(void *handle, const char *function, const Reference references[], size_t n,
                             const void *places, double *interval, Qualifier *qualifier)
{
    Instance *instance = instance_enter(handle, function, MODE_INITIALIZATION | MODE_EVENT);
    if (!instance || check_countdowns(instance, function, references, n, places) != ANSWER_OK)
        return ANSWER_ERROR;
    Run *run = instance->run;
    bool known = isfinite(run->next_event) && run->mode == MODE_EVENT;
    *interval = known ? fmax(run->next_event - run->time, 0.0) : 0.0;
    *qualifier = !known ? INTERVAL_NOT_YET_KNOWN : run->interval_told ? INTERVAL_UNCHANGED : INTERVAL_CHANGED;
    if (n > 0)
        run->interval_told = known;
    if (n > 0 && known)
        run->interval_owed = true;
    return ANSWER_OK;
}
