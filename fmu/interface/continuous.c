/* Model Exchange: the importer integrates, and says where. */
#include <math.h>
#include <string.h>

#include "instance.h"

Answer instance_set_time(void *handle, const char *function, double time)
{
    Instance *instance = instance_enter_kind(handle, function, MODEL_EXCHANGE, MODE_EVENT | MODE_CONTINUOUS);
    if (!instance)
        return ANSWER_ERROR;
    if (!isfinite(time))
        return instance_refuse(instance, "%s: %s: the time %g must be finite.", instance->name, function, time);
    if (time != instance->run->time)
        engine_set_time(instance->engine, time);
    instance->run->time = time;
    return ANSWER_OK;
}

static Answer check_length(const Instance *instance, const char *function, const void *values, size_t n, size_t needed)
{
    if (n != needed)
        return instance_refuse(instance, "%s: %s: %zu values were given room for, but there are %zu.", instance->name,
                               function, n, needed);
    return n > 0 && !values ? instance_null_argument(instance, function) : ANSWER_OK;
}

Answer instance_set_states(void *handle, const char *function, const double x[], size_t n)
{
    Instance *instance = instance_enter_kind(handle, function, MODEL_EXCHANGE, MODE_CONTINUOUS);
    if (!instance || check_length(instance, function, x, n, model.n_states) != ANSWER_OK)
        return ANSWER_ERROR;
    for (size_t i = 0; i < n; i++)
        if (!isfinite(x[i]))
            return instance_refuse(instance, "%s: %s: the value %g for '%s' must be finite.", instance->name, function,
                                   x[i], NAME_AT(model.names, model.state_names[i]));
    engine_set_states(instance->engine, x);
    return ANSWER_OK;
}

static bool all_finite(const double *values, size_t n)
{
    size_t i = 0;
    while (i < n && isfinite(values[i]))
        i++;
    return i == n;
}

Answer instance_get_vector(void *handle, const char *function, Bank bank, double values[], size_t n)
{
    Instance *instance = instance_enter_kind(handle, function, MODEL_EXCHANGE, MODE_RUNNING);
    if (!instance)
        return ANSWER_ERROR;
    Engine *engine = instance->engine;
    size_t needed = bank == BANK_INDICATOR ? engine_indicators(engine) : model.n_states;
    if (check_length(instance, function, values, n, needed) != ANSWER_OK)
        return ANSWER_ERROR;
    const double *from = engine_values(engine, instance_view(instance), bank);
    if (!from)
        return instance_refuse(instance, "%s: %s: %s", instance->name, function, engine_problem(engine));
    if (bank == BANK_DERIVATIVE && !all_finite(from, n)) {
        const double *outer = engine_outer_rates(engine, instance_view(instance));
        from = outer ? outer : from;
    }
    for (size_t i = 0; i < n; i++)
        if (!isfinite(from[i])) {
            bool margin = bank == BANK_INDICATOR;
            const char *name = margin && i == model.n_margins
                                   ? "flow set"
                                   : NAME_AT(model.names, margin ? model.margin_names[i] : model.state_names[i]);
            instance_refuse(instance,
                            "%s: %s: the value for '%s' is %g at t = %.17g, which is not finite. Remedy: a smaller "
                            "step, or other parameters and inputs.",
                            instance->name, function, name, from[i], instance->run->time);
            /* The importer may try a smaller step. */
            return ANSWER_DISCARD;
        }
    if (n > 0)
        memcpy(values, from, n * sizeof *values);
    return ANSWER_OK;
}

Answer instance_nominals(void *handle, const char *function, double values[], size_t n)
{
    Instance *instance = instance_enter_kind(handle, function, MODEL_EXCHANGE, MODE_ANY);
    if (!instance || check_length(instance, function, values, n, model.n_states) != ANSWER_OK)
        return ANSWER_ERROR;
    for (size_t i = 0; i < n; i++)
        values[i] = model.nominals[i] > 0.0 ? model.nominals[i] : 1.0;
    return ANSWER_OK;
}

Answer instance_completed_step(void *handle, const char *function, bool *event, bool *terminate)
{
    Instance *instance = instance_enter_kind(handle, function, MODEL_EXCHANGE, MODE_CONTINUOUS);
    if (!instance)
        return ANSWER_ERROR;
    if (!event || !terminate)
        return instance_null_argument(instance, function);
    /* An importer that does not watch the indicators still does not pass an event unseen, nor leave the flow set. */
    engine_note_rates(instance->engine);
    *event = engine_pending(instance->engine) < model.n_jumps;
    *terminate = !*event && !engine_may_flow(instance->engine);
    if (*terminate)
        instance_refuse(instance, "%s: %s", instance->name, engine_message(instance->engine));
    return ANSWER_OK;
}
