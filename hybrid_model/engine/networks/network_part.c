/* One part of a network: where its arguments are, and what they are wired to (see network_part.h). */
#include "network_part.h"

NetworkWork network_part_work(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    NetworkWork work = {.network = n, .arg = arg + NETWORK_ARG, .res = res + NETWORK_RES, .iw = iw};
    work.x = w;
    work.z = work.x + n->n_states;
    work.y = work.z + n->n_discrete;
    work.seeds.x = work.y + n->n_outputs;
    work.seeds.z = work.seeds.x + n->n_states;
    work.seeds.y = work.seeds.z + n->n_discrete;
    work.seeds.t = work.seeds.y + n->n_outputs;
    work.seeds.u = work.seeds.t + 1;
    work.seeds.p = work.seeds.u + n->n_inputs;
    work.tape = work.seeds.p + n->n_parameters;
    work.inputs = work.tape + n->n_tape;
    work.seed_inputs = work.inputs + n->most_inputs;
    work.part.t = work.seed_inputs + n->most_inputs;
    work.part.x = work.part.t + 1;
    work.part.z = work.part.x + n->most_states;
    work.part.p = work.part.z + n->most_discrete;
    work.part.u = work.seed_inputs;
    work.w = work.part.p + n->most_parameters;
    return work;
}

NetworkInstant network_part_instant(const double *const *arg)
{
    NetworkInstant values = {arg[0], arg[1], arg[2], arg[3], arg[4], NULL};
    return values;
}

const double *network_part_from(const double *vector, size_t first)
{
    return vector != NULL ? vector + first : NULL;
}

void network_part_copy(size_t count, const double *source, double *target)
{
    if (target == NULL)
        return;
    for (size_t i = 0; i < count; i++)
        target[i] = source != NULL ? source[i] : 0.0;
}

void network_part_clear(size_t count, double *target)
{
    network_part_copy(count, NULL, target);
}

void network_part_add(size_t count, const double *source, double *target)
{
    for (size_t i = 0; i < count; i++)
        target[i] += source[i];
}

NetworkSource network_part_bank(uint32_t source)
{
    return (NetworkSource)(source >> NETWORK_SOURCE_BITS);
}

size_t network_part_place(uint32_t source)
{
    return source & ((UINT32_C(1) << NETWORK_SOURCE_BITS) - 1);
}

static double signal(const NetworkInstant *values, uint32_t source)
{
    const double *const banks[] = {values->x, values->z, values->u, values->y};
    const double *bank = banks[network_part_bank(source)];
    return bank != NULL ? bank[network_part_place(source)] : 0.0;
}

/* Let arg[0..4] be the t, x, z, u, p of a member; its inputs are gathered. */
static void bind(const Network *n, const NetworkMember *member, const NetworkInstant *values, double *inputs,
                 const double **arg)
{
    size_t count = n->groups[member->group].n_inputs;
    for (size_t i = 0; i < count; i++)
        inputs[i] = signal(values, n->sources[member->input + i]);
    arg[0] = values->t;
    arg[1] = network_part_from(values->x, member->x);
    arg[2] = network_part_from(values->z, member->z);
    arg[3] = inputs;
    arg[4] = network_part_from(values->p, member->p);
}

void network_part_bind(const NetworkWork *work, const NetworkMember *member, const NetworkInstant *values)
{
    bind(work->network, member, values, work->inputs, work->arg);
    work->arg[5] = work->network->constants + member->constant;
}

void network_part_bind_tangents(const NetworkWork *work, const NetworkMember *member, const NetworkInstant *tangents)
{
    bind(work->network, member, tangents, work->seed_inputs, work->arg + 6);
}

int network_part_call(const NetworkWork *work, ModelFunction function, double *first, double *second)
{
    work->res[0] = first;
    work->res[1] = second;
    return function(work->arg, work->res, work->iw, work->w, 0);
}

/* One piece of the outputs of a member; `tangents` may be NULL. */
int network_part_outputs(const NetworkWork *work, const NetworkCall *now, const NetworkInstant *values,
                         const NetworkInstant *tangents)
{
    const NetworkPiece *piece = &work->network->pieces[now->piece];
    const NetworkMember *member = &work->network->members[now->member];
    size_t first = (size_t)member->y + piece->first;
    network_part_bind(work, member, values);
    if (network_part_call(work, piece->map.value, work->y + first, NULL) != 0)
        return 1;
    if (tangents == NULL)
        return 0;
    network_part_bind_tangents(work, member, tangents);
    return network_part_call(work, piece->map.forward, work->seeds.y + first, NULL);
}

/* Complete an instant by the outputs that inputs are wired to. */
int network_part_wire(const NetworkWork *work, NetworkInstant *values, NetworkInstant *tangents)
{
    const Network *n = work->network;
    values->y = work->y;
    if (tangents != NULL)
        tangents->y = work->seeds.y;
    if (n->n_calls == 0)
        return 0;
    /* Parts may be handed inputs that are not there yet, if what is computed does not depend on them. */
    network_part_clear(n->n_outputs, work->y);
    if (tangents != NULL)
        network_part_clear(n->n_outputs, work->seeds.y);
    for (size_t i = 0; i < n->n_calls; i++)
        if (network_part_outputs(work, &n->calls[i], values, tangents) != 0)
            return 1;
    return 0;
}
