/* Life and log of an instance. */
#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ERROR_CATEGORY "logStatusError"
#define EVENT_CATEGORY "logEvents"

Answer instance_refuse(const Instance *instance, const char *format, ...)
{
    char message[1024];
    va_list arguments;
    if (!instance || !instance->log_line)
        return ANSWER_ERROR;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    engine_end_text(message);
    instance->log_line(instance, ANSWER_ERROR, ERROR_CATEGORY, message);
    return ANSWER_ERROR;
}

const char *instance_mode_name(int mode)
{
    switch (mode) {
    case MODE_INSTANTIATED: return "Instantiated";
    case MODE_CONFIGURATION: return "Configuration Mode";
    case MODE_INITIALIZATION: return "Initialization Mode";
    case MODE_EVENT: return "Event Mode";
    case MODE_STEP: return "Step Mode";
    case MODE_CONTINUOUS: return "Continuous-Time Mode";
    case MODE_INTERMEDIATE: return "Intermediate Update Mode";
    default: return "Terminated";
    }
}

Instance *instance_enter(void *handle, const char *function, int modes)
{
    Instance *instance = handle;
    if (!instance)
        return NULL;
    if (instance->run->mode & modes)
        return instance;
    instance_refuse(instance, "%s: %s must not be called in the state '%s'.", instance->name, function,
                    instance_mode_name(instance->run->mode));
    return NULL;
}

Instance *instance_enter_kind(void *handle, const char *function, Interface kind, int modes)
{
    static const char *const KINDS[] = {"Co-Simulation", "Model Exchange"};
    Instance *instance = instance_enter(handle, function, modes);
    if (!instance || instance->interface == kind)
        return instance;
    instance_refuse(instance, "%s: %s is for %s, but this is an instance for %s.", instance->name, function,
                    KINDS[kind], KINDS[instance->interface]);
    return NULL;
}

Answer instance_null_argument(const Instance *instance, const char *function)
{
    return instance_refuse(instance, "%s: %s was called with a null pointer; every argument needs a place to point to.",
                           instance->name, function);
}

Assembled *instance_parts(const Instance *instance)
{
    return instance->parts && assembled_running(instance->parts) ? instance->parts : NULL;
}

static void log_jump(void *context, double time, size_t jump)
{
    const Instance *instance = context;
    char message[512];
    if (!instance->log_line || !instance->logging || !(instance->categories & LOG_EVENTS))
        return;
    snprintf(message, sizeof message, "%s: '%s' jumps at t = %.17g.", instance->name,
             NAME_AT(model.names, model.jumps[jump].name), time);
    engine_end_text(message);
    instance->log_line(instance, ANSWER_OK, EVENT_CATEGORY, message);
}

static void set_up(Instance *instance)
{
    Run *run = instance->run;
    engine_reset(instance->engine);
    if (instance->parts)
        assembled_reset(instance->parts);
    run->mode = MODE_INSTANTIATED;
    run->time = 0.0;
    run->stop_time = run->next_event = INFINITY;
}

static bool is_blank(const char *text)
{
    return !text || text[strspn(text, " \t\r\n")] == '\0';
}

static void release(Instance *instance, char *name)
{
    assembled_free(instance->parts);
    engine_free(instance->engine);
    free(name);
    free(instance);
}

static Instance *allocate(const Instance *prototype, size_t size)
{
    size_t length = strlen(prototype->name) + 1;
    Instance *instance = malloc(size);
    if (!instance)
        return NULL;
    memcpy(instance, prototype, size);
    char *name = malloc(length);
    instance->engine = engine_create(&model, sizeof(Run));
    bool in_parts = description.assembly && prototype->interface == CO_SIMULATION;
    if (instance->engine && in_parts)
        instance->parts = assembled_create(description.assembly, instance->engine);
    if (!name || !instance->engine || (in_parts && !instance->parts)) {
        release(instance, name);
        return NULL;
    }
    memcpy(name, prototype->name, length);
    instance->name = name;
    instance->run = engine_wrapper(instance->engine);
    instance->categories = LOG_ERRORS | LOG_EVENTS;
    engine_set_jump_hook(instance->engine, log_jump, instance);
    if (instance->parts)
        assembled_set_jump_hook(instance->parts, log_jump, instance);
    set_up(instance);
    return instance;
}

Instance *instance_new(const Instance *prototype, size_t size, const char *function, const char *token)
{
    const char *kind = prototype->interface == CO_SIMULATION ? "Co-Simulation" : "Model Exchange";
    const char *name = prototype->name;
    if (is_blank(name)) {
        instance_refuse(prototype, "%s: the instance name is missing; it needs at least one visible character.",
                        function);
        return NULL;
    }
    if (!token || strcmp(token, description.token) != 0) {
        instance_refuse(prototype,
                        "%s: %s: the instantiation token '%s' is not this FMU's '%s'. Remedy: use the "
                        "modelDescription.xml of the same FMU.",
                        name, function, token ? token : "(null)", description.token);
        return NULL;
    }
    if (prototype->interface == CO_SIMULATION ? !description.co_simulation : !description.model_exchange) {
        instance_refuse(prototype, "%s: %s: this FMU is not for %s.", name, function, kind);
        return NULL;
    }
    Instance *instance = allocate(prototype, size);
    if (!instance)
        instance_refuse(prototype, "%s: %s: out of memory.", name, function);
    return instance;
}

void instance_free(void *handle, const char *function)
{
    Instance *instance = handle;
    /* Within a callback the FMU still needs the instance. */
    if (!instance || !instance_enter(instance, function, MODE_OUTSIDE))
        return;
    char *name = (char *)instance->name;
    release(instance, name);
}

Answer instance_reset(void *handle, const char *function)
{
    Instance *instance = instance_enter(handle, function, MODE_OUTSIDE);
    if (!instance)
        return ANSWER_ERROR;
    set_up(instance);
    return ANSWER_OK;
}

Answer instance_terminate(void *handle, const char *function)
{
    Instance *instance = instance_enter(handle, function, MODE_EVENT | MODE_STEP | MODE_CONTINUOUS);
    if (!instance)
        return ANSWER_ERROR;
    instance->run->mode = MODE_TERMINATED;
    return ANSWER_OK;
}

Answer instance_log(void *handle, const char *function, bool on, size_t n, const char *const categories[])
{
    Instance *instance = instance_enter(handle, function, MODE_ANY);
    unsigned chosen = n == 0 ? LOG_ERRORS | LOG_EVENTS : 0;
    if (!instance)
        return ANSWER_ERROR;
    if (n > 0 && !categories)
        return instance_null_argument(instance, function);
    for (size_t i = 0; i < n; i++) {
        if (!categories[i])
            return instance_null_argument(instance, function);
        unsigned bit = strcmp(categories[i], ERROR_CATEGORY) == 0   ? LOG_ERRORS
                       : strcmp(categories[i], EVENT_CATEGORY) == 0 ? LOG_EVENTS
                                                                    : 0;
        if (!bit)
            return instance_refuse(
                instance, "%s: %s: there is no log category '%s'; there are " ERROR_CATEGORY " and " EVENT_CATEGORY ".",
                instance->name, function, categories[i]);
        chosen |= bit;
    }
    /* Errors are reported whether logging is on or not. */
    instance->logging = on;
    instance->categories = chosen;
    return ANSWER_OK;
}

Answer instance_unsupported(void *handle, const char *function)
{
    const Instance *instance = handle;
    if (!instance)
        return ANSWER_ERROR;
    return instance_refuse(instance, "%s: %s is not supported by this FMU.", instance->name, function);
}
