/* Partial derivatives along directions, and derivatives of outputs with respect to time. */
#include <math.h>

#include "instance.h"

/* Where a variable's derivatives lie; N_SEEDS if it is none that has any there. */
static int place_of(const Variable *variable, bool known)
{
    switch (variable->bank) {
    case BANK_TIME: return known ? SEED_TIME : N_SEEDS;
    case BANK_INPUT: return known ? SEED_INPUTS : N_SEEDS;
    case BANK_PARAMETER: return known ? SEED_PARAMETERS : N_SEEDS;
    case BANK_STATE: return known ? SEED_STATES : SEED_SHOWN;
    case BANK_DISCRETE: return known ? SEED_DISCRETE : SEED_SHOWN + 1;
    case BANK_DERIVATIVE: return known ? N_SEEDS : SEED_RATES;
    case BANK_OUTPUT: return known ? N_SEEDS : SEED_OUTPUTS;
    default: return N_SEEDS;
    }
}

/* The engine with the present state, whatever runs. */
static Engine *whole(const Instance *instance)
{
    return instance_parts(instance) ? assembled_whole(instance->parts) : instance->engine;
}

static Answer check_direction(const Instance *instance, const char *function, const Direction *direction, bool known)
{
    const void *values = direction->seeds ? (const void *)direction->seeds : direction->results;
    size_t needed = 0;
    if (direction->n > 0 && (!direction->references || !values))
        return instance_null_argument(instance, function);
    for (size_t i = 0; i < direction->n; i++) {
        const Variable *variable = instance_variable(instance, function, direction->references[i]);
        if (!variable)
            return ANSWER_ERROR;
        if (variable->type != TYPE_FLOAT64 || place_of(variable, known) == N_SEEDS)
            return instance_refuse(instance, "%s: %s: '%s' is none of the %s that derivatives are of.", instance->name,
                                   function, NAME_OF(variable), known ? "knowns" : "unknowns");
        needed += variable->size;
    }
    if (direction->n_values != needed)
        return instance_refuse(instance, "%s: %s: %zu values for %zu elements of the %zu variables.", instance->name,
                               function, direction->n_values, needed, direction->n);
    for (size_t i = 0; i < needed; i++)
        if (direction->seeds && !isfinite(direction->seeds[i]))
            return instance_refuse(instance, "%s: %s: the seed %g must be finite.", instance->name, function,
                                   direction->seeds[i]);
    return ANSWER_OK;
}

/* Adds the seeds to their places. */
static void scatter(const Direction *direction, bool known, double *const places[N_SEEDS])
{
    for (size_t i = 0, at = 0; i < direction->n; i++) {
        const Variable *variable = &description.variables[direction->references[i]];
        for (size_t k = 0; k < variable->size; k++)
            places[place_of(variable, known)][variable->index + k] += direction->seeds[at++];
    }
}

static void gather(const Direction *direction, bool known, double *const places[N_SEEDS])
{
    for (size_t i = 0, at = 0; i < direction->n; i++) {
        const Variable *variable = &description.variables[direction->references[i]];
        for (size_t k = 0; k < variable->size; k++)
            direction->results[at++] = places[place_of(variable, known)][variable->index + k];
    }
}

/* Where the derivatives are not finite, nothing is given. */
static bool all_finite(const Direction *direction, bool known, double *const places[N_SEEDS])
{
    for (size_t i = 0; i < direction->n; i++) {
        const Variable *variable = &description.variables[direction->references[i]];
        for (size_t k = 0; k < variable->size; k++)
            if (!isfinite(places[place_of(variable, known)][variable->index + k]))
                return false;
    }
    return true;
}

Answer instance_derivatives(void *handle, const char *function, const Direction *unknowns, const Direction *knowns,
                            bool forward)
{
    Instance *instance = instance_enter(handle, function, MODE_RUNNING);
    double *places[N_SEEDS];
    if (!instance || check_direction(instance, function, unknowns, false) != ANSWER_OK ||
        check_direction(instance, function, knowns, true) != ANSWER_OK)
        return ANSWER_ERROR;
    Engine *engine = whole(instance);
    const Direction *from = forward ? knowns : unknowns, *to = forward ? unknowns : knowns;
    engine_seeds(engine, places);
    scatter(from, forward, places);
    bool done = forward ? engine_forward(engine, instance_view(instance), places)
                        : engine_reverse(engine, instance_view(instance), places);
    if (!done)
        return instance_refuse(instance, "%s: %s: %s", instance->name, function, engine_problem(engine));
    if (!all_finite(to, !forward, places)) {
        instance_refuse(instance, "%s: %s: the derivatives are not finite at t = %.17g.", instance->name, function,
                        instance->run->time);
        return ANSWER_DISCARD;
    }
    gather(to, !forward, places);
    return ANSWER_OK;
}

Answer instance_output_rates(void *handle, const char *function, const Reference references[], size_t n,
                             const int32_t orders[], double values[], size_t n_values)
{
    const int modes = MODE_STEP | MODE_INTERMEDIATE | MODE_TERMINATED;
    Instance *instance = instance_enter_kind(handle, function, CO_SIMULATION, modes);
    double *places[N_SEEDS];
    const Direction wanted = {.references = references, .n = n, .results = values, .n_values = n_values};
    if (!instance || check_direction(instance, function, &wanted, false) != ANSWER_OK)
        return ANSWER_ERROR;
    if (n > 0 && !orders)
        return instance_null_argument(instance, function);
    for (size_t i = 0; i < n; i++)
        if (orders[i] != 1)
            return instance_refuse(instance, "%s: %s: derivatives of order %ld are not computed, only the first.",
                                   instance->name, function, (long)orders[i]);
    Engine *engine = whole(instance);
    const double *rates = engine_values(engine, instance_view(instance), BANK_DERIVATIVE);
    if (!rates)
        return instance_refuse(instance, "%s: %s: %s", instance->name, function, engine_problem(engine));
    engine_seeds(engine, places);
    *places[SEED_TIME] = 1.0;
    for (size_t i = 0; i < model.n_states; i++)
        places[SEED_STATES][i] = rates[i];
    if (!engine_forward(engine, instance_view(instance), places))
        return instance_refuse(instance, "%s: %s: %s", instance->name, function, engine_problem(engine));
    if (!all_finite(&wanted, false, places))
        return instance_refuse(instance, "%s: %s: the derivatives are not finite at t = %.17g.", instance->name,
                               function, instance->run->time);
    gather(&wanted, false, places);
    return ANSWER_OK;
}
