/* Networks as loops over tables (see network.h).

   Every part's states, parameters and outputs are consecutive in the vectors of the network, so that its functions
   read them where they are.  Only inputs are gathered: over wires, from states and outputs of other parts. */
#include <math.h>

#include "network.h"

/* The values of the network at one instant, or their tangents, or their adjoints.  A vector may be NULL: zeros. */
typedef struct {
    const double *t, *x, *z, *u, *p, *y;
} Instant;

typedef struct {
    double *t, *x, *z, *u, *p, *y;
} Vectors;

/* What a call hands to the functions of the parts. */
typedef struct {
    const Network *network;
    const double **arg;
    double **res;
    long long *iw;
    double *w;
    double *x, *z, *y;           /* states at the start and outputs on the way, complete */
    Vectors seeds;               /* their tangents, or all adjoints */
    double *tape;
    double *inputs, *seed_inputs;
    Vectors part;                /* results for one part */
} Work;

static Work begin(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    Work k = {.network = n, .arg = arg + NETWORK_ARG, .res = res + NETWORK_RES, .iw = iw};
    k.x = w;
    k.z = k.x + n->n_states;
    k.y = k.z + n->n_discrete;
    k.seeds.x = k.y + n->n_outputs;
    k.seeds.z = k.seeds.x + n->n_states;
    k.seeds.y = k.seeds.z + n->n_discrete;
    k.seeds.t = k.seeds.y + n->n_outputs;
    k.seeds.u = k.seeds.t + 1;
    k.seeds.p = k.seeds.u + n->n_inputs;
    k.tape = k.seeds.p + n->n_parameters;
    k.inputs = k.tape + n->n_tape;
    k.seed_inputs = k.inputs + n->most_inputs;
    k.part.t = k.seed_inputs + n->most_inputs;
    k.part.x = k.part.t + 1;
    k.part.z = k.part.x + n->most_states;
    k.part.p = k.part.z + n->most_discrete;
    k.part.u = k.seed_inputs;
    k.w = k.part.p + n->most_parameters;
    return k;
}

static Instant instant(const double *const *arg)
{
    Instant values = {arg[0], arg[1], arg[2], arg[3], arg[4], NULL};
    return values;
}

static const double *from(const double *vector, size_t first)
{
    return vector != NULL ? vector + first : NULL;
}

static void copy(size_t count, const double *source, double *target)
{
    if (target == NULL)
        return;
    for (size_t i = 0; i < count; i++)
        target[i] = source != NULL ? source[i] : 0.0;
}

static void clear(size_t count, double *target)
{
    copy(count, NULL, target);
}

static void add(size_t count, const double *source, double *target)
{
    for (size_t i = 0; i < count; i++)
        target[i] += source[i];
}

static NetworkSource bank_of(uint32_t source)
{
    return (NetworkSource)(source >> NETWORK_SOURCE_BITS);
}

static size_t place_of(uint32_t source)
{
    return source & ((UINT32_C(1) << NETWORK_SOURCE_BITS) - 1);
}

static double signal(const Instant *values, uint32_t source)
{
    const double *const banks[] = {values->x, values->z, values->u, values->y};
    const double *bank = banks[bank_of(source)];
    return bank != NULL ? bank[place_of(source)] : 0.0;
}

/* Let arg[0..4] be the t, x, z, u, p of a member; its inputs are gathered. */
static void bind(const Network *n, const NetworkMember *member, const Instant *values, double *inputs,
                 const double **arg)
{
    size_t count = n->groups[member->group].n_inputs;
    for (size_t i = 0; i < count; i++)
        inputs[i] = signal(values, n->sources[member->input + i]);
    arg[0] = values->t;
    arg[1] = from(values->x, member->x);
    arg[2] = from(values->z, member->z);
    arg[3] = inputs;
    arg[4] = from(values->p, member->p);
}

static void bind_values(const Work *k, const NetworkMember *member, const Instant *values)
{
    bind(k->network, member, values, k->inputs, k->arg);
    k->arg[5] = k->network->constants + member->constant;
}

static void bind_tangents(const Work *k, const NetworkMember *member, const Instant *tangents)
{
    bind(k->network, member, tangents, k->seed_inputs, k->arg + 6);
}

static int call(const Work *k, ModelFunction function, double *first, double *second)
{
    k->res[0] = first;
    k->res[1] = second;
    return function(k->arg, k->res, k->iw, k->w, 0);
}

/* One piece of the outputs of a member; `tangents` may be NULL. */
static int output_piece(const Work *k, const NetworkCall *now, const Instant *values, const Instant *tangents)
{
    const NetworkPiece *piece = &k->network->pieces[now->piece];
    const NetworkMember *member = &k->network->members[now->member];
    size_t first = (size_t)member->y + piece->first;
    bind_values(k, member, values);
    if (call(k, piece->map.value, k->y + first, NULL) != 0)
        return 1;
    if (tangents == NULL)
        return 0;
    bind_tangents(k, member, tangents);
    return call(k, piece->map.forward, k->seeds.y + first, NULL);
}

/* Complete an instant by the outputs that inputs are wired to. */
static int wire(const Work *k, Instant *values, Instant *tangents)
{
    const Network *n = k->network;
    values->y = k->y;
    if (tangents != NULL)
        tangents->y = k->seeds.y;
    if (n->n_calls == 0)
        return 0;
    /* Parts may be handed inputs that are not there yet, if what is computed does not depend on them. */
    clear(n->n_outputs, k->y);
    if (tangents != NULL)
        clear(n->n_outputs, k->seeds.y);
    for (size_t i = 0; i < n->n_calls; i++)
        if (output_piece(k, &n->calls[i], values, tangents) != 0)
            return 1;
    return 0;
}

int network_flow(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    Work k = begin(n, arg, res, iw, w);
    Instant values = instant(arg);
    if (res[0] == NULL)
        return 0;
    if (wire(&k, &values, NULL) != 0)
        return 1;
    for (size_t i = 0; i < n->n_members; i++) {
        const NetworkMember *member = &n->members[i];
        const NetworkGroup *group = &n->groups[member->group];
        if (group->n_states == 0)
            continue;
        bind_values(&k, member, &values);
        if (call(&k, group->flow.value, res[0] + member->x, NULL) != 0)
            return 1;
    }
    return 0;
}

int network_flow_set(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    Work k = begin(n, arg, res, iw, w);
    Instant values = instant(arg);
    bool first = true;
    if (res[0] == NULL)
        return 0;
    *res[0] = 1.0;
    if (wire(&k, &values, NULL) != 0)
        return 1;
    for (size_t i = 0; i < n->n_members; i++) {
        const NetworkMember *member = &n->members[i];
        const NetworkGroup *group = &n->groups[member->group];
        double margin;
        if (!group->has_flow_set)
            continue;
        bind_values(&k, member, &values);
        if (call(&k, group->flow_set, &margin, NULL) != 0)
            return 1;
        *res[0] = first ? margin : fmin(*res[0], margin);
        first = false;
    }
    return 0;
}

int network_margins(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    Work k = begin(n, arg, res, iw, w);
    Instant values = instant(arg);
    if (res[0] == NULL)
        return 0;
    if (wire(&k, &values, NULL) != 0)
        return 1;
    for (size_t i = 0; i < n->n_members; i++) {
        const NetworkMember *member = &n->members[i];
        const NetworkGroup *group = &n->groups[member->group];
        if (group->n_margins == 0)
            continue;
        bind_values(&k, member, &values);
        if (call(&k, group->margins, res[0] + member->margin, NULL) != 0)
            return 1;
    }
    return 0;
}

int network_times(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    Work k = begin(n, arg, res, iw, w);
    Instant values = instant(arg);
    if (res[0] == NULL)
        return 0;
    if (wire(&k, &values, NULL) != 0)
        return 1;
    for (size_t i = 0; i < n->n_members; i++) {
        const NetworkMember *member = &n->members[i];
        const NetworkGroup *group = &n->groups[member->group];
        if (group->n_times == 0)
            continue;
        bind_values(&k, member, &values);
        if (call(&k, group->times, res[0] + member->time, NULL) != 0)
            return 1;
    }
    return 0;
}

/* Outputs of all parts, and their tangents if `y` or `seed` ask for them. */
static int all_outputs(const Work *k, const Instant *values, const Instant *tangents, double *y, double *seed)
{
    const Network *n = k->network;
    for (size_t i = 0; i < n->n_members; i++) {
        const NetworkMember *member = &n->members[i];
        const NetworkGroup *group = &n->groups[member->group];
        if (group->n_outputs == 0)
            continue;
        bind_values(k, member, values);
        if (y != NULL && call(k, group->outputs.value, y + member->y, NULL) != 0)
            return 1;
        if (seed == NULL)
            continue;
        bind_tangents(k, member, tangents);
        if (call(k, group->outputs.forward, seed + member->y, NULL) != 0)
            return 1;
    }
    return 0;
}

int network_outputs(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    Work k = begin(n, arg, res, iw, w);
    Instant values = instant(arg);
    if (res[0] == NULL)
        return 0;
    return wire(&k, &values, NULL) != 0 || all_outputs(&k, &values, NULL, res[0], NULL) != 0;
}

int network_reset(const Network *n, size_t jump, const double **arg, double **res, long long *iw, double *w)
{
    Work k = begin(n, arg, res, iw, w);
    Instant values = instant(arg);
    const NetworkMember *member = &n->members[n->jump_member[jump]];
    const NetworkGroup *group = &n->groups[member->group];
    double *x = res[0], *z = res[1];
    if (wire(&k, &values, NULL) != 0)
        return 1;
    copy(n->n_states, values.x, x);
    copy(n->n_discrete, values.z, z);
    bind_values(&k, member, &values);
    return call(&k, group->resets[jump - member->jump], x != NULL ? x + member->x : NULL,
                z != NULL ? z + member->z : NULL);
}

int network_forward(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    Work k = begin(n, arg, res, iw, w);
    Instant values = instant(arg), tangents = instant(arg + MODEL_N_ARG);
    if (wire(&k, &values, &tangents) != 0)
        return 1;
    for (size_t i = 0; res[0] != NULL && i < n->n_members; i++) {
        const NetworkMember *member = &n->members[i];
        const NetworkGroup *group = &n->groups[member->group];
        if (group->n_states == 0)
            continue;
        bind_values(&k, member, &values);
        bind_tangents(&k, member, &tangents);
        if (call(&k, group->flow.forward, res[0] + member->x, NULL) != 0)
            return 1;
    }
    return all_outputs(&k, &values, &tangents, NULL, res[1]);
}

/* The adjoints of a member's arguments, out of those of the results of one of its maps, into part. */
static int pull(const Work *k, const NetworkMember *member, const NetworkMap *map, const Instant *values,
                const double *first, const double *second)
{
    bind_values(k, member, values);
    k->arg[6] = first;
    k->arg[7] = second;
    k->res[0] = k->part.t;
    k->res[1] = k->part.x;
    k->res[2] = k->part.z;
    k->res[3] = k->part.u;
    k->res[4] = k->part.p;
    return map->reverse(k->arg, k->res, k->iw, k->w, 0);
}

/* Add the adjoints in part, except those of the states, to those of the network. */
static void give_back(const Work *k, const NetworkMember *member)
{
    const NetworkGroup *group = &k->network->groups[member->group];
    double *const banks[] = {k->seeds.x, k->seeds.z, k->seeds.u, k->seeds.y};
    k->seeds.t[0] += k->part.t[0];
    add(group->n_parameters, k->part.p, k->seeds.p + member->p);
    for (size_t i = 0; i < group->n_inputs; i++) {
        uint32_t source = k->network->sources[member->input + i];
        banks[bank_of(source)][place_of(source)] += k->part.u[i];
    }
}

static int pull_back(const Work *k, const NetworkMember *member, const NetworkMap *map, const Instant *values,
                     const double *first, const double *second)
{
    const NetworkGroup *group = &k->network->groups[member->group];
    if (pull(k, member, map, values, first, second) != 0)
        return 1;
    add(group->n_states, k->part.x, k->seeds.x + member->x);
    add(group->n_discrete, k->part.z, k->seeds.z + member->z);
    give_back(k, member);
    return 0;
}

/* The outputs of a piece: their adjoints go to what they were computed from. */
static int pull_back_piece(const Work *k, const NetworkCall *now, const Instant *values)
{
    const NetworkPiece *piece = &k->network->pieces[now->piece];
    const NetworkMember *member = &k->network->members[now->member];
    double *seed = k->seeds.y + (size_t)member->y + piece->first;
    if (pull_back(k, member, &piece->map, values, seed, NULL) != 0)
        return 1;
    clear(piece->count, seed);
    return 0;
}

static void hand_out(const Work *k, double **res)
{
    const Network *n = k->network;
    copy(1, k->seeds.t, res[0]);
    copy(n->n_states, k->seeds.x, res[1]);
    copy(n->n_discrete, k->seeds.z, res[2]);
    copy(n->n_inputs, k->seeds.u, res[3]);
    copy(n->n_parameters, k->seeds.p, res[4]);
}

static void clear_seeds(const Work *k)
{
    const Network *n = k->network;
    clear(1, k->seeds.t);
    clear(n->n_states, k->seeds.x);
    clear(n->n_discrete, k->seeds.z);
    clear(n->n_inputs, k->seeds.u);
    clear(n->n_parameters, k->seeds.p);
    clear(n->n_outputs, k->seeds.y);
}

int network_reverse(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    Work k = begin(n, arg, res, iw, w);
    Instant values = instant(arg);
    const double *rates = arg[MODEL_N_ARG], *outputs = arg[MODEL_N_ARG + 1];
    if (wire(&k, &values, NULL) != 0)
        return 1;
    clear_seeds(&k);
    for (size_t i = 0; i < n->n_members; i++) {
        const NetworkMember *member = &n->members[i];
        const NetworkGroup *group = &n->groups[member->group];
        if (rates != NULL && group->n_states > 0 &&
            pull_back(&k, member, &group->flow, &values, rates + member->x, NULL) != 0)
            return 1;
        if (outputs != NULL && group->n_outputs > 0 &&
            pull_back(&k, member, &group->outputs, &values, outputs + member->y, NULL) != 0)
            return 1;
    }
    for (size_t i = n->n_calls; i-- > 0;)
        if (pull_back_piece(&k, &n->calls[i], &values) != 0)
            return 1;
    hand_out(&k, res);
    return 0;
}

/* The start values of one member, in place; `tangents` may be NULL. */
static int start_member(const Work *k, const NetworkMember *member, const Instant *values, const Instant *tangents)
{
    const NetworkGroup *group = &k->network->groups[member->group];
    bind_values(k, member, values);
    if (tangents != NULL) {
        bind_tangents(k, member, tangents);
        if (call(k, group->start.forward, k->part.x, k->part.z) != 0)
            return 1;
        copy(group->n_states, k->part.x, k->seeds.x + member->x);
        copy(group->n_discrete, k->part.z, k->seeds.z + member->z);
    }
    if (call(k, group->start.value, k->part.x, k->part.z) != 0)
        return 1;
    copy(group->n_states, k->part.x, k->x + member->x);
    copy(group->n_discrete, k->part.z, k->z + member->z);
    return 0;
}

/* Start values part by part: later parts see those of earlier ones.  What outputs were before goes to the tape. */
static int start_all(const Work *k, Instant *values, Instant *tangents)
{
    const Network *n = k->network;
    size_t written = 0;
    copy(n->n_states, values->x, k->x);
    copy(n->n_discrete, values->z, k->z);
    clear(n->n_outputs, k->y);
    values->x = k->x;
    values->z = k->z;
    values->y = k->y;
    if (tangents != NULL) {
        copy(n->n_states, tangents->x, k->seeds.x);
        copy(n->n_discrete, tangents->z, k->seeds.z);
        clear(n->n_outputs, k->seeds.y);
        tangents->x = k->seeds.x;
        tangents->z = k->seeds.z;
        tangents->y = k->seeds.y;
    }
    for (size_t i = 0; i < n->n_start_calls; i++) {
        const NetworkCall *now = &n->start_calls[i];
        const NetworkMember *member = &n->members[now->member];
        if (now->piece == NETWORK_START) {
            if (start_member(k, member, values, tangents) != 0)
                return 1;
            continue;
        }
        const NetworkPiece *piece = &n->pieces[now->piece];
        copy(piece->count, k->y + (size_t)member->y + piece->first, k->tape + written);
        written += piece->count;
        if (output_piece(k, now, values, tangents) != 0)
            return 1;
    }
    return 0;
}

int network_start(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    Work k = begin(n, arg, res, iw, w);
    Instant values = instant(arg);
    double *x = res[0], *z = res[1];
    if (start_all(&k, &values, NULL) != 0)
        return 1;
    copy(n->n_states, k.x, x);
    copy(n->n_discrete, k.z, z);
    return 0;
}

int network_start_forward(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    Work k = begin(n, arg, res, iw, w);
    Instant values = instant(arg), tangents = instant(arg + MODEL_N_ARG);
    double *x = res[0], *z = res[1];
    if (start_all(&k, &values, &tangents) != 0)
        return 1;
    copy(n->n_states, k.seeds.x, x);
    copy(n->n_discrete, k.seeds.z, z);
    return 0;
}

/* Undo the start values of one member, and pull their adjoints back to what they were computed from. */
static int unstart_member(const Work *k, const NetworkMember *member, const Instant *values, const Instant *given)
{
    const NetworkGroup *group = &k->network->groups[member->group];
    double *x = k->seeds.x + member->x, *z = k->seeds.z + member->z;
    copy(group->n_states, from(given->x, member->x), k->x + member->x);
    copy(group->n_discrete, from(given->z, member->z), k->z + member->z);
    if (pull(k, member, &group->start, values, x, z) != 0)
        return 1;
    copy(group->n_states, k->part.x, x);
    copy(group->n_discrete, k->part.z, z);
    give_back(k, member);
    return 0;
}

int network_start_reverse(const Network *n, const double **arg, double **res, long long *iw, double *w)
{
    Work k = begin(n, arg, res, iw, w);
    Instant given = instant(arg), values = given;
    const double *x = arg[MODEL_N_ARG], *z = arg[MODEL_N_ARG + 1];
    size_t written = n->n_tape;
    if (start_all(&k, &values, NULL) != 0)
        return 1;
    clear_seeds(&k);
    copy(n->n_states, x, k.seeds.x);
    copy(n->n_discrete, z, k.seeds.z);
    for (size_t i = n->n_start_calls; i-- > 0;) {
        const NetworkCall *now = &n->start_calls[i];
        const NetworkMember *member = &n->members[now->member];
        if (now->piece == NETWORK_START) {
            if (unstart_member(&k, member, &values, &given) != 0)
                return 1;
            continue;
        }
        const NetworkPiece *piece = &n->pieces[now->piece];
        if (pull_back_piece(&k, now, &values) != 0)
            return 1;
        written -= piece->count;
        copy(piece->count, k.tape + written, k.y + (size_t)member->y + piece->first);
    }
    hand_out(&k, res);
    return 0;
}
