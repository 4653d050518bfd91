/* Start values of networks, and their derivatives (see network.h). */
#include "network_part.h"

/* The start values of one member, in place; `tangents` may be NULL. */
static int start_member(const NetworkWork *work, const NetworkMember *member, const NetworkInstant *values,
                        const NetworkInstant *tangents)
{
    const NetworkGroup *group = &work->network->groups[member->group];
    network_part_bind(work, member, values);
    if (tangents != NULL) {
        network_part_bind_tangents(work, member, tangents);
        if (network_part_call(work, group->start.forward, work->part.x, work->part.z) != 0)
            return 1;
        network_part_copy(group->n_states, work->part.x, work->seeds.x + member->x);
        network_part_copy(group->n_discrete, work->part.z, work->seeds.z + member->z);
    }
    if (network_part_call(work, group->start.value, work->part.x, work->part.z) != 0)
        return 1;
    network_part_copy(group->n_states, work->part.x, work->x + member->x);
    network_part_copy(group->n_discrete, work->part.z, work->z + member->z);
    return 0;
}

/* Start values part by part: later parts see those of earlier ones.  What outputs were before goes to the tape. */
static int start_all(const NetworkWork *work, NetworkInstant *values, NetworkInstant *tangents)
{
    const Network *n = work->network;
    size_t written = 0;
    network_part_copy(n->n_states, values->x, work->x);
    network_part_copy(n->n_discrete, values->z, work->z);
    network_part_clear(n->n_outputs, work->y);
    values->x = work->x;
    values->z = work->z;
    values->y = work->y;
    if (tangents != NULL) {
        network_part_copy(n->n_states, tangents->x, work->seeds.x);
        network_part_copy(n->n_discrete, tangents->z, work->seeds.z);
        network_part_clear(n->n_outputs, work->seeds.y);
        tangents->x = work->seeds.x;
        tangents->z = work->seeds.z;
        tangents->y = work->seeds.y;
    }
    for (size_t i = 0; i < n->n_start_calls; i++) {
        const NetworkCall *now = &n->start_calls[i];
        const NetworkMember *member = &n->members[now->member];
        if (now->piece == NETWORK_START) {
            if (start_member(work, member, values, tangents) != 0)
                return 1;
            continue;
        }
        const NetworkPiece *piece = &n->pieces[now->piece];
        network_part_copy(piece->count, work->y + (size_t)member->y + piece->first, work->tape + written);
        written += piece->count;
        if (network_part_outputs(work, now, values, tangents) != 0)
            return 1;
    }
    return 0;
}

int network_start(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    NetworkWork work = network_part_work(n, arg, res, iw, w);
    NetworkInstant values = network_part_instant(arg);
    double *x = res[0], *z = res[1];
    if (start_all(&work, &values, NULL) != 0)
        return 1;
    network_part_copy(n->n_states, work.x, x);
    network_part_copy(n->n_discrete, work.z, z);
    return 0;
}

int network_start_forward(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    NetworkWork work = network_part_work(n, arg, res, iw, w);
    NetworkInstant values = network_part_instant(arg), tangents = network_part_instant(arg + MODEL_N_ARG);
    double *x = res[0], *z = res[1];
    if (start_all(&work, &values, &tangents) != 0)
        return 1;
    network_part_copy(n->n_states, work.seeds.x, x);
    network_part_copy(n->n_discrete, work.seeds.z, z);
    return 0;
}

/* Undo the start values of one member, and pull their adjoints back to what they were computed from. */
static int unstart_member(const NetworkWork *work, const NetworkMember *member, const NetworkInstant *values,
                          const NetworkInstant *given)
{
    const NetworkGroup *group = &work->network->groups[member->group];
    double *x = work->seeds.x + member->x, *z = work->seeds.z + member->z;
    network_part_copy(group->n_states, network_part_from(given->x, member->x), work->x + member->x);
    network_part_copy(group->n_discrete, network_part_from(given->z, member->z), work->z + member->z);
    if (network_part_pull(work, member, &group->start, values, x, z) != 0)
        return 1;
    network_part_copy(group->n_states, work->part.x, x);
    network_part_copy(group->n_discrete, work->part.z, z);
    network_part_give_back(work, member);
    return 0;
}

int network_start_reverse(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    NetworkWork work = network_part_work(n, arg, res, iw, w);
    NetworkInstant given = network_part_instant(arg), values = given;
    const double *x = arg[MODEL_N_ARG], *z = arg[MODEL_N_ARG + 1];
    size_t written = n->n_tape;
    if (start_all(&work, &values, NULL) != 0)
        return 1;
    network_part_clear_adjoints(&work);
    network_part_copy(n->n_states, x, work.seeds.x);
    network_part_copy(n->n_discrete, z, work.seeds.z);
    for (size_t i = n->n_start_calls; i-- > 0;) {
        const NetworkCall *now = &n->start_calls[i];
        const NetworkMember *member = &n->members[now->member];
        if (now->piece == NETWORK_START) {
            if (unstart_member(&work, member, &values, &given) != 0)
                return 1;
            continue;
        }
        const NetworkPiece *piece = &n->pieces[now->piece];
        if (network_part_pull_outputs(&work, now, &values) != 0)
            return 1;
        written -= piece->count;
        network_part_copy(piece->count, work.tape + written, work.y + (size_t)member->y + piece->first);
    }
    network_part_hand_out(&work, res);
    return 0;
}
