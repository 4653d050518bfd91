/* Adjoint derivatives of networks: part by part, then back over the wires (see network.h). */
#include "network_part.h"

/* The adjoints of a member's arguments, out of those of the results of one of its maps, into part. */
int network_part_pull(const NetworkWork *work, const NetworkMember *member, const NetworkMap *map,
                      const NetworkInstant *values, const double *first, const double *second)
{
    network_part_bind(work, member, values);
    work->arg[6] = first;
    work->arg[7] = second;
    work->res[0] = work->part.t;
    work->res[1] = work->part.x;
    work->res[2] = work->part.z;
    work->res[3] = work->part.u;
    work->res[4] = work->part.p;
    return map->reverse(work->arg, work->res, work->iw, work->w, 0);
}

/* Add the adjoints in part, except those of the states, to those of the network. */
void network_part_give_back(const NetworkWork *work, const NetworkMember *member)
{
    const NetworkGroup *group = &work->network->groups[member->group];
    double *const banks[] = {work->seeds.x, work->seeds.z, work->seeds.u, work->seeds.y};
    work->seeds.t[0] += work->part.t[0];
    network_part_add(group->n_parameters, work->part.p, work->seeds.p + member->p);
    for (size_t i = 0; i < group->n_inputs; i++) {
        uint32_t source = work->network->sources[member->input + i];
        banks[network_part_bank(source)][network_part_place(source)] += work->part.u[i];
    }
}

static int pull_back(const NetworkWork *work, const NetworkMember *member, const NetworkMap *map,
                     const NetworkInstant *values, const double *first, const double *second)
{
    const NetworkGroup *group = &work->network->groups[member->group];
    if (network_part_pull(work, member, map, values, first, second) != 0)
        return 1;
    network_part_add(group->n_states, work->part.x, work->seeds.x + member->x);
    network_part_add(group->n_discrete, work->part.z, work->seeds.z + member->z);
    network_part_give_back(work, member);
    return 0;
}

/* The outputs of a piece: their adjoints go to what they were computed from. */
int network_part_pull_outputs(const NetworkWork *work, const NetworkCall *now, const NetworkInstant *values)
{
    const NetworkPiece *piece = &work->network->pieces[now->piece];
    const NetworkMember *member = &work->network->members[now->member];
    double *seed = work->seeds.y + (size_t)member->y + piece->first;
    if (pull_back(work, member, &piece->map, values, seed, NULL) != 0)
        return 1;
    network_part_clear(piece->count, seed);
    return 0;
}

void network_part_hand_out(const NetworkWork *work, double **res)
{
    const Network *n = work->network;
    network_part_copy(1, work->seeds.t, res[0]);
    network_part_copy(n->n_states, work->seeds.x, res[1]);
    network_part_copy(n->n_discrete, work->seeds.z, res[2]);
    network_part_copy(n->n_inputs, work->seeds.u, res[3]);
    network_part_copy(n->n_parameters, work->seeds.p, res[4]);
}

void network_part_clear_adjoints(const NetworkWork *work)
{
    const Network *n = work->network;
    network_part_clear(1, work->seeds.t);
    network_part_clear(n->n_states, work->seeds.x);
    network_part_clear(n->n_discrete, work->seeds.z);
    network_part_clear(n->n_inputs, work->seeds.u);
    network_part_clear(n->n_parameters, work->seeds.p);
    network_part_clear(n->n_outputs, work->seeds.y);
}

int network_reverse(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    NetworkWork work = network_part_work(n, arg, res, iw, w);
    NetworkInstant values = network_part_instant(arg);
    const double *rates = arg[MODEL_N_ARG], *outputs = arg[MODEL_N_ARG + 1];
    if (network_part_wire(&work, &values, NULL) != 0)
        return 1;
    network_part_clear_adjoints(&work);
    for (size_t i = 0; i < n->n_members; i++) {
        const NetworkMember *member = &n->members[i];
        const NetworkGroup *group = &n->groups[member->group];
        if (rates != NULL && group->n_states > 0 &&
            pull_back(&work, member, &group->flow, &values, rates + member->x, NULL) != 0)
            return 1;
        if (outputs != NULL && group->n_outputs > 0 &&
            pull_back(&work, member, &group->outputs, &values, outputs + member->y, NULL) != 0)
            return 1;
    }
    for (size_t i = n->n_calls; i-- > 0;)
        if (network_part_pull_outputs(&work, &n->calls[i], &values) != 0)
            return 1;
    network_part_hand_out(&work, res);
    return 0;
}
