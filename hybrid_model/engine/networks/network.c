/* The maps of networks and their directional derivatives, part by part (see network.h). */
#include <math.h>

#include "network_part.h"

/* What a map of the members gives, and where in the vector of the network it begins; without a function, nothing. */
typedef struct {
    ModelFunction function;
    size_t at;
} Share;

typedef Share (*ShareOf)(const NetworkGroup *group, const NetworkMember *member);

static Share rates(const NetworkGroup *group, const NetworkMember *member)
{
    return (Share){group->flow.value, member->x};
}

static Share rate_tangents(const NetworkGroup *group, const NetworkMember *member)
{
    return (Share){group->flow.forward, member->x};
}

static Share outputs(const NetworkGroup *group, const NetworkMember *member)
{
    return (Share){group->outputs.value, member->y};
}

static Share output_tangents(const NetworkGroup *group, const NetworkMember *member)
{
    return (Share){group->outputs.forward, member->y};
}

static Share margins(const NetworkGroup *group, const NetworkMember *member)
{
    return (Share){group->margins, member->margin};
}

static Share times(const NetworkGroup *group, const NetworkMember *member)
{
    return (Share){group->times, member->time};
}

/* The shares of all members at a complete instant; `tangents` may be NULL, and so may `result`: nothing to do. */
static int gather(const NetworkWork *work, ShareOf share_of, const NetworkInstant *values,
                  const NetworkInstant *tangents, double *result)
{
    const Network *n = work->network;
    for (size_t i = 0; result != NULL && i < n->n_members; i++) {
        const NetworkMember *member = &n->members[i];
        Share share = share_of(&n->groups[member->group], member);
        if (share.function == NULL)
            continue;
        network_part_bind(work, member, values);
        if (tangents != NULL)
            network_part_bind_tangents(work, member, tangents);
        if (network_part_call(work, share.function, result + share.at, NULL) != 0)
            return 1;
    }
    return 0;
}

/* Wire, then gather: a map of the network that gives one vector. */
static int map(const Network *n, ShareOf share_of, const double **arg, double **res, long long *iw, double *w)
{
    NetworkWork work = network_part_work(n, arg, res, iw, w);
    NetworkInstant values = network_part_instant(arg);
    if (res[0] == NULL)
        return 0;
    return network_part_wire(&work, &values, NULL) != 0 || gather(&work, share_of, &values, NULL, res[0]) != 0;
}

int network_flow(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    return map(n, rates, arg, res, iw, w);
}

int network_margins(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    return map(n, margins, arg, res, iw, w);
}

int network_times(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    return map(n, times, arg, res, iw, w);
}

int network_outputs(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    return map(n, outputs, arg, res, iw, w);
}

int network_forward(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    NetworkWork work = network_part_work(n, arg, res, iw, w);
    NetworkInstant values = network_part_instant(arg), tangents = network_part_instant(arg + MODEL_N_ARG);
    return network_part_wire(&work, &values, &tangents) != 0 ||
           gather(&work, rate_tangents, &values, &tangents, res[0]) != 0 ||
           gather(&work, output_tangents, &values, &tangents, res[1]) != 0;
}

int network_flow_set(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    NetworkWork work = network_part_work(n, arg, res, iw, w);
    NetworkInstant values = network_part_instant(arg);
    bool first = true;
    if (res[0] == NULL)
        return 0;
    *res[0] = 1.0;
    if (network_part_wire(&work, &values, NULL) != 0)
        return 1;
    for (size_t i = 0; i < n->n_members; i++) {
        const NetworkMember *member = &n->members[i];
        const NetworkGroup *group = &n->groups[member->group];
        double margin;
        if (!group->has_flow_set)
            continue;
        network_part_bind(&work, member, &values);
        if (network_part_call(&work, group->flow_set, &margin, NULL) != 0)
            return 1;
        *res[0] = first ? margin : fmin(*res[0], margin);
        first = false;
    }
    return 0;
}

int network_reset(const Network *n, size_t jump, const double **arg, double **res, long long *iw, double *w)
{
    NetworkWork work = network_part_work(n, arg, res, iw, w);
    NetworkInstant values = network_part_instant(arg);
    const NetworkMember *member = &n->members[n->jump_member[jump]];
    const NetworkGroup *group = &n->groups[member->group];
    double *x = res[0], *z = res[1];
    if (network_part_wire(&work, &values, NULL) != 0)
        return 1;
    network_part_copy(n->n_states, values.x, x);
    network_part_copy(n->n_discrete, values.z, z);
    network_part_bind(&work, member, &values);
    return network_part_call(&work, group->resets[jump - member->jump], x != NULL ? x + member->x : NULL,
                             z != NULL ? z + member->z : NULL);
}
