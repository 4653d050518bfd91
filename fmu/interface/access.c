/* Values of variables that go in and out. */
#include <math.h>

#include "instance.h"

static const char *type_name(Type type)
{
    static const char *const NAMES[] = {"Float64", "Int32", "UInt64", "Boolean", "Clock"};
    return NAMES[type];
}

static bool may_be_set(const Variable *variable, int mode)
{
    bool before_start = (mode & (MODE_INSTANTIATED | MODE_INITIALIZATION)) != 0;
    switch (variable->bank) {
    case BANK_INPUT: return mode != MODE_CONFIGURATION && (mode != MODE_INTERMEDIATE || !variable->discrete);
    /* Tunable parameters change at events from outside (2.0.5 and 3.0.2, section 2.2.7 and 2.4.7): in Event Mode, and
       at communication points of Co-Simulation, with or without event mode (3.0.2, section 4.2.1), where the next step
       handles what they bring about. */
    case BANK_PARAMETER: return before_start || (variable->tunable && (mode & (MODE_EVENT | MODE_STEP)) != 0);
    case BANK_OPTION: return before_start;
    /* An importer that integrates may set a state by its name as well as all of them at once (2.0.1, section 3.2.3,
       condition 5; 3.0.2, section 3.2.1, by its table of functions and by what later became its text). */
    case BANK_STATE: return (before_start && !variable->calculated) || mode == MODE_CONTINUOUS;
    case BANK_DISCRETE: return before_start && !variable->calculated;
    case BANK_SIZE: return mode == MODE_CONFIGURATION;
    default: return false;
    }
}

const Variable *instance_variable(const Instance *instance, const char *function, Reference reference)
{
    if (reference < description.n_variables)
        return &description.variables[reference];
    instance_refuse(instance, "%s: %s: there is no variable with the value reference %lu.", instance->name, function,
                    (unsigned long)reference);
    return NULL;
}

Answer instance_check_type(const Instance *instance, const char *function, const Variable *variable, Type type)
{
    if (variable->type == type)
        return ANSWER_OK;
    return instance_refuse(instance, "%s: %s: '%s' is of type %s. Remedy: use the function of that type.",
                           instance->name, function, NAME_OF(variable), type_name((Type)variable->type));
}

/* Checks the arguments of a getter or setter before anything is written. */
static Answer check_access(const Instance *instance, const char *function, Type type, bool set,
                           const Reference references[], size_t n, const void *values, size_t n_values)
{
    size_t needed = 0;
    if (n > 0 && (!references || !values))
        return instance_null_argument(instance, function);
    for (size_t i = 0; i < n; i++) {
        const Variable *variable = instance_variable(instance, function, references[i]);
        if (!variable || instance_check_type(instance, function, variable, type) != ANSWER_OK)
            return ANSWER_ERROR;
        if (set && !may_be_set(variable, instance->run->mode))
            return instance_refuse(instance, "%s: %s: '%s' cannot be set in the state '%s'.", instance->name, function,
                                   NAME_OF(variable), instance_mode_name(instance->run->mode));
        needed += variable->size;
    }
    if (n_values != needed)
        return instance_refuse(instance, "%s: %s: %zu values for %zu elements of the %zu variables.", instance->name,
                               function, n_values, needed, n);
    return ANSWER_OK;
}

View instance_view(const Instance *instance)
{
    int mode = instance->run->mode;
    if (mode & (MODE_INSTANTIATED | MODE_CONFIGURATION | MODE_INITIALIZATION))
        return VIEW_START;
    return mode == MODE_EVENT ? VIEW_PENDING : VIEW_LIVE;
}

/* The values of a variable's bank from its first element on; NULL (and one log line) if there are none. */
static const double *elements(const Instance *instance, const Variable *variable, double *own)
{
    const Run *run = instance->run;
    switch (variable->bank) {
    case BANK_TIME: *own = run->mode == MODE_INTERMEDIATE ? engine_time(instance->engine) : run->time; return own;
    case BANK_SIZE: *own = (double)variable->index; return own;
    case BANK_OPTION: *own = run->stop_at_events; return own;
    default: break;
    }
    Assembled *parts = instance_parts(instance);
    const double *values =
        parts ? assembled_values(parts, instance_view(instance), (Bank)variable->bank, variable->index)
              : engine_values(instance->engine, instance_view(instance), (Bank)variable->bank);
    if (values)
        return parts ? values : values + variable->index;
    instance_refuse(instance, "%s: '%s' cannot be computed: %s", instance->name, NAME_OF(variable),
                    engine_problem(instance->engine));
    return NULL;
}

static bool fits(const Variable *variable, double value)
{
    return isfinite(value) && (variable->type != TYPE_INT32 || fabs(value + 0.5) <= 2147483647.5);
}

/* Reads the elements of a variable; with no `store` it only checks that they can be read. */
static Answer read_variable(const Instance *instance, const Variable *variable, void *values, size_t at,
                            StoreValue *store)
{
    double own;
    const double *from = elements(instance, variable, &own);
    if (!from)
        return ANSWER_ERROR;
    for (size_t k = 0; k < variable->size; k++) {
        double value = variable->type == TYPE_INT32 ? floor(from[k] + 0.5) : from[k];
        if (!fits(variable, value))
            return instance_refuse(instance,
                                   "%s: '%s' is %g at t = %.17g, which a value of type %s must not be. Remedy: check "
                                   "its expression, the parameters and the inputs.",
                                   instance->name, NAME_OF(variable), from[k], instance->run->time,
                                   type_name((Type)variable->type));
        if (store)
            store(values, at + k, value);
    }
    return ANSWER_OK;
}

Answer instance_get(void *handle, const char *function, Type type, const Reference references[], size_t n, void *values,
                    size_t n_values, StoreValue *store)
{
    Instance *instance = instance_enter(handle, function, MODE_ANY);
    if (!instance || check_access(instance, function, type, false, references, n, values, n_values) != ANSWER_OK)
        return ANSWER_ERROR;
    for (size_t i = 0; i < n; i++)
        if (read_variable(instance, &description.variables[references[i]], NULL, 0, NULL) != ANSWER_OK)
            return ANSWER_ERROR;
    for (size_t i = 0, at = 0; i < n; at += description.variables[references[i]].size, i++)
        read_variable(instance, &description.variables[references[i]], values, at, store);
    return ANSWER_OK;
}

static Answer check_value(const Instance *instance, const char *function, const Variable *variable, double value)
{
    if (!isfinite(value))
        return instance_refuse(instance, "%s: %s: the value %g for '%s' must be finite.", instance->name, function,
                               value, NAME_OF(variable));
    if (variable->bank == BANK_SIZE && value != (double)variable->index)
        return instance_refuse(instance,
                               "%s: %s: the length '%s' is %lu in this FMU and cannot become %.0f. Remedy: export the "
                               "model with that length.",
                               instance->name, function, NAME_OF(variable), (unsigned long)variable->index, value);
    return ANSWER_OK;
}

static void write_element(Instance *instance, const Variable *variable, size_t k, double value)
{
    if (variable->bank == BANK_OPTION)
        instance->run->stop_at_events = value != 0.0;
    else if (instance_parts(instance))
        assembled_set(instance->parts, (Bank)variable->bank, variable->index + k, value);
    else if (variable->bank != BANK_SIZE)
        engine_set(instance->engine, (Bank)variable->bank, variable->index + k, value);
}

Answer instance_set(void *handle, const char *function, Type type, const Reference references[], size_t n,
                    const void *values, size_t n_values, LoadValue *load)
{
    Instance *instance = instance_enter(handle, function, MODE_SETTABLE);
    if (!instance || check_access(instance, function, type, true, references, n, values, n_values) != ANSWER_OK)
        return ANSWER_ERROR;
    for (size_t i = 0, at = 0; i < n; i++)
        for (size_t k = 0; k < description.variables[references[i]].size; k++)
            if (check_value(instance, function, &description.variables[references[i]], load(values, at++)) != ANSWER_OK)
                return ANSWER_ERROR;
    for (size_t i = 0, at = 0; i < n; i++)
        for (size_t k = 0; k < description.variables[references[i]].size; k++)
            write_element(instance, &description.variables[references[i]], k, load(values, at++));
    if (instance_parts(instance))
        assembled_follow(instance->parts);
    return ANSWER_OK;
}

Answer instance_no_type(void *handle, const char *function, size_t n, bool set)
{
    Instance *instance = instance_enter(handle, function, set ? MODE_SETTABLE : MODE_ANY);
    if (!instance)
        return ANSWER_ERROR;
    if (n == 0)
        return ANSWER_OK;
    return instance_refuse(instance, "%s: %s: no variable of this FMU has that type.", instance->name, function);
}
